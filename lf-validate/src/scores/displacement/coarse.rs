//! The error of interpolation between the vectors of a true field.

use glam::DVec3;
use lf_core::Field;
use lf_core::field::NO_DATA;

/// Its RMS at the vectors of `field` that the truth covers, for u, v and w, mm. A chord misses a curve by half the
/// second derivative, times the distances to both ends. NaN without such vectors.
pub(super) fn interpolation_mm(truth: &Field, field: &Field) -> [f64; 3] {
    let with_data = (0..field.len()).filter(|at| field.flag[*at] != NO_DATA).map(|at| field.place_mm(at).into());
    let covered: Vec<DVec3> = with_data.filter(|place| truth.interpolate(*place).is_some()).collect();
    let squares: DVec3 = covered.iter().map(|place| miss_mm(truth, *place).powf(2.0)).sum();
    (squares / covered.len() as f64).map(f64::sqrt).to_array()
}

/// By how much interpolation misses the truth at a place.
fn miss_mm(truth: &Field, place_mm: DVec3) -> DVec3 {
    let cell = truth.layout.cell(place_mm);
    let bend = |axis: usize| -> DVec3 {
        cell.corners().into_iter().map(|(at, weight)| weight * second_difference_mm(truth, at, axis)).sum()
    };
    let ends = cell.fraction.map(|fraction| 0.5 * fraction * (1.0 - fraction));
    (0..3).map(|axis| ends[axis] * bend(axis)).sum()
}

/// The second difference along an axis at a vector; at an end, that of its neighbour. 0 beside gaps, and along an axis
/// of two vectors.
fn second_difference_mm(truth: &Field, at: usize, axis: usize) -> DVec3 {
    let layout = &truth.layout;
    let inner = |at: &usize| [-1, 1].iter().all(|step| layout.neighbour(*at, axis, *step).is_some());
    let steps = [0, 1, -1].into_iter();
    let Some(middle) = steps.filter_map(|step| layout.neighbour(at, axis, step)).find(inner) else {
        return DVec3::ZERO;
    };
    let three = [-1, 0, 1].map(|step| layout.neighbour(middle, axis, step).unwrap_or(middle));
    if three.iter().any(|at| truth.flag[*at] == NO_DATA) {
        return DVec3::ZERO;
    }
    let [low, middle, high] = three.map(|at| truth.displacement_mm(at));
    low - 2.0 * middle + high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::{field, trilinear};

    /// A parabola along x, whose chords miss it by 3 t (1 - t) spacings squared: the estimate is what is missed.
    #[test]
    fn a_parabola_is_missed_by_its_bend_and_a_plane_by_nothing() {
        let bent = |[x, y, _]: [f64; 3]| [3.0 * x * x, 2.0 * y, 0.0];
        let truth = field([5, 4, 3], bent);
        let mut measured = field([3, 3, 2], |_| [0.0; 3]);
        measured.layout.origin_mm = truth.layout.origin_mm;
        measured.layout.spacing_mm = truth.layout.spacing_mm;
        measured.layout.origin_mm[0] += 0.25 * truth.layout.spacing_mm[0];
        let [place, spacing] = [measured.place_mm(1), truth.layout.spacing_mm];
        let missed = truth.interpolate(place.into()).unwrap().displacement_mm.x - bent(place)[0];
        let found = interpolation_mm(&truth, &measured);
        assert!((missed - 3.0 * 0.25 * 0.75 * spacing[0] * spacing[0]).abs() < 1e-6, "{missed}");
        assert!((found[0] / missed - 1.0).abs() < 1e-3 && found[1..].iter().all(|rms| *rms < 1e-6), "{found:?}");
        let even = interpolation_mm(&field([5, 4, 3], trilinear), &measured);
        assert!(even.iter().all(|rms| *rms < 1e-6), "{even:?}");
    }
}
