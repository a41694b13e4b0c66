//! The sums that a correlation is made of, for each trial shift.

use super::shifts::Shifts;

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
    /// Channel after channel, each a number for each shift.
    pub data: Vec<f64>,
}

impl Sums {
    pub fn channel(&self, channel: usize) -> &[f64] {
        let n = self.shifts.len();
        &self.data[channel * n..(channel + 1) * n]
    }
}

/// Sums in borrowed memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SumsView<'a> {
    pub shifts: Shifts,
    /// Channel after channel, each a number for each shift.
    pub data: &'a [f64],
}

impl SumsView<'_> {
    /// Adds these sums to those in `sums` for the box `shifts`, which lies inside this one.
    pub fn add_to(&self, sums: &mut [f64], shifts: Shifts) {
        let theirs = self.shifts;
        if shifts == theirs {
            sums.iter_mut().zip(self.data).for_each(|(sum, value)| *sum += value);
            return;
        }
        let skip: [usize; 3] = std::array::from_fn(|a| (shifts.low[a] - theirs.low[a]) as usize);
        for channel in 0..channel::COUNT {
            let (to, from) = (channel * shifts.len(), channel * theirs.len());
            for kz in 0..shifts.n[2] {
                for ky in 0..shifts.n[1] {
                    let to = to + shifts.index([0, ky, kz]);
                    let from = from + theirs.index([skip[0], ky + skip[1], kz + skip[2]]);
                    let source = &self.data[from..from + shifts.n[0]];
                    sums[to..to + shifts.n[0]].iter_mut().zip(source).for_each(|(sum, value)| *sum += value);
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
