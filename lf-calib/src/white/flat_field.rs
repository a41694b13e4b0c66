//! The flat field: the counts of each pixel over the counts that it should have.
//!
//! It is the white image divided by a prediction for an evenly lit stop: the image of the stop under each lenslet, a
//! disc of diameter `k D` about `c (1 + k)` or a square, with the camera's blur. Neighbours that overlap add up. The
//! quotient is scaled to a median of 1 over well-lit pixels. It is 1 where (almost) no light is predicted, so that no
//! noise is amplified, and 0 where light is predicted but none arrives.

use super::stop_image::StopImage;
use crate::fit::lenslet_images::{LensletImages, image_px};
use glam::DVec2;
use lf_core::{Camera, Optics, camera::Aperture, halo::Halo, statistics::upper_median};
use ndarray::Array2;
use rayon::prelude::*;

/// A pixel with at least this share of the full light is well lit; below the second share the quotient would be noise.
const WELL_LIT: f32 = 0.9;
const LEAST_LIGHT: f32 = 0.1;
/// A sharp rim is drawn with this blur, px, because the table needs one. It changes the light of a pixel by some
/// thousandths.
const LEAST_BLUR_PX: f64 = 0.02;
/// The light of a pixel at the rim of a disc is the mean of a square of samples. They are this many standard deviations
/// of the blur apart, so that the rim is smooth between them.
const APART: f64 = 2.5;
/// Smallest and largest number of samples along a side of a pixel.
const SAMPLES: [f64; 2] = [4.0, 16.0];
/// Rows of the image that are predicted together.
const BAND: usize = 32;

/// The flat field of a camera, from a white image of its size minus the dark image. None if no pixel is well lit.
pub fn flat_field(white: &Array2<f32>, camera: &Camera) -> Option<Array2<f32>> {
    let mut flat = predicted(camera);
    let mut lit: Vec<f32> =
        flat.iter().zip(white).filter(|(light, _)| **light >= WELL_LIT).map(|(light, count)| count / light).collect();
    let median = upper_median(&mut lit).filter(|median| *median > 0.0)?;
    flat.zip_mut_with(white, |light, count| {
        *light = if *light < LEAST_LIGHT { 1.0 } else { count / (*light * median) }
    });
    Some(flat)
}

/// Light of an evenly lit stop in every pixel; 1 in the middle of a lenslet image.
fn predicted(camera: &Camera) -> Array2<f32> {
    let (width, height) = (camera.sensor.width, camera.sensor.height);
    let (optics, lattice, images) = (Optics::new(camera), camera.lattice(), LensletImages::new(camera));
    let stop = StopLight::new(camera);
    let reach_px = DVec2::new(0.5 * width as f64, 0.5 * BAND as f64) + stop.reach_px + 2.0;
    let mut light = Array2::zeros((height, width));
    let bands = light.as_slice_mut().expect("a new array is one slice").par_chunks_mut(BAND * width);
    bands.enumerate().for_each(|(band, pixels)| {
        let top = band * BAND;
        let middle_mm = images.lenslet_mm(DVec2::new(0.5 * width as f64, top as f64 + 0.5 * BAND as f64));
        for (_, _, centre) in lattice.lenslets_within(middle_mm, reach_px * images.lenslet_mm_per_px()) {
            let centre = image_px(&optics, centre);
            let range = |centre: f64, from: usize, to: usize| {
                let edge = |place: f64| place.clamp(from as f64, to as f64) as usize;
                edge((centre - stop.reach_px).floor())..edge((centre + stop.reach_px).ceil())
            };
            for row in range(centre.y, top, top + pixels.len() / width) {
                let line = &mut pixels[(row - top) * width..(row - top + 1) * width];
                for column in range(centre.x, 0, width) {
                    line[column] += stop.on_pixel(DVec2::new(column as f64, row as f64) + 0.5 - centre) as f32;
                }
            }
        }
    });
    if let Some(halo) = Halo::new(camera) {
        light *= halo.middle_share() as f32;
        let far = halo.around(light.as_slice().expect("a new array is one slice"), width);
        light.iter_mut().zip(far).for_each(|(light, far)| *light += far);
    }
    light
}

/// The stop's image under a lenslet, without the far light of diffraction.
struct StopLight {
    shape: Aperture,
    image: StopImage,
    samples: usize,
    /// A pixel whose farthest corner is this near to the centre is full, px.
    full_px: f64,
    /// A pixel whose middle is farther has no light, px.
    reach_px: f64,
}

impl StopLight {
    fn new(camera: &Camera) -> Self {
        let shape = camera.main_lens.aperture;
        let half_px = 0.5 * camera.stop_image_px();
        let sigma_px = camera.blur_core_px();
        let image = StopImage::new(shape, half_px, sigma_px.max(LEAST_BLUR_PX), &[0]);
        let inwards_px = if sigma_px > 0.0 { image.blur_px() } else { 0.0 };
        let reach_px = half_px + image.blur_px() + std::f64::consts::FRAC_1_SQRT_2;
        let [fewest, most] = SAMPLES;
        let samples = (1.0 / (APART * sigma_px)).clamp(fewest, most).ceil() as usize;
        Self { shape, image, samples, full_px: half_px - inwards_px, reach_px }
    }

    /// Light of a pixel at an offset from the centre; 1 if it is full.
    fn on_pixel(&self, offset_px: DVec2) -> f64 {
        let at = |offset_px: DVec2| {
            let mut light = [0.0];
            self.image.add(offset_px, &mut light);
            light[0]
        };
        match self.shape {
            // Its table is that of pixels.
            Aperture::Square => at(offset_px),
            Aperture::Circle if (offset_px.abs() + 0.5).length() < self.full_px => 1.0,
            Aperture::Circle => {
                let count = self.samples * self.samples;
                let side = |n: usize| (n as f64 + 0.5) / self.samples as f64 - 0.5;
                let places = (0..count).map(|n| DVec2::new(side(n % self.samples), side(n / self.samples)));
                places.map(|place| at(offset_px + place)).sum::<f64>() / count as f64
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::view::tests::seed;
    use lf_core::camera::{Blur, Layout};

    /// Light of a pixel at the rim of a sharp disc, by fine points.
    #[test]
    fn a_sharp_rim_is_the_share_of_the_pixel() {
        let camera = seed(10, Layout::Square);
        let stop = StopLight::new(&camera);
        let half = 0.5 * camera.demagnification() * camera.aperture_mm() / 0.0055;
        for n in 0..40 {
            let at = DVec2::from_angle(0.21 * f64::from(n)) * (half - 1.0 + 0.05 * f64::from(n));
            let inside = (0..10_000)
                .map(|n| at + (DVec2::new((n % 100) as f64, (n / 100) as f64) + 0.5) / 100.0 - 0.5)
                .filter(|place| place.length() < half);
            let wanted = inside.count() as f64 / 10_000.0;
            assert!((stop.on_pixel(at) - wanted).abs() < 0.015, "{at}: {} {wanted}", stop.on_pixel(at));
        }
    }

    /// All light of the stop arrives on the sensor, whatever the blur.
    #[test]
    fn blur_moves_light_and_loses_none() {
        let mut camera = seed(10, Layout::Hexagonal);
        let middle = |camera: &Camera| predicted(camera).slice(ndarray::s![42..98, 42..98]).sum();
        let sharp = middle(&camera);
        camera.blur = Some(Blur { wavelength_nm: Some(532.0), sigma_px: 0.4, ..Blur::default() });
        let blurred = middle(&camera);
        assert!((blurred / sharp - 1.0).abs() < 0.005, "{blurred} {sharp}");
        let difference = &predicted(&camera) - &predicted(&seed(10, Layout::Hexagonal));
        assert!(difference.iter().any(|difference| *difference > 0.05));
    }
}
