//! The correlation peak of every window of a pass.

use super::peak::{self, Peak};
use super::transform::{TransformScratch, Transforms};
use super::{score::PairedVoxels, shared_sums, shifts::Shifts, sums::Sums, window_grid::WindowGrid};
use crate::volumes::Rows;
use rayon::prelude::*;

/// A function that is called with the number of windows done since the last call.
pub(crate) type Watch<'a> = &'a (dyn Fn(u64) + Sync);

/// How the products of a window are summed.
pub(crate) enum Summation {
    /// Lit voxel by lit voxel, in cells that windows share.
    Direct,
    /// Window by window, by transforms. All boxes of shifts are of the prepared size.
    Transform(Transforms),
}

/// Finds the peak of every node that has a box of shifts to search, in the score summed over all `pairs`.
///
/// In a dark volume the outside counts as dark, so that a shift by whole voxels stays exact. In a volume that `is_full`
/// of light this would be an edge that both windows share, so there the outside does not count.
pub(crate) fn measure(
    pairs: &[[&Rows; 2]],
    windows: &WindowGrid,
    search: &[Option<Shifts>],
    summation: &Summation,
    is_full: bool,
    watch: Watch,
) -> Vec<Option<Peak>> {
    let shape = pairs[0][0].shape;
    let found = |sums: &[Sums], paired: PairedVoxels| {
        let peak = peak::find(sums, &paired);
        watch(1);
        peak
    };
    let whole = |shifts: &Shifts| PairedVoxels::new(shifts, |axis, _| windows.axes[axis].window as f64);
    match summation {
        Summation::Direct => shared_sums::of_windows(pairs, windows, search, |node, sums| {
            let shifts = &sums[0].shifts;
            let inside = || PairedVoxels::inside(&windows.voxels(node), shape, shifts);
            found(sums, if is_full { inside() } else { whole(shifts) })
        }),
        Summation::Transform(transforms) => {
            let peak_of = |scratch: &mut TransformScratch, node: usize| {
                let (shifts, voxels) = (search[node]?, windows.voxels(node));
                let sums_of = |pair: &[&Rows; 2]| transforms.sums(*pair, &voxels, shifts, scratch);
                let sums: Vec<Sums> = pairs.iter().map(sums_of).collect();
                let inside = || transforms.paired_voxels(&voxels, shape, &shifts);
                Some(found(&sums, if is_full { inside() } else { whole(&shifts) }))
            };
            (0..windows.count()).into_par_iter().map_init(Default::default, peak_of).collect()
        }
    }
}
