//! Boxes of trial shifts, and the sums kept for each shift.
//!
//! Convention: a trial shift `d` is whole voxels, split as `d1 = floor(d / 2)`, `d2 = d - d1`. Midpoint `x` pairs voxel
//! `x - d1` of the first volume with `x + d2` of the second, so a window measures where the particles are half way
//! (second order in time), and swapping the volumes turns `d` into `-d` with the very same pairs.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The part of a shift taken back from the midpoint to the first volume.
#[inline]
pub(crate) fn back(d: i32) -> i32 {
    d >> 1
}

/// The part of a shift taken on from the midpoint to the second volume.
#[inline]
pub(crate) fn on(d: i32) -> i32 {
    d - (d >> 1)
}

/// A box of trial shifts; x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shifts {
    /// Lowest shift along each axis.
    pub low: [i32; 3],
    /// Shifts along each axis.
    pub n: [usize; 3],
}

impl Shifts {
    /// All shifts within `radius` of `centre`.
    pub fn around(centre: [i32; 3], radius: [usize; 3]) -> Self {
        Self { low: std::array::from_fn(|a| centre[a] - radius[a] as i32), n: radius.map(|r| 2 * r + 1) }
    }

    /// Number of shifts.
    pub fn len(&self) -> usize {
        self.n.iter().product()
    }

    /// The highest shift along an axis.
    pub fn high(&self, axis: usize) -> i32 {
        self.low[axis] + self.n[axis] as i32 - 1
    }

    /// Shifts along an axis.
    pub fn along(&self, axis: usize) -> Range<i32> {
        self.low[axis]..self.low[axis] + self.n[axis] as i32
    }

    /// The smallest box that holds both.
    pub fn hull(&self, other: &Self) -> Self {
        let low = std::array::from_fn(|a| self.low[a].min(other.low[a]));
        let n = std::array::from_fn(|a| (self.high(a).max(other.high(a)) - low[a] + 1) as usize);
        Self { low, n }
    }

    /// The smallest box that holds every box of an iterator.
    pub fn hull_of(boxes: impl Iterator<Item = Self>) -> Option<Self> {
        boxes.reduce(|hull, one| hull.hull(&one))
    }

    /// Place of the shift `low + k` in a channel.
    pub fn place(&self, k: [usize; 3]) -> usize {
        k[0] + self.n[0] * (k[1] + self.n[1] * k[2])
    }
}

/// What is summed over a cell or a window, for each shift. Sums of the first volume run over the voxels that the shift
/// pairs with a voxel inside the second volume, and the other way round.
pub(crate) mod channel {
    /// Sum of first x second.
    pub const PRODUCT: usize = 0;
    /// Sum of the first.
    pub const FIRST: usize = 1;
    /// Sum of the first squared.
    pub const FIRST_SQUARED: usize = 2;
    /// Sum of the second.
    pub const SECOND: usize = 3;
    /// Sum of the second squared.
    pub const SECOND_SQUARED: usize = 4;
    /// How many there are.
    pub const COUNT: usize = 5;
}

/// The sums of one cell, column, row or window.
#[derive(Debug, Clone)]
pub(crate) struct Sums {
    pub shifts: Shifts,
    data: Vec<f64>,
}

impl Sums {
    /// All zero.
    pub fn zero(shifts: Shifts) -> Self {
        Self { shifts, data: vec![0.0; channel::COUNT * shifts.len()] }
    }

    /// One channel.
    pub fn channel(&self, channel: usize) -> &[f64] {
        let n = self.shifts.len();
        &self.data[channel * n..(channel + 1) * n]
    }

    /// One channel, to be written.
    pub fn channel_mut(&mut self, channel: usize) -> &mut [f64] {
        let n = self.shifts.len();
        &mut self.data[channel * n..(channel + 1) * n]
    }

    /// Two neighbouring channels, to be written.
    pub fn pair_mut(&mut self, channel: usize) -> (&mut [f64], &mut [f64]) {
        let n = self.shifts.len();
        self.data[channel * n..(channel + 2) * n].split_at_mut(n)
    }

    /// Adds the sums of `other`, whose shifts include these.
    pub fn add(&mut self, other: &Self) {
        let (mine, theirs) = (self.shifts, other.shifts);
        if mine == theirs {
            self.data.iter_mut().zip(&other.data).for_each(|(sum, value)| *sum += value);
            return;
        }
        let skip: [usize; 3] = std::array::from_fn(|a| (mine.low[a] - theirs.low[a]) as usize);
        for channel in 0..channel::COUNT {
            let (to, from) = (channel * mine.len(), channel * theirs.len());
            for kz in 0..mine.n[2] {
                for ky in 0..mine.n[1] {
                    let to = to + mine.place([0, ky, kz]);
                    let from = from + theirs.place([skip[0], ky + skip[1], kz + skip[2]]);
                    let source = &other.data[from..from + mine.n[0]];
                    self.data[to..to + mine.n[0]].iter_mut().zip(source).for_each(|(sum, value)| *sum += value);
                }
            }
        }
    }
}

/// Sums that are no longer needed: new ones are made of them, for asking the system for memory takes longer than summing.
#[derive(Debug, Default)]
pub(crate) struct Pool {
    free: Mutex<Vec<Vec<f64>>>,
}

impl Pool {
    /// All zero.
    pub fn zero(&self, shifts: Shifts) -> Sums {
        let mut data = self.buffer();
        data.resize(channel::COUNT * shifts.len(), 0.0);
        Sums { shifts, data }
    }

    /// The sum of `parts`, whose shifts include these.
    pub fn total<'a>(&self, shifts: Shifts, mut parts: impl Iterator<Item = &'a Sums>) -> Sums {
        let first: [Option<&Sums>; 4] = std::array::from_fn(|_| parts.next());
        let mut sums = match first {
            // Four at a time, as windows share cells at three quarters of overlap: each is read once, and the sum written once.
            [Some(a), Some(b), Some(c), Some(d)] if [a, b, c, d].iter().all(|part| part.shifts == shifts) => {
                let mut data = self.buffer();
                let four = a.data.iter().zip(&b.data).zip(&c.data).zip(&d.data);
                data.extend(four.map(|(((a, b), c), d)| a + b + c + d));
                Sums { shifts, data }
            }
            _ => {
                let mut sums = self.zero(shifts);
                first.into_iter().flatten().for_each(|part| sums.add(part));
                sums
            }
        };
        parts.for_each(|part| sums.add(part));
        sums
    }

    /// Takes back what is no longer needed.
    pub fn take_back(&self, sums: impl IntoIterator<Item = Sums>) {
        let free = sums.into_iter().map(|sums| sums.data);
        self.free.lock().unwrap_or_else(PoisonError::into_inner).extend(free);
    }

    /// An empty buffer.
    fn buffer(&self) -> Vec<f64> {
        let mut data = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        data.clear();
        data
    }
}
