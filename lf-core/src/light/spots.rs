//! How many particles a frame shows at least.

use super::tones::Tones;
use crate::{Camera, Optics};
use glam::DVec2;
use ndarray::ArrayView2;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_4;

/// A spot of light has at least this share of the light's brightness.
const SPOT: f64 = 0.3;

/// A spot is the brightest pixel of a square that reaches this far to each side, px.
const REACH: usize = 2;

/// Minimum number of particles that explains the spots of light in a frame, if all lie between these depths. A particle
/// draws at most one spot under a lenslet, and reaches the most lenslets at one of the two ends. Particles nearer to
/// the focus draw fewer spots, so there are about three times as many of them in a volume that is filled evenly.
pub fn fewest_particles(image: ArrayView2<f32>, camera: &Camera, tones: &Tones, ends_mm: [f64; 2]) -> f64 {
    let optics = Optics::new(camera);
    let half_mm = DVec2::new(0.5 * camera.aperture_mm(), 0.0);
    let width = |z_mm: f64| {
        let [one, other] = [half_mm, -half_mm].map(|stop_mm| optics.array_from_object(DVec2::ZERO, z_mm, stop_mm));
        one.distance(other) / camera.microlenses.pitch_mm
    };
    let lenslets = FRAC_PI_4 * width(ends_mm[0]).max(width(ends_mm[1])).powi(2);
    spots(image, (SPOT * tones.light) as f32) as f64 / lenslets.max(1.0)
}

/// Pixels of at least `least` counts that no pixel around exceeds. Of equal ones, the last counts.
fn spots(image: ArrayView2<f32>, least: f32) -> usize {
    let (height, width) = image.dim();
    let around = |place: usize, side: usize| place.saturating_sub(REACH)..(place + REACH + 1).min(side);
    let is_spot = |row: usize, column: usize| {
        let value = image[[row, column]];
        let yields = |place: (usize, usize)| {
            let other = image[place];
            other > value || other == value && place > (row, column)
        };
        let mut places = around(row, height).flat_map(|row| around(column, width).map(move |column| (row, column)));
        value > 0.0 && value >= least && !places.any(yields)
    };
    (0..height).into_par_iter().map(|row| (0..width).filter(|column| is_spot(row, *column)).count()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Aperture, tests::seed};
    use crate::lattice::Layout;
    use ndarray::Array2;

    /// By hand: a spot of one pixel, a plateau, two spots three pixels apart, a faint one, a blind pixel.
    #[test]
    fn spots_by_hand() {
        let mut image = Array2::zeros((12, 12));
        for (place, value) in
            [([0, 0], 9.0), ([5, 5], 8.0), ([5, 6], 8.0), ([6, 6], 8.0), ([10, 2], 5.0), ([10, 5], 6.0), ([0, 9], 0.5)]
        {
            image[place] = value;
        }
        image[[1, 1]] = f32::NAN;
        assert_eq!(spots(image.view(), 1.0), 4);
    }

    /// Spots under all lenslets of one particle's disc are one particle; the same spots near the focus are many.
    #[test]
    fn one_disc_is_one_particle() {
        let camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        let image = Array2::from_shape_fn((280, 280), |(row, column)| {
            let far = DVec2::new(row as f64 - 140.0, column as f64 - 140.0).length();
            if row % 14 == 7 && column % 14 == 7 && far < 70.0 { 50.0 } else { 0.0 }
        });
        let tones = Tones::new(image.view());
        let fewest = |z_mm: f64| fewest_particles(image.view(), &camera, &tones, [-z_mm, 0.5 * z_mm]);
        let wide = (1..100).map(|n| 0.1 * f64::from(n)).find(|z_mm| fewest(*z_mm) < 1.3).expect("a depth");
        assert!(fewest(0.1 * wide) > 20.0 && fewest(2.0 * wide) < 0.5, "{wide}");
    }
}
