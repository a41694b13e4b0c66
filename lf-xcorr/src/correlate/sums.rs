//! The sums that a correlation is made of, for each trial shift.

use super::shifts::Shifts;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

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
    /// Free buffers by their capacity.
    free: Mutex<BTreeMap<usize, Vec<Vec<f64>>>>,
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
        let mut free = self.free();
        sums.into_iter().for_each(|Sums { data, .. }| free.entry(data.capacity()).or_default().push(data));
    }

    /// An empty buffer for `len` numbers, and hardly more. Buffers that went from small boxes to large ones would all
    /// grow to the largest. A new buffer takes the place of one that does not fit.
    fn buffer(&self, len: usize) -> Vec<f64> {
        const SPARE: f64 = 1.1;
        let mut free = self.free();
        let fitting = free.range(len..=(SPARE * len as f64) as usize).next().map(|(capacity, _)| *capacity);
        let other = || free.range(..len).next_back().or_else(|| free.iter().next_back()).map(|(capacity, _)| *capacity);
        let taken = fitting.or_else(other).and_then(|capacity| {
            let buffers = free.get_mut(&capacity)?;
            let taken = buffers.pop();
            if buffers.is_empty() {
                free.remove(&capacity);
            }
            taken
        });
        drop(free);
        let mut data = taken.filter(|_| fitting.is_some()).unwrap_or_else(|| Vec::with_capacity(len));
        data.clear();
        data
    }

    fn free(&self) -> MutexGuard<'_, BTreeMap<usize, Vec<Vec<f64>>>> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scar: buffers that small boxes gave back grew with every larger box, and all were as large as the largest.
    #[test]
    fn buffers_go_to_boxes_of_their_size() {
        let shifts = |radius: usize| Shifts::around([0; 3], [radius; 3]);
        let pool = SumsPool::default();
        let sums = [2, 3, 2].map(|radius| pool.zero(shifts(radius)));
        let places = sums.each_ref().map(|sums| sums.data.as_ptr());
        pool.take_back(sums);
        let large = pool.zero(shifts(3));
        let small = [pool.zero(shifts(2)), pool.zero(shifts(2))];
        assert_eq!(large.data.as_ptr(), places[1]);
        assert!(small.iter().all(|sums| places.contains(&sums.data.as_ptr())));
        // A buffer that does not fit makes room for one that does.
        pool.take_back(small);
        let larger = pool.zero(shifts(4));
        assert_eq!(larger.data.capacity(), channel::COUNT * 9 * 9 * 9);
        assert_eq!(pool.free().values().map(Vec::len).sum::<usize>(), 1);
    }
}
