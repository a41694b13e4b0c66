//! Boxes of trial shifts, and the voxels that shifts pair.
//!
//! Convention: a trial shift `d` is a whole number of voxels, split as `d1 = floor(d / 2)`, `d2 = d - d1`. Midpoint `x`
//! pairs voxel `x - d1` of the first volume with voxel `x + d2` of the second. So a window measures where the particles
//! are half way (second order in time), and exchanging the volumes turns `d` into `-d` with exactly these pairs.

use std::ops::Range;

/// `d1`, from the voxel of the first volume to the midpoint.
#[inline]
pub(crate) fn back(d: i32) -> i32 {
    d >> 1
}

/// `d2`, from the midpoint to the voxel of the second volume.
#[inline]
pub(crate) fn on(d: i32) -> i32 {
    d - (d >> 1)
}

/// A box of trial shifts; x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shifts {
    /// Lowest shift, and number of shifts, along each axis.
    pub low: [i32; 3],
    pub n: [usize; 3],
}

impl Shifts {
    pub fn around(centre: [i32; 3], radius: [usize; 3]) -> Self {
        Self { low: std::array::from_fn(|a| centre[a] - radius[a] as i32), n: radius.map(|r| 2 * r + 1) }
    }

    pub fn len(&self) -> usize {
        self.n.iter().product()
    }

    pub fn high(&self, axis: usize) -> i32 {
        self.low[axis] + self.n[axis] as i32 - 1
    }

    pub fn along(&self, axis: usize) -> Range<i32> {
        self.low[axis]..self.low[axis] + self.n[axis] as i32
    }

    /// The smallest box that holds every box of an iterator; `None` if there is no box.
    pub fn hull(boxes: impl Iterator<Item = Self>) -> Option<Self> {
        boxes.reduce(|hull, one| {
            let low = std::array::from_fn(|a| hull.low[a].min(one.low[a]));
            let n = std::array::from_fn(|a| (hull.high(a).max(one.high(a)) - low[a] + 1) as usize);
            Self { low, n }
        })
    }

    /// Index of the shift `low + k`.
    pub fn index(&self, k: [usize; 3]) -> usize {
        k[0] + self.n[0] * (k[1] + self.n[1] * k[2])
    }

    /// The `k` of an index: the shift is `low + k`.
    pub fn place(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.n;
        [index % nx, index / nx % ny, index / nx / ny]
    }
}

/// Midpoints of `cell`, along an axis of `length` voxels, that have both their voxels at shift `d` inside the volume.
#[inline]
pub(crate) fn midpoints(cell: &Range<usize>, length: usize, d: i32) -> Range<i32> {
    let (back, on, length) = (back(d), on(d), length as i32);
    let from = (cell.start as i32).max(back).max(-on);
    let to = (cell.end as i32).min(length + back).min(length - on);
    from..to.max(from)
}

/// The voxels of one volume that belong to the midpoints of a cell, for each axis and each shift along it. `offset` of
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
