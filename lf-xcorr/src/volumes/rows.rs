//! The lit voxels of a volume in rows along x.

use super::{mask::Mask, sparse::Sparse};
use rayon::prelude::*;
use std::ops::Range;

/// Lit voxels in rows along x: row `y + ny z` holds entries `start[row] .. start[row + 1]`, x rising.
#[derive(Debug, Clone)]
pub(crate) struct Rows<T = f32> {
    pub shape: [usize; 3],
    /// Minimum intensity of a lit voxel: the floor times the peak of the whole volume.
    pub threshold: f32,
    start: Vec<usize>,
    pub x: Vec<u32>,
    /// Intensity, or intensities, of each entry.
    pub value: Vec<T>,
}

impl<T: Copy> Rows<T> {
    pub fn with_capacity(shape: [usize; 3], count: usize) -> Self {
        let start = Vec::with_capacity(shape[1] * shape[2] + 1);
        Self { shape, threshold: 0.0, start, x: Vec::with_capacity(count), value: Vec::with_capacity(count) }
    }

    /// Ends every row before `row`.
    pub fn open_row(&mut self, row: usize) {
        if self.start.len() <= row {
            self.start.resize(row + 1, self.x.len());
        }
    }

    pub fn push(&mut self, x: u32, value: T) {
        self.x.push(x);
        self.value.push(value);
    }

    pub fn count(&self) -> usize {
        self.x.len()
    }

    #[inline]
    pub fn entries(&self, y: usize, z: usize) -> Range<usize> {
        let row = y + self.shape[1] * z;
        self.start[row]..self.start[row + 1]
    }

    /// The entries of row (y, z) with x in `from .. to`.
    #[inline]
    pub fn between(&self, y: usize, z: usize, from: i32, to: i32) -> Range<usize> {
        let entries = self.entries(y, z);
        if entries.is_empty() {
            return entries;
        }
        let x = &self.x[entries.clone()];
        let first = x.partition_point(|&x| (x as i32) < from);
        let last = first + x[first..].partition_point(|&x| (x as i32) < to);
        entries.start + first..entries.start + last
    }

    /// Whether a box of voxels, which lies inside the volume, has a lit one.
    pub fn is_lit(&self, [x, y, z]: [Range<i32>; 3]) -> bool {
        let has_lit = |y: i32, z: i32| !self.between(y as usize, z as usize, x.start, x.end).is_empty();
        z.into_iter().any(|z| y.clone().any(|y| has_lit(y, z)))
    }

    /// The lit voxels of row (y, z) with x in `from .. to`: their x and their intensities.
    #[inline]
    pub fn run(&self, y: usize, z: usize, from: i32, to: i32) -> (&[u32], &[T]) {
        let entries = self.between(y, z, from, to);
        (&self.x[entries.clone()], &self.value[entries])
    }

    pub fn row(&self, y: usize, z: usize) -> impl Iterator<Item = (u32, T)> + '_ {
        self.entries(y, z).map(|entry| (self.x[entry], self.value[entry]))
    }
}

impl Rows {
    /// The voxels of `volume` inside `mask` of at least `floor` times its peak, counted from the mask's corner.
    /// Intensities are scaled by a power of two, which is exact, so that the peak is 1 to 2 and no sum leaves the range
    /// of f32.
    pub fn new(volume: &Sparse, mask: &Mask, floor: f32) -> Self {
        let grid = volume.grid;
        let sides = mask.sides(grid.shape);
        let shape = sides.each_ref().map(Range::len);
        let gain = f64::from(volume.peak()).log2().floor().max(-200.0).exp2().recip();
        let scaled = |value: f32| (f64::from(value) * gain) as f32;
        let threshold = (floor * scaled(volume.peak())).max(f32::MIN_POSITIVE);
        let mut rows = Self { threshold, ..Self::with_capacity(shape, volume.indices.len()) };
        let lit = volume.indices.iter().zip(volume.intensity.iter().map(|value| scaled(*value)));
        for (&index, value) in lit.filter(|(_, value)| *value >= threshold) {
            let voxel = grid.voxel(index);
            if mask.holds(index, voxel) {
                let [x, y, z]: [usize; 3] = std::array::from_fn(|a| voxel[a] - sides[a].start);
                rows.open_row(y + shape[1] * z);
                rows.push(x as u32, value);
            }
        }
        rows.open_row(shape[1] * shape[2]);
        rows
    }

    /// One list per row: column and value of its lit voxels, by rising column.
    pub fn from_lists(shape: [usize; 3], lists: &[Vec<(u32, f32)>]) -> Self {
        let mut rows = Self::with_capacity(shape, lists.iter().map(Vec::len).sum());
        for (row, list) in lists.iter().enumerate() {
            rows.open_row(row);
            list.iter().for_each(|&(x, value)| rows.push(x, value));
        }
        rows.open_row(shape[1] * shape[2]);
        rows
    }

    /// The lit voxels of a dense volume, x fastest.
    #[cfg(test)]
    pub fn of_dense(shape: [usize; 3], dense: &[f32]) -> Self {
        Self::from_lists(shape, &dense.chunks(shape[0]).map(|row| lit(row, 0.0).collect()).collect::<Vec<_>>())
    }

    /// These rows, scaled to a sum of squares of 1.
    pub fn of_unit_energy(mut self) -> Self {
        let energy: f64 = self.value.iter().map(|&value| (value as f64).powi(2)).sum();
        let gain = if energy > 0.0 { energy.sqrt().recip() } else { 1.0 };
        self.value.iter_mut().for_each(|value| *value = (*value as f64 * gain) as f32);
        self.threshold = (self.threshold as f64 * gain) as f32;
        self
    }

    /// These rows summed into bins of `bin` voxels; the last bin of an axis may reach beyond the volume.
    pub fn binned(&self, bin: [usize; 3]) -> Self {
        let shape: [usize; 3] = std::array::from_fn(|axis| self.shape[axis].div_ceil(bin[axis]));
        let in_row = |row: usize| {
            let (y, z) = (row % shape[1] * bin[1], row / shape[1] * bin[2]);
            let mut sums = vec![0f64; shape[0]];
            for z in z..(z + bin[2]).min(self.shape[2]) {
                for y in y..(y + bin[1]).min(self.shape[1]) {
                    self.row(y, z).for_each(|(x, value)| sums[x as usize / bin[0]] += value as f64);
                }
            }
            let sums: Vec<f32> = sums.into_iter().map(|sum| sum as f32).collect();
            lit(&sums, 0.0).collect()
        };
        let lists: Vec<_> = (0..shape[1] * shape[2]).into_par_iter().map(in_row).collect();
        Self::from_lists(shape, &lists)
    }
}

/// The voxels of a dense row with light of at least `threshold`: x and intensity.
pub(crate) fn lit(row: &[f32], threshold: f32) -> impl Iterator<Item = (u32, f32)> + '_ {
    (0..).zip(row.iter().copied()).filter(move |(_, value)| *value > 0.0 && *value >= threshold)
}
