//! A field between its vectors.

use lf_core::field::{Field, MEASURED, NO_DATA};

/// How far beyond its outermost vectors a field still holds, in its spacings: the rounding of two tools' arithmetic.
const RIM: f64 = 1e-6;

/// A field at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// Displacement, mm.
    pub vector_mm: [f64; 3],
    /// Stated standard uncertainty, mm, weighted as the displacement is: that of neighbours whose errors are one. NaN where
    /// a neighbour with weight states none.
    pub stated_mm: [f64; 3],
    /// Whether every neighbour with weight is flagged measured.
    pub is_measured: bool,
}

/// A field at a place (mm), trilinear between its eight neighbours; none outside the hull of the field's vectors, or where
/// a neighbour with weight has no data.
pub fn between(field: &Field, place_mm: [f64; 3]) -> Option<Between> {
    let layout = &field.layout;
    let [nx, ny, _] = layout.shape;
    let mut below = [0; 3];
    let mut share = [0.0; 3];
    for axis in 0..3 {
        let last = layout.shape[axis].checked_sub(1)? as f64;
        let place = (place_mm[axis] - layout.origin_mm[axis]) / layout.spacing_mm[axis];
        if !(place >= -RIM && place <= last + RIM) {
            return None;
        }
        let place = place.clamp(0.0, last);
        below[axis] = place.floor() as usize;
        share[axis] = place - place.floor();
    }
    let mut found = Between { vector_mm: [0.0; 3], stated_mm: [0.0; 3], is_measured: true };
    for corner in 0..8 {
        let upper = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight: f64 = (0..3).map(|axis| if upper[axis] == 1 { share[axis] } else { 1.0 - share[axis] }).product();
        if weight == 0.0 {
            continue;
        }
        let [i, j, k] = [0, 1, 2].map(|axis| below[axis] + upper[axis]);
        let at = i + nx * (j + ny * k);
        if field.flag[at] == NO_DATA {
            return None;
        }
        found.is_measured &= field.flag[at] == MEASURED;
        for (axis, component) in [field.u[at], field.v[at], field.w[at]].into_iter().enumerate() {
            found.vector_mm[axis] += weight * f64::from(component);
        }
        for (axis, component) in [field.su[at], field.sv[at], field.sw[at]].into_iter().enumerate() {
            found.stated_mm[axis] += weight * f64::from(component);
        }
    }
    Some(found)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use lf_core::field::{Layout, REPLACED};

    /// A field of `shape` vectors with what `vector` gives at each place (mm).
    pub(crate) fn field(shape: [usize; 3], vector: impl Fn([f64; 3]) -> [f64; 3]) -> Field {
        let layout = Layout {
            shape,
            spacing_mm: [0.5, 0.25, 2.0],
            origin_mm: [-1.0, 0.5, -3.0],
            voxel_mm: [0.01, 0.02, 0.1],
            window: [0; 3],
            overlap: 0.0,
            dt_s: None,
            history: Vec::new(),
        };
        let mut field = Field::empty(layout);
        field.flag.fill(MEASURED);
        for at in 0..field.len() {
            [field.u[at], field.v[at], field.w[at]] = vector(field.place_mm(at)).map(|component| component as f32);
        }
        field
    }

    fn interpolate(field: &Field, place_mm: [f64; 3]) -> Option<[f64; 3]> {
        between(field, place_mm).map(|found| found.vector_mm)
    }

    /// Trilinear in the place: reproduced exactly by trilinear interpolation.
    pub(crate) fn trilinear([x, y, z]: [f64; 3]) -> [f64; 3] {
        [0.1 + 0.2 * x - 0.3 * y + 0.05 * z, x * y - 0.1 * z, x * y * z]
    }

    #[test]
    fn trilinear_flow_is_reproduced() {
        let truth = field([4, 5, 3], trilinear);
        for n in 0..200 {
            let fraction = |step: f64| (f64::from(n) * step).fract();
            let place = [-1.0 + 1.5 * fraction(0.618), 0.5 + fraction(0.414), -3.0 + 4.0 * fraction(0.732)];
            let (found, wanted) = (interpolate(&truth, place).unwrap(), trilinear(place));
            for axis in 0..3 {
                assert!((found[axis] - wanted[axis]).abs() < 1e-6, "{place:?}: {found:?} against {wanted:?}");
            }
        }
    }

    #[test]
    fn the_hull_ends_at_the_outermost_vectors() {
        let truth = field([4, 5, 3], |_| [1.0, 2.0, 3.0]);
        assert_eq!(interpolate(&truth, [-1.0, 0.5, -3.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(interpolate(&truth, [0.5, 1.5, 1.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(interpolate(&truth, [0.5 + 1e-9, 1.5, 1.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(interpolate(&truth, [0.51, 1.5, 1.0]), None);
        assert_eq!(interpolate(&truth, [f64::NAN, 1.5, 1.0]), None);
    }

    #[test]
    fn one_layer_of_vectors_holds_in_its_plane_only() {
        let truth = field([4, 5, 1], |_| [1.0, 2.0, 3.0]);
        assert!(interpolate(&truth, [0.1, 1.0, -3.0]).is_some());
        assert!(interpolate(&truth, [0.1, 1.0, -2.9]).is_none());
    }

    #[test]
    fn a_gap_spoils_its_neighbours_and_nothing_else() {
        let mut truth = field([4, 5, 3], |_| [1.0, 2.0, 3.0]);
        truth.flag[0] = NO_DATA;
        assert!(interpolate(&truth, [-0.9, 0.6, -2.9]).is_none());
        assert!(interpolate(&truth, [-0.5, 0.6, -2.9]).is_some());
    }

    #[test]
    fn what_is_stated_and_flagged_goes_with_the_weights() {
        let mut stated = field([4, 5, 3], |_| [0.0; 3]);
        stated.su.iter_mut().enumerate().for_each(|(at, su)| *su = at as f32);
        stated.sw.fill(0.5);
        stated.sw[1] = f32::NAN;
        stated.flag[2] = REPLACED;
        // A quarter of the way from the first vector to the second, then from the third to the fourth.
        let first = between(&stated, [-0.875, 0.5, -3.0]).unwrap();
        assert!(
            (first.stated_mm[0] - 0.25).abs() < 1e-12 && first.stated_mm[1].is_nan() && first.stated_mm[2].is_nan()
        );
        assert!(first.is_measured);
        let third = between(&stated, [0.125, 0.5, -3.0]).unwrap();
        assert!((third.stated_mm[0] - 2.25).abs() < 1e-12 && third.stated_mm[2] == 0.5 && !third.is_measured);
        assert!(between(&stated, [0.5, 0.5, -3.0]).unwrap().is_measured);
    }
}
