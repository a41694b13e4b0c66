//! Which midpoints of a cell have both their voxels inside the volume.

use crate::shifts::{Shifts, back, on};
use std::ops::Range;

/// Midpoints of `cell` along one axis of `length` voxels whose two voxels at shift `d` lie inside the volume.
#[inline]
pub(crate) fn midpoints(cell: &Range<usize>, length: usize, d: i32) -> Range<i32> {
    let (back, on, length) = (back(d), on(d), length as i32);
    let from = (cell.start as i32).max(back).max(-on);
    let to = (cell.end as i32).min(length + back).min(length - on);
    from..to.max(from)
}

/// One volume of the two.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Which {
    /// The first: voxel `x - d1`.
    First,
    /// The second: voxel `x + d2`.
    Second,
}

/// For each axis and each shift along it, the voxels of one volume that a cell's midpoints stand for.
pub(crate) fn voxels(
    which: Which,
    cell: &[Range<usize>; 3],
    shape: [usize; 3],
    shifts: &Shifts,
) -> [Vec<Range<i32>>; 3] {
    std::array::from_fn(|axis| {
        let one = |d: i32| {
            let x = midpoints(&cell[axis], shape[axis], d);
            match which {
                Which::First => x.start - back(d)..x.end - back(d),
                Which::Second => x.start + on(d)..x.end + on(d),
            }
        };
        shifts.along(axis).map(one).collect()
    })
}

/// The smallest range that holds every range that is not empty.
pub(crate) fn hull(ranges: &[Range<i32>]) -> Range<i32> {
    let lit = ranges.iter().filter(|range| !range.is_empty()).cloned();
    lit.reduce(|hull, one| hull.start.min(one.start)..hull.end.max(one.end)).unwrap_or(0..0)
}
