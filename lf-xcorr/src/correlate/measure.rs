//! The correlation peak of every window of a pass.

use super::peak::{self, Peak};
use super::{score::PairedVoxels, shared_sums, shifts::Shifts, window_grid::WindowGrid};
use crate::volumes::Rows;

/// A function that is called with the number of windows done since the last call.
pub(crate) type Watch<'a> = &'a (dyn Fn(u64) + Sync);

/// Finds the peak of every node that has a box of shifts to search, in the score summed over all `pairs`.
///
/// In a dark volume the outside counts as dark, so that a shift by whole voxels stays exact. In a volume that `is_full`
/// of light this would be an edge that both windows share, so there the outside does not count.
pub(crate) fn measure(
    pairs: &[[&Rows; 2]],
    windows: &WindowGrid,
    search: &[Option<Shifts>],
    is_full: bool,
    watch: Watch,
) -> Vec<Option<Peak>> {
    let shape = pairs[0][0].shape;
    let whole = |shifts: &Shifts| PairedVoxels::new(shifts, |axis, _| windows.axes[axis].window as f64);
    shared_sums::of_windows(pairs, windows, search, |node, sums| {
        let shifts = &sums[0].shifts;
        let inside = || PairedVoxels::inside(&windows.voxels(node), shape, shifts);
        let peak = peak::find(sums, &if is_full { inside() } else { whole(shifts) });
        watch(1);
        peak
    })
}
