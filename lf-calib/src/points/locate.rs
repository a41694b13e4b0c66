//! The point that a set of sub-images comes from.

use super::{sub_images::SubImage, view::PointView};
use crate::fit::robust::{deviation, tukey_weight};
use glam::{DVec2, DVec3};
use lf_core::Optics;
use nalgebra::{Matrix3, Vector3};

pub(crate) const FEWEST: usize = 5;
/// A point is located if its sub-images span at least this many lenslets. With fewer, not even five are lit as a whole.
pub(crate) const NARROWEST: f64 = 5.0;
/// Step of the numerical derivatives, mm.
const STEP_MM: f64 = 1e-3;

pub(crate) fn width_in_lenslets(optics: &Optics, place_mm: DVec3) -> f64 {
    2.0 * optics.half_aperture_mm * PointView::new(optics, place_mm).alpha.abs() / optics.lattice().row_pitch_mm()
}

/// The depths nearest to focus, away from and towards the camera, at which a point lights `lenslets`, mm; by the
/// camera's own rays.
pub(crate) fn nearest_depths_mm(optics: &Optics, lenslets: f64) -> [f64; 2] {
    [-1.0, 1.0].map(|side| {
        let is_wide = |depth: f64| width_in_lenslets(optics, DVec3::new(0.0, 0.0, side * depth)) >= lenslets;
        // The least power of two at which the light is wide enough, then bisection.
        let Some(wide) = (-10..14).map(|power| 2f64.powi(power)).find(|depth| is_wide(*depth)) else {
            return side * f64::INFINITY;
        };
        let (mut low, mut high) = (0.0, wide);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if is_wide(middle) { high = middle } else { low = middle }
        }
        side * high
    })
}

/// Locates the point that sub-images come from: robust least squares with the camera's own rays. Returns the scatter of
/// the sub-images about it too, px. None if there are too few or the point moves into focus.
pub(crate) fn locate(optics: &Optics, sub_images: &[SubImage], from_mm: DVec3) -> Option<(DVec3, f64)> {
    if sub_images.len() < FEWEST {
        return None;
    }
    let mut place = from_mm;
    let mut scatter = 0.0;
    for _ in 0..6 {
        if width_in_lenslets(optics, place) < 0.7 * NARROWEST {
            return None;
        }
        let predicted = |place: DVec3| {
            let view = PointView::new(optics, place);
            sub_images.iter().map(|sub_image| view.place_px(sub_image.lenslet)).collect::<Vec<_>>()
        };
        let here = predicted(place);
        let moved = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| predicted(place + STEP_MM * axis));
        let off: Vec<DVec2> =
            sub_images.iter().zip(&here).map(|(sub_image, here)| sub_image.place_px - *here).collect();
        scatter = deviation(off.iter().map(|off| off.length()).collect());
        let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (n, off) in off.iter().enumerate() {
            let weight = tukey_weight(off.length() / scatter.max(0.02));
            for axis in 0..2 {
                let slope = |p: usize| (moved[p][n][axis] - here[n][axis]) / STEP_MM;
                let line = Vector3::new(slope(0), slope(1), slope(2));
                matrix.ger(weight, &line, &line, 1.0);
                right += weight * off[axis] * line;
            }
        }
        let step = matrix.cholesky()?.solve(&right);
        place += DVec3::new(step[0], step[1], step[2]);
        if !place.is_finite() || place.distance(from_mm) > 2.0 * (1.0 + from_mm.z.abs()) {
            return None;
        }
        if step.norm() < 1e-6 {
            break;
        }
    }
    Some((place, scatter))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::sub_images::SHARE;
    use crate::points::view::tests::seed;
    use lf_core::camera::Layout;

    #[test]
    fn a_point_is_located_despite_outliers() {
        let camera = seed(60, Layout::Square);
        let optics = Optics::new(&camera);
        for place in [DVec3::new(0.6, -0.9, 3.1), DVec3::new(-0.3, 0.2, -2.0)] {
            let lenslets = PointView::new(&optics, place).lit_lenslets(SHARE, 0.02);
            let spots: Vec<SubImage> = lenslets
                .iter()
                .enumerate()
                .map(|(n, seen)| SubImage {
                    lenslet: seen.lenslet,
                    place_px: seen.place_px + if n % 9 == 4 { DVec2::new(2.0, 1.0) } else { DVec2::ZERO },
                    uncertainty_px: 0.01,
                    sampling_px: 0.0,
                })
                .collect();
            let from = place + DVec3::new(0.05, -0.03, 0.2);
            let (found, _) = locate(&optics, &spots, from).unwrap();
            assert!(found.distance(place) < 1e-4, "{found} {place}");
        }
        assert!(locate(&optics, &[], DVec3::Z).is_none());
    }
}
