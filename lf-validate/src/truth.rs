//! The true displacement at any place.

use lf_core::field::{Field, NO_DATA};

/// How far beyond its outermost vectors a truth still holds, in its spacings: the rounding of two tools' arithmetic.
const RIM: f64 = 1e-6;

/// Displacement (mm) of a truth field at a place (mm), trilinear between its eight neighbours; none outside the hull of
/// the field's vectors, or where a neighbour with weight has no data.
pub fn interpolate(truth: &Field, place_mm: [f64; 3]) -> Option<[f64; 3]> {
    let layout = &truth.layout;
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
    let mut sum = [0.0; 3];
    for corner in 0..8 {
        let upper = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight: f64 = (0..3).map(|axis| if upper[axis] == 1 { share[axis] } else { 1.0 - share[axis] }).product();
        if weight == 0.0 {
            continue;
        }
        let [i, j, k] = [0, 1, 2].map(|axis| below[axis] + upper[axis]);
        let at = i + nx * (j + ny * k);
        if truth.flag[at] == NO_DATA {
            return None;
        }
        for (sum, component) in sum.iter_mut().zip([truth.u[at], truth.v[at], truth.w[at]]) {
            *sum += weight * f64::from(component);
        }
    }
    Some(sum)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use lf_core::field::{Layout, MEASURED};

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
}
