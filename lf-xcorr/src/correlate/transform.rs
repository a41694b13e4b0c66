//! The sums of one window at every shift of a box, by Fourier transforms: for volumes full of light.
//!
//! Convention: `c` is the centre of the box of shifts, rounded down. The window of the first volume is moved by
//! `-back(c)`, and every shift `d` pairs its voxel `a` with voxel `a + d` of the second volume. A pair with one voxel
//! outside counts as dark in both. At `d = c` these are the pairs of the direct sums; at other shifts their midpoints
//! are half of `d - c` away. Use them to find a peak, not to measure it: a vector read off them scatters about twice as
//! much as one read off direct sums, and exchanging the volumes does not quite negate it.
//!
//! Promise: nothing wraps round, because the transforms are as long as window and search together. Products have an
//! error of 1e-12 of the energies. The transforms go axis by axis, and skip rows that are dark or not needed.

use super::energy::{self, EnergyScratch};
use super::score::PairedVoxels;
use super::shifts::{Shifts, back};
use super::sums::{Sums, channel, zeros};
use crate::volumes::Rows;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// Constant: products below this fraction of the geometric mean of both energies are set to 0. Rounding leaves 1e-13
/// where no light meets; a larger constant would lose dim particles beside bright ones.
const ROUNDING: f64 = 1e-12;

/// The transforms for one size of window and of box of shifts.
pub(crate) struct Transforms {
    window: [usize; 3],
    n_shifts: [usize; 3],
    /// Length of the transforms along each axis.
    size: [usize; 3],
    forward_x: Arc<dyn RealToComplex<f64>>,
    inverse_x: Arc<dyn ComplexToReal<f64>>,
    /// Along y and z.
    forward: [Arc<dyn Fft<f64>>; 2],
    inverse: [Arc<dyn Fft<f64>>; 2],
}

/// Buffers reused from window to window; their contents do not matter.
#[derive(Debug, Default)]
pub(crate) struct TransformScratch {
    /// Spectra of the two volumes along x and y: `[kx][z][ky]`.
    flat: [Vec<Complex<f64>>; 2],
    /// One kx of the two spectra along all axes: `[ky][kz]`.
    slab: [Vec<Complex<f64>>; 2],
    /// Spectra of rows along x: `[y][kx]`.
    rows: Vec<Complex<f64>>,
    /// One row along x.
    real: Vec<f64>,
    work: Vec<Complex<f64>>,
    energy: EnergyScratch,
}

impl Transforms {
    pub fn new(window: [usize; 3], n_shifts: [usize; 3]) -> Self {
        let extent = extent(window, n_shifts);
        let size = [0, 1, 2].map(|axis| smooth_length(extent[axis], if axis == 0 { 2 } else { 1 }));
        let mut real = RealFftPlanner::new();
        let mut complex = FftPlanner::new();
        Self {
            window,
            n_shifts,
            size,
            forward_x: real.plan_fft_forward(size[0]),
            inverse_x: real.plan_fft_inverse(size[0]),
            forward: [1, 2].map(|axis| complex.plan_fft_forward(size[axis])),
            inverse: [1, 2].map(|axis| complex.plan_fft_inverse(size[axis])),
        }
    }

    /// The sums of a window of the prepared size. Its midpoints, at the centre of `shifts`, are `window`.
    pub fn sums(
        &self,
        [first, second]: [&Rows; 2],
        window: &[Range<usize>; 3],
        shifts: Shifts,
        scratch: &mut TransformScratch,
    ) -> Sums {
        assert_eq!(window.each_ref().map(Range::len), self.window, "a window of the prepared size");
        assert_eq!(shifts.n, self.n_shifts, "as many shifts as prepared");
        let mut sums = Sums::zero(shifts);
        let start = start_of(window, &shifts);

        // Sum each volume over the voxels that every shift pairs.
        let paired = |axis: usize, of_second: bool| -> Vec<Range<i32>> {
            let pairs = |d: i32| {
                let Range { start, end } = self.paired(start[axis], axis, first.shape[axis], d);
                if of_second { start + d..end + d } else { start..end }
            };
            shifts.along(axis).map(pairs).collect()
        };
        for (rows, channel, of_second) in [(first, channel::FIRST, false), (second, channel::SECOND, true)] {
            let ranges = [0, 1, 2].map(|axis| paired(axis, of_second));
            energy::sums(rows, &ranges, sums.pair_mut(channel), &mut scratch.energy);
        }

        // Transform both along x and y, and correlate if both hold light.
        let start_of_second = [0, 1, 2].map(|axis| start[axis] + shifts.low[axis]);
        let squares_of_first = self.flatten(first, start, self.window, 0, scratch);
        let extent = extent(self.window, self.n_shifts);
        let squares_of_second = self.flatten(second, start_of_second, extent, 1, scratch);
        if squares_of_first > 0.0 && squares_of_second > 0.0 {
            let threshold = ROUNDING * (squares_of_first * squares_of_second).sqrt();
            self.correlate(threshold, sums.channel_mut(channel::PRODUCT), scratch);
        }
        sums
    }

    /// Number of voxels that each shift pairs, in volumes of `shape`.
    pub fn paired_voxels(&self, window: &[Range<usize>; 3], shape: [usize; 3], shifts: &Shifts) -> PairedVoxels {
        let start = start_of(window, shifts);
        PairedVoxels::new(shifts, |axis, d| self.paired(start[axis], axis, shape[axis], d).len() as f64)
    }

    /// Voxels of the first volume, along an axis of `length` voxels, that the shift `d` pairs in a window at `start`.
    fn paired(&self, start: i32, axis: usize, length: usize, d: i32) -> Range<i32> {
        let length = length as i32;
        let from = start.max(0).max(-d);
        from..(start + self.window[axis] as i32).min(length).min(length - d).max(from)
    }

    /// Multiplications and additions of one window's transforms; `lit_rows` is the lit fraction of the rows of each
    /// volume. A complex transform of n takes 5 n log2 n, a real one half of that, and each product of the spectra 6.
    pub fn operations(&self, lit_rows: [f64; 2]) -> f64 {
        let [window, extent] = [self.window, extent(self.window, self.n_shifts)];
        let transform = |axis: usize| 5.0 * self.size[axis] as f64 * (self.size[axis] as f64).log2();
        let rows = |n: [usize; 3]| (n[1] * n[2]) as f64;
        let rows = lit_rows[0] * rows(window) + lit_rows[1] * rows(extent) + rows(self.n_shifts);
        let planes = (window[2] + extent[2] + self.n_shifts[2]) as f64;
        let (half, y, z) = (self.half() as f64, self.size[1] as f64, self.size[2] as f64);
        rows * transform(0) / 2.0 + half * (planes * transform(1) + y * (3.0 * transform(2) + 6.0 * z))
    }

    /// Length of the spectrum of a real row.
    fn half(&self) -> usize {
        self.size[0] / 2 + 1
    }

    /// Transforms the box of `n` voxels at `start` along x and y, and returns the sum of its squares.
    fn flatten(
        &self,
        volume: &Rows,
        start: [i32; 3],
        n: [usize; 3],
        which: usize,
        scratch: &mut TransformScratch,
    ) -> f64 {
        let (half, [nx, ny, _]) = (self.half(), self.size);
        let TransformScratch { flat, rows, real, work, .. } = scratch;
        let flat = &mut flat[which];
        zeros(flat, half * n[2] * ny);
        zeros(work, self.forward_x.get_scratch_len().max(self.forward[0].get_inplace_scratch_len()));
        rows.resize(half * n[1], Complex::ZERO);
        let inside = |axis: usize| {
            let from = start[axis].max(0);
            from..(start[axis] + n[axis] as i32).min(volume.shape[axis] as i32).max(from)
        };
        let [in_x, in_y, in_z] = [0, 1, 2].map(inside);
        let mut squares = 0.0;
        for z in in_z {
            // Transform the lit rows of the plane along x.
            let mut is_lit = false;
            rows.fill(Complex::ZERO);
            for y in in_y.clone() {
                let (x, value) = volume.run(y as usize, z as usize, in_x.start, in_x.end);
                if x.is_empty() {
                    continue;
                }
                is_lit = true;
                zeros(real, nx);
                for (&x, &value) in x.iter().zip(value) {
                    real[(x as i32 - start[0]) as usize] = value as f64;
                    squares += (value as f64).powi(2);
                }
                let row = &mut rows[(y - start[1]) as usize * half..][..half];
                self.forward_x.process_with_scratch(real, row, work).expect("prepared lengths");
            }
            if !is_lit {
                continue;
            }
            // Transform the plane along y, for each kx.
            let z = (z - start[2]) as usize;
            for kx in 0..half {
                let column = &mut flat[(kx * n[2] + z) * ny..][..ny];
                copy(column.iter_mut(), rows.iter().skip(kx).step_by(half));
                self.forward[0].process_with_scratch(column, work);
            }
        }
        squares
    }

    /// Writes the products of the two flattened boxes for every shift; a product below `threshold` becomes 0.
    fn correlate(&self, threshold: f64, out: &mut [f64], scratch: &mut TransformScratch) {
        let (half, [nx, ny, nz]) = (self.half(), self.size);
        let depth = [self.window[2], extent(self.window, self.n_shifts)[2]];
        let [mx, my, mz] = self.n_shifts;
        let TransformScratch { flat, slab, rows, real, work, .. } = scratch;
        let lengths = [&self.forward[1], &self.inverse[1], &self.inverse[0]].map(|fft| fft.get_inplace_scratch_len());
        zeros(work, lengths.into_iter().fold(self.inverse_x.get_scratch_len(), usize::max));
        rows.resize(half * my * mz, Complex::ZERO);
        for kx in 0..half {
            // Transform both volumes along z.
            for volume in 0..2 {
                zeros(&mut slab[volume], ny * nz);
                let flat = &flat[volume][kx * depth[volume] * ny..][..depth[volume] * ny];
                for (ky, column) in slab[volume].chunks_exact_mut(nz).enumerate() {
                    copy(column.iter_mut(), flat.iter().skip(ky).step_by(ny));
                }
                self.forward[1].process_with_scratch(&mut slab[volume], work);
            }
            // Multiply the spectra and go back along z, then along y in the planes of the shifts.
            let [planes, product] = slab;
            product.iter_mut().zip(planes.iter()).for_each(|(second, first)| *second *= first.conj());
            self.inverse[1].process_with_scratch(product, work);
            for (kz, plane) in planes[..ny * mz].chunks_exact_mut(ny).enumerate() {
                copy(plane.iter_mut(), product.iter().skip(kz).step_by(nz));
                self.inverse[0].process_with_scratch(plane, work);
                let rows = rows[kz * my * half..][..my * half].iter_mut().skip(kx).step_by(half);
                copy(rows, plane.iter());
            }
        }
        // Go back along x in the rows of the shifts. Both ends of a real row's spectrum are real; rounding is removed.
        let scale = 1.0 / (nx * ny * nz) as f64;
        real.resize(nx, 0.0);
        for (row, out) in rows.chunks_exact_mut(half).zip(out.chunks_exact_mut(mx)) {
            (row[0].im, row[half - 1].im) = (0.0, 0.0);
            self.inverse_x.process_with_scratch(row, real, work).expect("prepared lengths");
            for (out, &product) in out.iter_mut().zip(real.iter()) {
                let product = scale * product;
                *out = if product < threshold { 0.0 } else { product };
            }
        }
    }
}

/// First voxel of the first volume's window.
fn start_of(window: &[Range<usize>; 3], shifts: &Shifts) -> [i32; 3] {
    [0, 1, 2].map(|axis| window[axis].start as i32 - back(shifts.centre(axis)))
}

/// Voxels of the second volume that a window meets in a box of shifts.
fn extent(window: [usize; 3], n_shifts: [usize; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| window[axis] + n_shifts[axis] - 1)
}

/// The smallest multiple of `factor`, at least `length`, that has no prime factor above 5.
fn smooth_length(length: usize, factor: usize) -> usize {
    let is_smooth = |n: &usize| {
        let without = |mut n: usize, prime: usize| {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
            n
        };
        [2, 3, 5].into_iter().fold(*n, without) == 1
    };
    (length.div_ceil(factor)..).map(|n| n * factor).find(is_smooth).expect("powers of 2 are endless")
}

fn copy<'a, T: Copy + 'a>(to: impl Iterator<Item = &'a mut T>, from: impl Iterator<Item = &'a T>) {
    to.zip(from).for_each(|(to, from)| *to = *from);
}

#[cfg(test)]
mod tests;
