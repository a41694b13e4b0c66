//! The vorticity of a field.

use lf_core::{Field, field::NO_DATA};

/// Curl of the displacement, divided by the time between the volumes if it is known.
pub(super) fn vorticity(field: &Field) -> [Vec<f32>; 3] {
    let time = field.layout.dt_s.unwrap_or(1.0);
    let components = [&field.u, &field.v, &field.w];
    std::array::from_fn(|axis| {
        let [one, other] = [(axis + 1) % 3, (axis + 2) % 3];
        let curl = |i: usize| slope(field, components[other], one, i) - slope(field, components[one], other, i);
        (0..field.len()).map(|i| (curl(i) / time) as f32).collect()
    })
}

/// Derivative of a component along an axis at a place with data: from its two neighbours, or from one neighbour and
/// itself. NaN without data or without a neighbour.
fn slope(field: &Field, values: &[f32], axis: usize, i: usize) -> f64 {
    let has_data = |n: &usize| field.flag[*n] != NO_DATA;
    if !has_data(&i) {
        return f64::NAN;
    }
    let [before, after] = [-1, 1].map(|step| field.layout.neighbour(i, axis, step).filter(has_data));
    let steps = [before, after].into_iter().flatten().count() as f64;
    let (low, high) = (before.unwrap_or(i), after.unwrap_or(i));
    // Without a neighbour this is 0 / 0.
    (f64::from(values[high]) - f64::from(values[low])) / (steps * field.layout.spacing_mm[axis])
}
