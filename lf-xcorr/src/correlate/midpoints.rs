//! The midpoints of a cell that have both their voxels inside the volume.

use super::shifts::{Shifts, back, on};
use std::ops::Range;

/// Midpoints of `cell`, along an axis of `length` voxels, that have both their voxels at shift `d` inside the volume.
#[inline]
pub(crate) fn midpoints(cell: &Range<usize>, length: usize, d: i32) -> Range<i32> {
    let (back, on, length) = (back(d), on(d), length as i32);
    let from = (cell.start as i32).max(back).max(-on);
    let to = (cell.end as i32).min(length + back).min(length - on);
    from..to.max(from)
}

/// The voxels of one volume that the midpoints of a cell stand for, for each axis and each shift along it. `offset` of
/// a shift is the step from the midpoint to the voxel: `-d1` in the first volume, `d2` in the second.
pub(crate) fn paired_voxels(
    cell: &[Range<usize>; 3],
    shape: [usize; 3],
    shifts: &Shifts,
    offset: impl Fn(i32) -> i32,
) -> [Vec<Range<i32>>; 3] {
    std::array::from_fn(|axis| {
        let voxels = |d: i32| {
            let x = midpoints(&cell[axis], shape[axis], d);
            x.start + offset(d)..x.end + offset(d)
        };
        shifts.along(axis).map(voxels).collect()
    })
}

/// The smallest range that holds every range that is not empty.
pub(crate) fn hull(ranges: &[Range<i32>]) -> Range<i32> {
    let filled = ranges.iter().filter(|range| !range.is_empty()).cloned();
    filled.reduce(|hull, one| hull.start.min(one.start)..hull.end.max(one.end)).unwrap_or(0..0)
}
