//! The normalised correlation of a window at every trial shift.

use crate::overlap::midpoints;
use crate::shifts::{Shifts, Sums, channel};
use std::ops::Range;

/// The locally normalised, zero-mean correlation of a window at every shift; `room` tells how many voxels each shift pairs.
///
/// Equation: `(S_ab - S_a S_b / n) / sqrt((S_aa - S_a^2 / n) (S_bb - S_b^2 / n))`, at most 1, and 1 only where the two
/// windows are equal up to gain and offset. The sums of each volume run over the n voxels that the shift pairs: those whose
/// midpoint is in the window and that are both inside the volume; or n counts the whole window, outside being dark. Normalising with the energy of one fixed window instead
/// lets a particle that the window's edge cuts push the peak: 0.1 voxel of bias and 0.26 RMS on particles as long as an
/// eighth of the window. Where a window holds no light, or even light, the score is 0.
///
/// Several pairs are taken about their own means, and numerators and energies summed.
pub(crate) fn normalised(pairs: &[Sums], room: &Room) -> Vec<f64> {
    let shifts = pairs[0].shifts;
    let [nx, ny, _] = shifts.n;
    let one = |k: usize| {
        let n = room.voxels([k % nx, k / nx % ny, k / nx / ny]);
        let (mut common, mut energies) = (0.0, [0.0; 2]);
        for sums in pairs {
            let at = |channel: usize| sums.channel(channel)[k];
            let [first, second] = [at(channel::FIRST), at(channel::SECOND)];
            common += at(channel::PRODUCT) - first * second / n;
            energies[0] += energy(first, at(channel::FIRST_SQUARED), n);
            energies[1] += energy(second, at(channel::SECOND_SQUARED), n);
        }
        let energies = energies[0] * energies[1];
        if energies > 0.0 { common / energies.sqrt() } else { 0.0 }
    };
    (0..shifts.len()).map(one).collect()
}

/// How many voxels of a window each shift pairs.
pub(crate) struct Room {
    /// For each axis and each shift along it.
    along: [Vec<f64>; 3],
}

impl Room {
    /// The room of `window` in volumes of `shape` at the shifts of a box.
    pub fn new(window: &[Range<usize>; 3], shape: [usize; 3], shifts: &Shifts) -> Self {
        let along = |axis: usize| {
            let room = |d: i32| midpoints(&window[axis], shape[axis], d).len() as f64;
            shifts.along(axis).map(room).collect()
        };
        Self::of(std::array::from_fn(along))
    }

    /// A room of so many voxels at each shift along each axis.
    pub fn of(along: [Vec<f64>; 3]) -> Self {
        Self { along }
    }

    fn voxels(&self, k: [usize; 3]) -> f64 {
        self.along[0][k[0]] * self.along[1][k[1]] * self.along[2][k[2]]
    }
}

/// The sum of squares about the mean; 0 where rounding is all there is.
#[inline]
fn energy(sum: f64, squares: f64, n: f64) -> f64 {
    let energy = squares - sum * sum / n;
    if energy > 1e-9 * squares { energy } else { 0.0 }
}
