//! Light by the place in the stop through which it comes.
//!
//! A lenslet draws an image of the stop. A particle sends as much light through one part of the stop as through
//! another, so over all lenslets all parts of an open stop are equally bright: a part that stays dark is closed.

use super::tones::{DARKEST, Tones};
use crate::{Camera, Optics};
use glam::DVec2;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// About this many lenslets are examined, spread evenly over the array.
const LENSLETS: usize = 1 << 15;

/// Light that comes through places of the stop.
pub struct StopLight {
    /// Mean light through each place, counts: the pixels there under all lenslets of which the sensor sees the place.
    /// No pixel counts more than the mean brightness of the light, so that a few bright particles do not decide. Blind
    /// pixels, which are NaN, do not count. NaN for a place that no lenslet shows.
    pub means: Vec<f64>,
    /// Effective number of lit pixels that a mean is made of, over all places: its relative deviation is one over the
    /// root of it.
    pub samples: f64,
}

impl StopLight {
    /// The light of an image of the camera's size through each of these places.
    pub fn new(image: ArrayView2<f32>, camera: &Camera, tones: &Tones, stop_mm: &[DVec2]) -> Self {
        let sums = sums_through(image, camera, tones, stop_mm);
        let [sum, squares] = [1, 2].map(|n| sums.iter().map(|sums| sums[n]).sum::<f64>());
        let samples = if squares > 0.0 { sum * sum / squares / sums.len() as f64 } else { 0.0 };
        Self { means: sums.iter().map(|[count, sum, _]| sum / count).collect(), samples }
    }
}

/// Number of pixels that show each place, their light, and its squares.
fn sums_through(image: ArrayView2<f32>, camera: &Camera, tones: &Tones, stop_mm: &[DVec2]) -> Vec<[f64; 3]> {
    let optics = Optics::new(camera);
    let half_sensor = 0.5 * optics.pixel_pitch_mm * DVec2::from(optics.sensor_px.map(|side| side as f64));
    let reach = half_sensor + DVec2::splat(camera.microlenses.pitch_mm);
    let mut centres: Vec<DVec2> =
        optics.lattice().lenslets_within(DVec2::ZERO, reach).map(|(_, _, centre)| centre).collect();
    let step = centres.len() / LENSLETS + 1;
    centres = centres.into_iter().step_by(step).collect();
    let (least, most) = ((DARKEST * tones.light) as f32, tones.light as f32);
    let sums = |place: &DVec2| {
        let mut sums = [0.0; 3];
        for centre in &centres {
            let Some((column, row)) = optics.pixel_at(optics.sensor_through(*centre, *centre, *place)) else {
                continue;
            };
            let value = image[[row, column]];
            if !value.is_nan() {
                let light = if value >= least { f64::from(value.min(most)) } else { 0.0 };
                sums = [sums[0] + 1.0, sums[1] + light, sums[2] + light * light];
            }
        }
        sums
    };
    stop_mm.par_iter().map(sums).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Aperture, tests::seed};
    use crate::lattice::Layout;
    use ndarray::Array2;

    /// By hand: light under the lower half of every lenslet's image, which shows the half of the stop at negative V.
    /// One pixel a hundred thousand times as bright changes nothing.
    #[test]
    fn a_covered_half_of_the_stop_is_dark() {
        for (layout, turn) in [(Layout::Square, 0.0), (Layout::Square, 0.01), (Layout::Hexagonal, 0.003)] {
            let camera = seed(20, Aperture::Circle, layout, turn);
            let optics = Optics::new(&camera);
            let k = camera.image_growth();
            let mut image = Array2::from_shape_fn((280, 280), |(row, column)| {
                let place = optics.centre_mm(column as u32, row as u32);
                let centre = optics.lattice().nearest_centre_mm(place / (1.0 + k));
                if place.y > centre.y * (1.0 + k) { 50.0 } else { 0.0 }
            });
            image[[140, 140]] = 5e6;
            image[[3, 3]] = f32::NAN;
            let light = 50.0;
            let tones = Tones { light, bright: 5e6, middle: 0.0, dark: 0.0, darkest: 0.0, peak: 5e6 };
            let places = [(0.0, -30.0), (30.0, -15.0), (0.0, 30.0), (30.0, 15.0)].map(DVec2::from);
            let StopLight { means: found, samples } = StopLight::new(image.view(), &camera, &tones, &places);
            assert!((100.0..=400.0).contains(&samples), "{samples}");
            assert!(found[..2].iter().all(|found| (found - light).abs() < 0.01 * light), "{layout:?}: {found:?}");
            assert!(found[2..].iter().all(|found| *found < 0.01 * light), "{layout:?}: {found:?}");
        }
    }
}
