//! The flat field: the counts of each pixel over the counts that it should have.
//!
//! It is the white image divided by a prediction for an evenly lit stop: the share of the pixel inside the image of the
//! stop under a lenslet, a disc of diameter `k D` about `c (1 + k)` or a square. Neighbours that overlap add up. The
//! quotient is scaled to a median of 1 over well-lit pixels. It is 1 where (almost) no light is predicted, so that no
//! noise is amplified, and 0 where light is predicted but none arrives.

use crate::fit::lenslet_images::{LensletImages, image_px};
use glam::DVec2;
use lf_core::{Camera, Optics, camera::Aperture, statistics::upper_median};
use ndarray::Array2;
use rayon::prelude::*;

/// A pixel with at least this share of the full light is well lit; below the second share the quotient would be noise.
const WELL_LIT: f32 = 0.9;
const LEAST_LIGHT: f32 = 0.1;
/// Chords per pixel for the share inside a disc. The error is some thousandths at the rim.
const CHORDS: usize = 16;
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
    let half = 0.5 * camera.demagnification() * camera.aperture_mm() / camera.sensor.pixel_pitch_mm;
    let reach_px = DVec2::new(0.5 * width as f64, 0.5 * BAND as f64) + half + 2.0;
    let mut light = Array2::zeros((height, width));
    let bands = light.as_slice_mut().expect("a new array is one slice").par_chunks_mut(BAND * width);
    bands.enumerate().for_each(|(band, pixels)| {
        let top = band * BAND;
        let middle_mm = images.lenslet_mm(DVec2::new(0.5 * width as f64, top as f64 + 0.5 * BAND as f64));
        for (_, _, centre) in lattice.lenslets_within(middle_mm, reach_px * images.lenslet_mm_per_px()) {
            let centre = image_px(&optics, centre);
            let range = |centre: f64, from: usize, to: usize| {
                let edge = |place: f64| place.clamp(from as f64, to as f64) as usize;
                edge((centre - half).floor())..edge((centre + half).ceil())
            };
            for row in range(centre.y, top, top + pixels.len() / width) {
                let line = &mut pixels[(row - top) * width..(row - top + 1) * width];
                for column in range(centre.x, 0, width) {
                    let corner = DVec2::new(column as f64, row as f64) - centre;
                    line[column] += match camera.main_lens.aperture {
                        Aperture::Circle => inside_disc(corner, half),
                        Aperture::Square => inside_square(corner, half),
                    } as f32;
                }
            }
        }
    });
    light
}

/// Share, inside a square of half side `half` about 0, of the unit square that begins at `corner`.
fn inside_square(corner: DVec2, half: f64) -> f64 {
    let overlap = (corner + 1.0).min(DVec2::splat(half)) - corner.max(DVec2::splat(-half));
    overlap.max(DVec2::ZERO).element_product()
}

/// Share, inside a circle about 0, of the unit square that begins at `corner`.
fn inside_disc(corner: DVec2, radius: f64) -> f64 {
    let (low, high) = (corner.abs().min((corner + 1.0).abs()), corner.abs().max((corner + 1.0).abs()));
    if high.length_squared() <= radius * radius {
        return 1.0;
    }
    // A square that lies across an axis is nearer to 0 than its corners are.
    let is_across = corner.cmple(DVec2::ZERO) & (corner + 1.0).cmpge(DVec2::ZERO);
    if DVec2::select(is_across, DVec2::ZERO, low).length_squared() >= radius * radius {
        return 0.0;
    }
    let chord = |n: usize| {
        let x = corner.x + (n as f64 + 0.5) / CHORDS as f64;
        let half = (radius * radius - x * x).max(0.0).sqrt();
        (half.min(corner.y + 1.0) - (-half).max(corner.y)).max(0.0)
    };
    (0..CHORDS).map(chord).sum::<f64>() / CHORDS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_to_the_area() {
        for (centre, half) in
            [(DVec2::new(10.3, 9.8), 7.0), (DVec2::new(9.5, 10.0), 3.21), (DVec2::new(10.0, 10.0), 0.4)]
        {
            let corners = || (0..400).map(|n| DVec2::new((n % 20) as f64, (n / 20) as f64) - centre);
            let disc: f64 = corners().map(|corner| inside_disc(corner, half)).sum();
            let square: f64 = corners().map(|corner| inside_square(corner, half)).sum();
            assert!((disc / (std::f64::consts::PI * half * half) - 1.0).abs() < 0.02, "{half}: {disc}");
            assert!((square / (4.0 * half * half) - 1.0).abs() < 1e-12, "{half}: {square}");
        }
    }
}
