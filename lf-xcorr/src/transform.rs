//! The sums of one window at every shift of a box, by Fourier transforms: for volumes full of light.
//!
//! Convention: with `c` the centre of the box of shifts (rounded down), the window of the first volume is moved by
//! `-back(c)`, and every shift `d` pairs its voxel `a` with voxel `a + d` of the second. A pair that has one voxel outside
//! its volume counts as dark in both. At `d = c` these are the pairs of the direct path, which moves both volumes by
//! half of each shift; at other shifts the sums stand half of `d - c` away. They are for finding a peak: read off them, and
//! not off direct sums, a vector scatters about twice as much, and swapping the volumes does not quite negate it.
//!
//! Promise: nothing wraps round, for the transforms are as long as window and search together, and products are good to
//! 1e-12 of the energies. The transforms are one-dimensional, pass by pass: lines known to be dark on the way in, and
//! lines nobody reads on the way out, are left out.

use crate::energy;
use crate::score::Room;
use crate::shifts::{Shifts, Sums, back, channel};
use crate::sparse::Rows;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// Constant: products below this share of the root of the energies' product are taken as 0. Rounding leaves 1e-13 where no
/// light meets; larger, and dim particles beside bright ones are lost.
const ROUNDING: f64 = 1e-12;

/// The transforms for one size of window and box of shifts; threads may share it.
pub(crate) struct Plan {
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

/// Buffers kept from window to window; they need not be clean.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// Spectra of the two volumes along x and y: `[kx][z][ky]`.
    near: [Vec<Complex<f64>>; 2],
    /// One kx of the two spectra along all axes: `[ky][kz]`.
    slab: [Vec<Complex<f64>>; 2],
    /// Rows of spectra along x: `[y][kx]`.
    lines: Vec<Complex<f64>>,
    /// One row along x.
    real: Vec<f64>,
    /// What the transforms work in.
    work: Vec<Complex<f64>>,
    energy: energy::Scratch,
}

impl Plan {
    /// Plans for windows of `window` voxels and boxes of `n_shifts` shifts.
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

    /// The sums of the window whose midpoints at the centre of `shifts` are `window`.
    ///
    /// # Panics
    /// If the window or the box of shifts is not of the planned size.
    pub fn sums(
        &self,
        first: &Rows,
        second: &Rows,
        window: &[Range<usize>; 3],
        shifts: Shifts,
        scratch: &mut Scratch,
    ) -> Sums {
        assert_eq!(window.each_ref().map(Range::len), self.window, "a window of the planned size");
        assert_eq!(shifts.n, self.n_shifts, "as many shifts as planned");
        let mut sums = Sums::zero(shifts);
        let from = self.from(window, &shifts);

        // Sum each volume over the voxels that every shift pairs.
        let paired = |axis: usize, of_second: bool| -> Vec<Range<i32>> {
            let pairs = |d: i32| {
                let Range { start, end } = self.paired(from[axis], axis, first.shape[axis], d);
                if of_second { start + d..end + d } else { start..end }
            };
            shifts.along(axis).map(pairs).collect()
        };
        for (rows, channel, of_second) in [(first, channel::FIRST, false), (second, channel::SECOND, true)] {
            let (sum, squares) = sums.pair_mut(channel);
            let ranges = [0, 1, 2].map(|axis| paired(axis, of_second));
            energy::sums(rows, &ranges, sum, squares, &mut scratch.energy);
        }

        // Transform both along x and y, and correlate if both hold light.
        let from_second = [0, 1, 2].map(|axis| from[axis] + shifts.low[axis]);
        let of_first = self.flatten(first, from, self.window, 0, scratch);
        let of_second = self.flatten(second, from_second, extent(self.window, self.n_shifts), 1, scratch);
        if of_first > 0.0 && of_second > 0.0 {
            let least = ROUNDING * (of_first * of_second).sqrt();
            self.correlate(least, sums.channel_mut(channel::PRODUCT), scratch);
        }
        sums
    }

    /// How many voxels each shift pairs, in volumes of `shape`.
    pub fn room(&self, window: &[Range<usize>; 3], shape: [usize; 3], shifts: &Shifts) -> Room {
        let from = self.from(window, shifts);
        let along = |axis: usize| {
            let room = |d: i32| self.paired(from[axis], axis, shape[axis], d).len() as f64;
            shifts.along(axis).map(room).collect()
        };
        Room::of(std::array::from_fn(along))
    }

    /// First voxel of the first volume's window.
    fn from(&self, window: &[Range<usize>; 3], shifts: &Shifts) -> [i32; 3] {
        [0, 1, 2].map(|a| window[a].start as i32 - back((shifts.low[a] + shifts.high(a)).div_euclid(2)))
    }

    /// The voxels of the first volume along an axis that the shift `d` pairs, of a window that starts at `from`.
    fn paired(&self, from: i32, axis: usize, length: usize, d: i32) -> Range<i32> {
        let length = length as i32;
        let start = from.max(0).max(-d);
        start..(from + self.window[axis] as i32).min(length).min(length - d).max(start)
    }

    /// Multiplications and additions of one window's transforms, where a share `lit_rows` of the rows of the two volumes
    /// holds light: 5 n log2 n for a complex line of n, half of that for a real one, 6 for each product of the spectra.
    pub fn operations(&self, lit_rows: [f64; 2]) -> f64 {
        let [wide, deep] = [self.window, extent(self.window, self.n_shifts)];
        let line = |axis: usize| 5.0 * self.size[axis] as f64 * (self.size[axis] as f64).log2();
        let rows = |n: [usize; 3]| (n[1] * n[2]) as f64;
        let rows = lit_rows[0] * rows(wide) + lit_rows[1] * rows(deep) + rows(self.n_shifts);
        let planes = (wide[2] + deep[2] + self.n_shifts[2]) as f64;
        let (half, y, z) = (self.half() as f64, self.size[1] as f64, self.size[2] as f64);
        rows * line(0) / 2.0 + half * (planes * line(1) + y * (3.0 * line(2) + 6.0 * z))
    }

    /// Places of a real row's spectrum.
    fn half(&self) -> usize {
        self.size[0] / 2 + 1
    }

    /// Transforms the box of `n` voxels at `from` along x and y, and returns the sum of its squares.
    fn flatten(&self, rows: &Rows, from: [i32; 3], n: [usize; 3], volume: usize, scratch: &mut Scratch) -> f64 {
        let (half, [nx, ny, _]) = (self.half(), self.size);
        let Scratch { near, lines, real, work, .. } = scratch;
        let near = &mut near[volume];
        dark(near, half * n[2] * ny);
        dark(work, self.forward_x.get_scratch_len().max(self.forward[0].get_inplace_scratch_len()));
        lines.resize(half * n[1], Complex::ZERO);
        let inside = |axis: usize| {
            let start = from[axis].max(0);
            start..(from[axis] + n[axis] as i32).min(rows.shape[axis] as i32).max(start)
        };
        let [in_x, in_y, in_z] = [0, 1, 2].map(inside);
        let mut squares = 0.0;
        for z in in_z {
            // Along x: the lit rows of the plane.
            let mut lit = false;
            lines.fill(Complex::ZERO);
            for y in in_y.clone() {
                let (x, value) = rows.run(y as usize, z as usize, in_x.start, in_x.end);
                if x.is_empty() {
                    continue;
                }
                lit = true;
                dark(real, nx);
                for (&x, &value) in x.iter().zip(value) {
                    real[(x as i32 - from[0]) as usize] = value as f64;
                    squares += (value as f64).powi(2);
                }
                let line = &mut lines[(y - from[1]) as usize * half..][..half];
                self.forward_x.process_with_scratch(real, line, work).expect("lengths are the plan's");
            }
            if !lit {
                continue;
            }
            // Along y: one line of the plane for each kx.
            let z = (z - from[2]) as usize;
            for kx in 0..half {
                let line = &mut near[(kx * n[2] + z) * ny..][..ny];
                line.iter_mut().zip(lines.iter().skip(kx).step_by(half)).for_each(|(to, from)| *to = *from);
                self.forward[0].process_with_scratch(line, work);
            }
        }
        squares
    }

    /// Writes the products of the two flattened boxes for every shift; those below `least` as 0.
    fn correlate(&self, least: f64, out: &mut [f64], scratch: &mut Scratch) {
        let (half, [nx, ny, nz]) = (self.half(), self.size);
        let deep = [self.window[2], extent(self.window, self.n_shifts)[2]];
        let [mx, my, mz] = self.n_shifts;
        let Scratch { near, slab, lines, real, work, .. } = scratch;
        let lengths = [&self.forward[1], &self.inverse[1], &self.inverse[0]].map(|fft| fft.get_inplace_scratch_len());
        dark(work, lengths.into_iter().fold(self.inverse_x.get_scratch_len(), usize::max));
        lines.resize(half * my * mz, Complex::ZERO);
        for kx in 0..half {
            // Along z, both volumes.
            for volume in 0..2 {
                dark(&mut slab[volume], ny * nz);
                let near = &near[volume][kx * deep[volume] * ny..][..deep[volume] * ny];
                for (ky, line) in slab[volume].chunks_exact_mut(nz).enumerate() {
                    line.iter_mut().zip(near.iter().skip(ky).step_by(ny)).for_each(|(to, from)| *to = *from);
                }
                self.forward[1].process_with_scratch(&mut slab[volume], work);
            }
            // Multiply, and back along z; then back along y in the planes of the shifts.
            let [planes, product] = slab;
            product.iter_mut().zip(planes.iter()).for_each(|(second, first)| *second *= first.conj());
            self.inverse[1].process_with_scratch(product, work);
            for (kz, plane) in planes[..ny * mz].chunks_exact_mut(ny).enumerate() {
                plane.iter_mut().zip(product.iter().skip(kz).step_by(nz)).for_each(|(to, from)| *to = *from);
                self.inverse[0].process_with_scratch(plane, work);
                let lines = lines[kz * my * half..][..my * half].iter_mut().skip(kx).step_by(half);
                lines.zip(plane.iter()).for_each(|(to, from)| *to = *from);
            }
        }
        // Back along x in the rows of the shifts; the ends of a real row's spectrum are real but for rounding.
        let scale = 1.0 / (nx * ny * nz) as f64;
        real.resize(nx, 0.0);
        for (line, out) in lines.chunks_exact_mut(half).zip(out.chunks_exact_mut(mx)) {
            (line[0].im, line[half - 1].im) = (0.0, 0.0);
            self.inverse_x.process_with_scratch(line, real, work).expect("lengths are the plan's");
            for (out, &product) in out.iter_mut().zip(real.iter()) {
                let product = scale * product;
                *out = if product < least { 0.0 } else { product };
            }
        }
    }
}

/// Voxels of the second volume that a window meets in a box of shifts.
fn extent(window: [usize; 3], n_shifts: [usize; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| window[axis] + n_shifts[axis] - 1)
}

/// The smallest multiple of `factor` from `least` on that has no prime factor above 5.
fn smooth_length(least: usize, factor: usize) -> usize {
    let is_smooth = |n: &usize| {
        let without = |mut n: usize, prime: usize| {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
            n
        };
        [2, 3, 5].into_iter().fold(*n, without) == 1
    };
    (least.div_ceil(factor)..).map(|n| n * factor).find(is_smooth).expect("powers of 2 are endless")
}

/// `n` zeros.
fn dark<T: Clone + Default>(buffer: &mut Vec<T>, n: usize) {
    buffer.clear();
    buffer.resize(n, T::default());
}

#[cfg(test)]
mod tests;
