//! A vector field between its vectors.

use glam::{DVec3, USizeVec3};
use lf_core::Field;
use lf_core::field::{MEASURED, NO_DATA};

/// Tolerance at the outermost vectors, in distances between vectors: the rounding of two tools' arithmetic.
const RIM: f64 = 1e-6;

/// A field at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interpolated {
    pub vector_mm: DVec3,
    /// Stated standard uncertainty: the mean of the neighbours, weighted as the displacement is. This assumes that
    /// neighbours have the same error. NaN if a neighbour with weight states none.
    pub stated_mm: DVec3,
    /// Whether all neighbours with weight are flagged measured.
    pub is_measured: bool,
}

/// A field at a place (mm), trilinear between its eight neighbours. None outside the hull of the field's vectors, or if
/// a neighbour with weight has no data.
pub(super) fn interpolate(field: &Field, place_mm: DVec3) -> Option<Interpolated> {
    let layout = &field.layout;
    let last = DVec3::from(layout.shape.map(|count| count as f64 - 1.0));
    let place = (place_mm - DVec3::from(layout.origin_mm)) / DVec3::from(layout.spacing_mm);
    if !(place.cmpge(DVec3::splat(-RIM)) & place.cmple(last + RIM)).all() {
        return None;
    }
    let place = place.clamp(DVec3::ZERO, last);
    let below = place.floor();
    let share = place - below;
    let mut found = Interpolated { vector_mm: DVec3::ZERO, stated_mm: DVec3::ZERO, is_measured: true };
    for corner in 0..8 {
        let upper = USizeVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let weight = DVec3::select(upper.cmpeq(USizeVec3::ONE), share, 1.0 - share).element_product();
        if weight == 0.0 {
            continue;
        }
        let at = layout.index((below.as_usizevec3() + upper).to_array());
        if field.flag[at] == NO_DATA {
            return None;
        }
        found.is_measured &= field.flag[at] == MEASURED;
        found.vector_mm += weight * field.displacement_mm(at);
        found.stated_mm += weight * field.uncertainty_mm(at);
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::{field, trilinear};
    use lf_core::field::REPLACED;

    fn vector_mm(field: &Field, place_mm: [f64; 3]) -> Option<[f64; 3]> {
        interpolate(field, place_mm.into()).map(|found| found.vector_mm.to_array())
    }

    #[test]
    fn trilinear_flow_is_reproduced() {
        let truth = field([4, 5, 3], trilinear);
        for n in 0..200 {
            let fraction = |step: f64| (f64::from(n) * step).fract();
            let place = [-1.0 + 1.5 * fraction(0.618), 0.5 + fraction(0.414), -3.0 + 4.0 * fraction(0.732)];
            let (found, wanted) = (vector_mm(&truth, place).unwrap(), trilinear(place));
            for axis in 0..3 {
                assert!((found[axis] - wanted[axis]).abs() < 1e-6, "{place:?}: {found:?} against {wanted:?}");
            }
        }
    }

    #[test]
    fn the_hull_ends_at_the_outermost_vectors() {
        let truth = field([4, 5, 3], |_| [1.0, 2.0, 3.0]);
        assert_eq!(vector_mm(&truth, [-1.0, 0.5, -3.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(vector_mm(&truth, [0.5, 1.5, 1.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(vector_mm(&truth, [0.5 + 1e-9, 1.5, 1.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(vector_mm(&truth, [0.51, 1.5, 1.0]), None);
        assert_eq!(vector_mm(&truth, [f64::NAN, 1.5, 1.0]), None);
    }

    #[test]
    fn one_layer_of_vectors_is_known_in_its_plane_only() {
        let truth = field([4, 5, 1], |_| [1.0, 2.0, 3.0]);
        assert!(vector_mm(&truth, [0.1, 1.0, -3.0]).is_some());
        assert!(vector_mm(&truth, [0.1, 1.0, -2.9]).is_none());
    }

    #[test]
    fn a_gap_spoils_only_the_places_beside_it() {
        let mut truth = field([4, 5, 3], |_| [1.0, 2.0, 3.0]);
        truth.flag[0] = NO_DATA;
        assert!(vector_mm(&truth, [-0.9, 0.6, -2.9]).is_none());
        assert!(vector_mm(&truth, [-0.5, 0.6, -2.9]).is_some());
    }

    #[test]
    fn uncertainty_and_flag_follow_the_weights() {
        let mut stated = field([4, 5, 3], |_| [0.0; 3]);
        stated.su.iter_mut().enumerate().for_each(|(at, su)| *su = at as f32);
        stated.sw.fill(0.5);
        stated.sw[1] = f32::NAN;
        stated.flag[2] = REPLACED;
        // A quarter of the way from the first vector to the second, then from the third to the fourth.
        let first = interpolate(&stated, [-0.875, 0.5, -3.0].into()).unwrap();
        assert!(
            (first.stated_mm[0] - 0.25).abs() < 1e-12 && first.stated_mm[1].is_nan() && first.stated_mm[2].is_nan()
        );
        assert!(first.is_measured);
        let third = interpolate(&stated, [0.125, 0.5, -3.0].into()).unwrap();
        assert!((third.stated_mm[0] - 2.25).abs() < 1e-12 && third.stated_mm[2] == 0.5 && !third.is_measured);
        assert!(interpolate(&stated, [0.5, 0.5, -3.0].into()).unwrap().is_measured);
    }
}
