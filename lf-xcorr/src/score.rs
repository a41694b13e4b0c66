//! The normalised correlation of a window at every trial shift.

use crate::shifts::{Sums, channel};

/// The locally normalised, zero-mean correlation of a window of `n` voxels.
///
/// Equation: `(S_ab - S_a S_b / n) / sqrt((S_aa - S_a^2 / n) (S_bb - S_b^2 / n))`, at most 1, and 1 only where the two
/// windows are equal up to gain and offset. The sums of each volume run over the voxels that the shift pairs; a midpoint
/// that has one voxel outside the volume counts as dark in both. Normalising with the energy of one fixed window instead
/// lets a particle that the window's edge cuts push the peak: 0.1 voxel of bias and 0.26 RMS on particles as long as an
/// eighth of the window. Where a window holds no light, or even light, the score is 0.
pub(crate) fn normalised(sums: &Sums, n: f64) -> Vec<f64> {
    let product = sums.channel(channel::PRODUCT);
    let (first, first_squared) = (sums.channel(channel::FIRST), sums.channel(channel::FIRST_SQUARED));
    let (second, second_squared) = (sums.channel(channel::SECOND), sums.channel(channel::SECOND_SQUARED));
    let one = |k: usize| {
        let energies = energy(first[k], first_squared[k], n) * energy(second[k], second_squared[k], n);
        if energies > 0.0 { (product[k] - first[k] * second[k] / n) / energies.sqrt() } else { 0.0 }
    };
    (0..sums.shifts.len()).map(one).collect()
}

/// The sum of squares about the mean; 0 where rounding is all there is.
#[inline]
fn energy(sum: f64, squares: f64, n: f64) -> f64 {
    let energy = squares - sum * sum / n;
    if energy > 1e-9 * squares { energy } else { 0.0 }
}
