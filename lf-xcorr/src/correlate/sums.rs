//! The sums that a correlation is made of, for each trial shift.

use super::shifts::Shifts;
use std::sync::{Mutex, PoisonError};

/// The five sums of a cell or a window. The sums of one volume run over the voxels that the shift pairs with a voxel
/// inside the other volume.
pub(crate) mod channel {
    pub const PRODUCT: usize = 0;
    pub const FIRST: usize = 1;
    pub const FIRST_SQUARED: usize = 2;
    pub const SECOND: usize = 3;
    pub const SECOND_SQUARED: usize = 4;
    pub const COUNT: usize = 5;
}

#[derive(Debug, Clone)]
pub(crate) struct Sums {
    pub shifts: Shifts,
    data: Vec<f64>,
}

impl Sums {
    pub fn zero(shifts: Shifts) -> Self {
        Self { shifts, data: vec![0.0; channel::COUNT * shifts.len()] }
    }

    pub fn channel(&self, channel: usize) -> &[f64] {
        let n = self.shifts.len();
        &self.data[channel * n..(channel + 1) * n]
    }

    pub fn channel_mut(&mut self, channel: usize) -> &mut [f64] {
        let n = self.shifts.len();
        &mut self.data[channel * n..(channel + 1) * n]
    }

    /// A channel and the next one, mutable.
    pub fn pair_mut(&mut self, channel: usize) -> [&mut [f64]; 2] {
        let n = self.shifts.len();
        self.data[channel * n..(channel + 2) * n].split_at_mut(n).into()
    }

    /// Adds `other`. Its box of shifts contains this one.
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
                    let to = to + mine.index([0, ky, kz]);
                    let from = from + theirs.index([skip[0], ky + skip[1], kz + skip[2]]);
                    let source = &other.data[from..from + mine.n[0]];
                    self.data[to..to + mine.n[0]].iter_mut().zip(source).for_each(|(sum, value)| *sum += value);
                }
            }
        }
    }
}

/// Makes `buffer` hold `n` zeros.
pub(crate) fn zeros<T: Clone + Default>(buffer: &mut Vec<T>, n: usize) {
    buffer.clear();
    buffer.resize(n, T::default());
}

/// Buffers of finished sums, for reuse: asking the system for memory takes longer than summing.
#[derive(Debug, Default)]
pub(crate) struct SumsPool {
    free: Mutex<Vec<Vec<f64>>>,
}

impl SumsPool {
    pub fn zero(&self, shifts: Shifts) -> Sums {
        let len = channel::COUNT * shifts.len();
        let mut data = self.buffer(len);
        data.resize(len, 0.0);
        Sums { shifts, data }
    }

    /// The total of `terms`. The box of shifts of each term contains `shifts`.
    pub fn total<'a>(&self, shifts: Shifts, mut terms: impl Iterator<Item = &'a Sums>) -> Sums {
        let first: [Option<&Sums>; 4] = std::array::from_fn(|_| terms.next());
        let mut sums = match first {
            // At 75 % overlap a window has four cells along each axis: read each once and write the sum once.
            [Some(a), Some(b), Some(c), Some(d)] if [a, b, c, d].iter().all(|term| term.shifts == shifts) => {
                let mut data = self.buffer(a.data.len());
                let four = a.data.iter().zip(&b.data).zip(&c.data).zip(&d.data);
                data.extend(four.map(|(((a, b), c), d)| a + b + c + d));
                Sums { shifts, data }
            }
            _ => {
                let mut sums = self.zero(shifts);
                first.into_iter().flatten().for_each(|term| sums.add(term));
                sums
            }
        };
        terms.for_each(|term| sums.add(term));
        sums
    }

    pub fn take_back(&self, sums: impl IntoIterator<Item = Sums>) {
        let free = sums.into_iter().map(|sums| sums.data);
        self.free.lock().unwrap_or_else(PoisonError::into_inner).extend(free);
    }

    /// An empty buffer for `len` numbers, and hardly more. Buffers that went from small boxes to large ones would all
    /// grow to the largest.
    fn buffer(&self, len: usize) -> Vec<f64> {
        const SPARE: f64 = 1.1;
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let fits = |data: &Vec<f64>| (len..=(SPARE * len as f64) as usize).contains(&data.capacity());
        let mut data = free.filter(fits).unwrap_or_else(|| Vec::with_capacity(len));
        data.clear();
        data
    }
}
