//! The lit voxels of a volume, sorted into rows along x.

use crate::error::{Error, Side};
use crate::mask::Mask;
use lf_core::grid::Grid;
use rayon::prelude::*;
use std::ops::Range;

/// A sparse volume as a caller holds it: one intensity per linear index, indices strictly rising.
#[derive(Debug, Clone, Copy)]
pub struct Sparse<'a> {
    /// The grid the indices count in.
    pub grid: &'a Grid,
    /// Strictly rising linear indices.
    pub indices: &'a [u64],
    /// Intensity of each voxel; finite and not negative.
    pub intensity: &'a [f32],
}

impl Sparse<'_> {
    /// Checks that the volume can be correlated inside `mask`; `side` is what a refusal is about.
    pub(crate) fn check(&self, mask: &Mask, side: Side) -> Result<(), Error> {
        assert_eq!(self.indices.len(), self.intensity.len(), "one intensity per index");
        let ordered = self.indices.windows(2).all(|pair| pair[0] < pair[1]);
        assert!(ordered && self.indices.last().is_none_or(|&last| last < self.grid.len()), "indices rise in the grid");
        let bad = |value: &f32| !(*value >= 0.0 && value.is_finite());
        if let Some(first) = self.intensity.iter().position(bad) {
            let count = self.intensity.iter().filter(|value| bad(value)).count();
            let place = self.grid.voxel(self.indices[first]);
            let found = format!("intensity {} at voxel {place:?}, {count} such in all", self.intensity[first]);
            return Err(Error::new(side, found, "wanted finite intensities of 0 or more"));
        }
        if self.peak() == 0.0 {
            let found = format!("{} voxels, none of them lit", self.indices.len());
            return Err(Error::new(side, found, "wanted a volume with light in it"));
        }
        let mut lit = self.indices.iter().zip(self.intensity).filter(|(_, value)| **value > 0.0);
        if !lit.any(|(&index, _)| mask.holds(index, self.grid.voxel(index))) {
            let found = format!("{} voxels, none of them lit inside the mask", self.indices.len());
            return Err(Error::new(side, found, "wanted light inside the mask"));
        }
        Ok(())
    }

    /// The brightest intensity; 0 for an empty volume.
    pub(crate) fn peak(&self) -> f32 {
        self.intensity.iter().fold(0.0, |peak, &value| value.max(peak))
    }
}

/// Lit voxels in rows along x: row `y + ny z` holds places `start[row] .. start[row + 1]`, x rising.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub shape: [usize; 3],
    /// What counts as dark below: the share of the whole volume's peak that was asked for.
    pub least: f32,
    start: Vec<usize>,
    x: Vec<u32>,
    value: Vec<f32>,
}

impl Rows {
    /// The voxels of `volume` inside `mask` of at least `floor` times its peak, counted from the mask's corner.
    pub fn new(volume: &Sparse, mask: &Mask, floor: f32) -> Self {
        let grid = volume.grid;
        let sides = mask.sides(grid.shape);
        let shape = sides.each_ref().map(Range::len);
        let least = (floor * volume.peak()).max(f32::MIN_POSITIVE);
        let mut rows = Self { least, ..Self::with_capacity(shape, volume.indices.len()) };
        for (&index, &value) in volume.indices.iter().zip(volume.intensity).filter(|(_, value)| **value >= least) {
            let voxel = grid.voxel(index);
            if mask.holds(index, voxel) {
                let [x, y, z]: [usize; 3] = std::array::from_fn(|a| voxel[a] - sides[a].start);
                rows.open_row(y + shape[1] * z);
                rows.x.push(x as u32);
                rows.value.push(value);
            }
        }
        rows.open_row(shape[1] * shape[2]);
        rows
    }

    fn with_capacity(shape: [usize; 3], count: usize) -> Self {
        let start = Vec::with_capacity(shape[1] * shape[2] + 1);
        Self { shape, least: 0.0, start, x: Vec::with_capacity(count), value: Vec::with_capacity(count) }
    }

    /// Closes every row before `row`.
    fn open_row(&mut self, row: usize) {
        if self.start.len() <= row {
            self.start.resize(row + 1, self.x.len());
        }
    }

    /// Number of lit voxels.
    pub fn count(&self) -> usize {
        self.x.len()
    }

    /// The same light, its sum of squares 1.
    pub fn of_unit_energy(mut self) -> Self {
        let energy: f64 = self.value.iter().map(|&value| (value as f64).powi(2)).sum();
        let gain = if energy > 0.0 { energy.sqrt().recip() } else { 1.0 };
        self.value.iter_mut().for_each(|value| *value = (*value as f64 * gain) as f32);
        self.least = (self.least as f64 * gain) as f32;
        self
    }

    /// The lit voxels of row (y, z) with x in `from .. to`.
    #[inline]
    pub fn run(&self, y: usize, z: usize, from: i32, to: i32) -> (&[u32], &[f32]) {
        let row = y + self.shape[1] * z;
        let places = self.start[row]..self.start[row + 1];
        if places.is_empty() {
            return (&[], &[]);
        }
        let x = &self.x[places.clone()];
        let first = x.partition_point(|&x| (x as i32) < from);
        let last = first + x[first..].partition_point(|&x| (x as i32) < to);
        (&x[first..last], &self.value[places.start + first..places.start + last])
    }

    /// The same light summed into bins of `bin` voxels; the last bin of an axis may be partly outside.
    pub fn binned(&self, bin: [usize; 3]) -> Self {
        let shape: [usize; 3] = std::array::from_fn(|axis| self.shape[axis].div_ceil(bin[axis]));
        let lines: Vec<Vec<(u32, f32)>> = (0..shape[1] * shape[2])
            .into_par_iter()
            .map(|row| {
                let (y, z) = (row % shape[1] * bin[1], row / shape[1] * bin[2]);
                let mut line = vec![0f64; shape[0]];
                for z in z..(z + bin[2]).min(self.shape[2]) {
                    for y in y..(y + bin[1]).min(self.shape[1]) {
                        let (x, value) = self.run(y, z, 0, self.shape[0] as i32);
                        for (&x, &value) in x.iter().zip(value) {
                            line[x as usize / bin[0]] += value as f64;
                        }
                    }
                }
                let lit = line.iter().enumerate().filter(|(_, value)| **value > 0.0);
                lit.map(|(x, &value)| (x as u32, value as f32)).collect()
            })
            .collect();
        Self::from_lines(shape, lines.iter().map(Vec::as_slice))
    }

    /// The lit voxels of a dense volume, x fastest.
    #[cfg(test)]
    pub fn of_dense(shape: [usize; 3], dense: &[f32]) -> Self {
        let lit = |line: &[f32]| -> Vec<(u32, f32)> {
            let lit = line.iter().enumerate().filter(|(_, value)| **value > 0.0);
            lit.map(|(x, &value)| (x as u32, value)).collect()
        };
        let lines: Vec<_> = dense.chunks(shape[0]).map(lit).collect();
        Self::from_lines(shape, lines.iter().map(Vec::as_slice))
    }

    /// Rows from the lit voxels of each, in order.
    pub fn from_lines<'a>(shape: [usize; 3], lines: impl Iterator<Item = &'a [(u32, f32)]> + Clone) -> Self {
        let mut rows = Self::with_capacity(shape, lines.clone().map(<[_]>::len).sum());
        for (row, line) in lines.enumerate() {
            rows.open_row(row);
            rows.x.extend(line.iter().map(|lit| lit.0));
            rows.value.extend(line.iter().map(|lit| lit.1));
        }
        rows.open_row(shape[1] * shape[2]);
        rows
    }
}
