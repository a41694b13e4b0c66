//! From the strengths of voxels or blobs to intensities.

use lf_core::{Grid, io};
use rayon::prelude::*;
use std::ops::Range;

/// A blob ends this many standard deviations from its centre. The light left out, 3e-3, is given to the rest.
const REACH_SIGMA: f64 = 3.0;

/// The brightest of the voxels within `core_vox`, `[from, to)` along x and y; 0 if there are no such voxels.
fn brightest<'a>(grid: &Grid, voxels: impl Iterator<Item = (&'a u64, &'a f32)>, core_vox: [[usize; 2]; 2]) -> f32 {
    let [[x0, x1], [y0, y1]] = core_vox;
    let in_core = |[x, y, _]: [usize; 3]| (x0..x1).contains(&x) && (y0..y1).contains(&y);
    voxels.filter(|(index, _)| in_core(grid.voxel(**index))).fold(0f32, |peak, (_, value)| peak.max(*value))
}

/// The voxels above `least_share` of the brightest within `core_vox`, unchanged.
pub(crate) fn lit(
    grid: &Grid,
    indices: &[u64],
    strengths: &[f32],
    least_share: f32,
    core_vox: [[usize; 2]; 2],
) -> (Vec<u64>, Vec<f32>) {
    let least = least_share * brightest(grid, indices.iter().zip(strengths), core_vox);
    indices.iter().zip(strengths).filter(|(_, s)| **s > least).map(|(index, s)| (*index, *s)).unzip()
}

/// Samples of a Gaussian of `sigma_vox` voxels, from its centre's left to its right; they sum to 1.
fn bell(sigma_vox: f64) -> Vec<f32> {
    let reach = (REACH_SIGMA * sigma_vox).ceil() as i64;
    let bell: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma_vox).powi(2)).exp()).collect();
    let sum: f64 = bell.iter().sum();
    bell.iter().map(|b| (b / sum) as f32).collect()
}

/// The places of `0..size` that a bell about `place` reaches, each with its share.
#[inline]
fn reached(bell: &[f32], place: usize, size: usize) -> impl Iterator<Item = (usize, f32)> {
    let reach = bell.len() / 2;
    let first = place.saturating_sub(reach);
    let shares = &bell[first + reach - place..];
    (first..size).zip(shares.iter().copied())
}

/// Slices whose reached voxels are counted to estimate those of all.
const SAMPLE_SLICES: usize = 8;

/// Times that freed lists are given back to the system while the result grows.
const RELEASES: usize = 8;

/// A peak is this share or more of its brightest blob's own light: less than 1 by the rounding of a few products.
const OWN_LIGHT: f32 = 0.999;

/// Blobs on a grid, line by line.
struct Blobs<'a> {
    grid: &'a Grid,
    indices: &'a [u64],
    /// Samples of a blob along x, y and z.
    bells: [Vec<f32>; 3],
    /// The number, y + ny z, of each line that holds blobs, and its first blob; then the end.
    lines: Vec<(u64, usize)>,
}

/// Sums of a row of voxels while they are added up.
#[derive(Default)]
struct Row {
    sums: Vec<f32>,
    touched: Vec<usize>,
}

impl Row {
    #[inline]
    fn add(&mut self, x: usize, light: f32, bell: &[f32]) {
        for (column, share) in reached(bell, x, self.sums.len()) {
            if self.sums[column] == 0.0 {
                self.touched.push(column);
            }
            self.sums[column] += light * share;
        }
    }

    /// Passes on the sums by rising column, and is dark again.
    fn take(&mut self, mut found: impl FnMut(usize, f32)) {
        self.touched.sort_unstable();
        self.touched.dedup();
        for column in self.touched.drain(..) {
            found(column, std::mem::take(&mut self.sums[column]));
        }
    }
}

impl<'a> Blobs<'a> {
    fn new(grid: &'a Grid, indices: &'a [u64], sigma_vox: [f64; 3]) -> Self {
        let nx = grid.shape[0] as u64;
        let starts = indices.chunk_by(|a, b| a / nx == b / nx).scan(0, |next, line| {
            *next += line.len();
            Some((line[0] / nx, *next - line.len()))
        });
        let lines = starts.chain([(u64::MAX, indices.len())]).collect();
        Self { grid, indices, bells: sigma_vox.map(bell), lines }
    }

    /// The lines of a slice that hold blobs, as places in the list of lines.
    fn lines_of(&self, z: usize) -> Range<usize> {
        let ny = self.grid.shape[1] as u64;
        let [start, end] = [z, z + 1].map(|z| self.lines.partition_point(|(line, _)| *line < z as u64 * ny));
        start..end
    }

    /// The slices that blobs reach, rising.
    fn slices(&self) -> Vec<usize> {
        let [_, ny, nz] = self.grid.shape;
        let (reach, mut slices) = (self.bells[2].len() / 2, Vec::new());
        for (line, _) in &self.lines[..self.lines.len() - 1] {
            let source = (line / ny as u64) as usize;
            let next = slices.last().map_or(0, |last| last + 1);
            slices.extend(source.saturating_sub(reach).max(next)..(source + reach + 1).min(nz));
        }
        slices
    }

    /// Adds up the light of all blobs in slice `z`, row by row. Calls `found(x, y, light)`: the rows rise, and so do
    /// the columns of each. The light of a voxel is summed in the order of the blobs.
    fn slice(
        &self,
        z: usize,
        row: &mut Row,
        strength: impl Fn(usize) -> f32,
        mut found: impl FnMut(usize, usize, f32),
    ) {
        let [nx, ny, nz] = self.grid.shape;
        let [across, down, deep] = &self.bells;
        let reach = down.len() / 2;
        let y_of = |line: usize| (self.lines[line].0 % ny as u64) as usize;
        // Find the slices whose blobs reach this one, and the rows that they reach.
        let mut sources: Vec<(Range<usize>, f32)> =
            reached(deep, z, nz).map(|(source, share)| (self.lines_of(source), share)).collect();
        let lines = sources.iter().flat_map(|(lines, _)| lines.clone());
        let mut rows: Vec<usize> = lines.flat_map(|line| reached(down, y_of(line), ny).map(|(y, _)| y)).collect();
        rows.sort_unstable();
        rows.dedup();
        // Sum row after row over the lines of blobs that reach it.
        row.sums.resize(nx, 0.0);
        for y in rows {
            for (lines, depth) in &mut sources {
                lines.start = lines.clone().find(|line| y_of(*line) + reach >= y).unwrap_or(lines.end);
                for line in lines.clone().take_while(|line| y_of(*line) <= y + reach) {
                    let share = down[y + reach - y_of(line)];
                    for n in self.lines[line].1..self.lines[line + 1].1 {
                        row.add((self.indices[n] % nx as u64) as usize, strength(n) * *depth * share, across);
                    }
                }
            }
            row.take(|x, light| found(x, y, light));
        }
    }
}

/// Estimates the largest number of bytes that [`spread`] takes beside its input, from a few slices.
pub(crate) fn estimated_bytes(grid: &Grid, indices: &[u64], sigma_vox: [f64; 3]) -> f64 {
    let blobs = Blobs::new(grid, indices, sigma_vox);
    let slices = blobs.slices();
    let step = slices.len().div_ceil(SAMPLE_SLICES).max(1);
    let sample: Vec<usize> = slices.iter().skip(step / 2).step_by(step).copied().collect();
    let count = |row: &mut Row, z: &usize| {
        let mut count = 0;
        blobs.slice(*z, row, |_| 1.0, |_, _, _| count += 1);
        count
    };
    let counted: usize = sample.par_iter().map_init(Row::default, count).sum();
    let voxels = counted as f64 / sample.len().max(1) as f64 * slices.len() as f64;
    let rows = size_of::<f32>() * grid.shape[0] * rayon::current_num_threads().min(slices.len());
    // Lists of lines and slices, the rows of the threads, and each voxel's index and light.
    (16 * blobs.lines.len() + 64 * slices.len() + rows) as f64 + 12.0 * voxels
}

/// Strengths convolved with a Gaussian of `sigma_vox` voxels along x, y and z; its samples sum to 1. Gives the voxels
/// above `least_share` of the brightest within `core_vox`: rising, and the same for any number of threads.
pub(crate) fn spread(
    grid: &Grid,
    indices: &[u64],
    strengths: &[f32],
    sigma_vox: [f64; 3],
    least_share: f32,
    core_vox: [[usize; 2]; 2],
) -> (Vec<u64>, Vec<f32>) {
    let (indices, strengths) = lit(grid, indices, strengths, 1e-2 * least_share, core_vox);
    let blobs = Blobs::new(grid, &indices, sigma_vox);
    // The brightest is no darker than the light of the strongest blob at its own voxel.
    let own = blobs.bells.iter().map(|bell| bell[bell.len() / 2]).product::<f32>() * OWN_LIGHT;
    let sure_peak = own * brightest(grid, indices.iter().zip(&strengths), core_vox);
    let [nx, ny, _] = grid.shape.map(|count| count as u64);
    let blurred = |row: &mut Row, z: &usize| -> (Vec<u64>, Vec<f32>) {
        let (mut indices, mut lights) = (Vec::new(), Vec::new());
        blobs.slice(
            *z,
            row,
            |n| strengths[n],
            |x, y, light| {
                if light > least_share * sure_peak {
                    indices.push(x as u64 + nx * (y as u64 + ny * *z as u64));
                    lights.push(light);
                }
            },
        );
        (indices, lights)
    };
    // Blur slice after slice, and keep what may be above the limit.
    let slices: Vec<(Vec<u64>, Vec<f32>)> = blobs.slices().par_iter().map_init(Row::default, blurred).collect();
    let peak = slices
        .iter()
        .map(|(indices, lights)| brightest(grid, indices.iter().zip(lights), core_vox))
        .fold(0f32, f32::max);
    // Join the slices without the voxels below the limit, and free each as it is joined.
    let (count, mut freed) = (slices.iter().map(|(indices, _)| indices.len()).sum::<usize>(), 0);
    let (mut indices, mut lights) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for (in_slice, light_of) in slices {
        let voxels = in_slice.iter().zip(&light_of).filter(|(_, light)| **light > least_share * peak);
        for (index, light) in voxels {
            indices.push(*index);
            lights.push(*light);
        }
        freed += in_slice.len();
        drop((in_slice, light_of));
        if freed > count / RELEASES {
            freed = 0;
            io::release_memory();
        }
    }
    (indices, lights)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One blob of strength 8 and sigma 1. By hand its centre is 8 / (sum of exp(-i^2/2), |i| <= 3)^3.
    #[test]
    fn one_blob_by_hand() {
        let grid = Grid { shape: [9, 9, 9], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let (indices, values) = spread(&grid, &[grid.index([4, 4, 4])], &[8.0], [1.0; 3], 0.0, [[0, 9], [0, 9]]);
        let side = 1.0 + 2.0 * ((-0.5f64).exp() + (-2.0f64).exp() + (-4.5f64).exp());
        let centre = indices.iter().position(|index| *index == grid.index([4, 4, 4])).unwrap();
        assert!((f64::from(values[centre]) - 8.0 / side.powi(3)).abs() < 1e-5);
        assert_eq!(indices.len(), 343);
        assert!((values.iter().sum::<f32>() - 8.0).abs() < 1e-4);
        assert!(indices.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn blobs_at_the_edge_are_cut_and_neighbours_add() {
        let grid = Grid { shape: [3, 3, 3], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let (indices, values) = spread(&grid, &[0, 1], &[1.0, 1.0], [0.5; 3], 0.0, [[0, 3], [0, 3]]);
        assert!(indices.len() <= 27 && values.iter().all(|v| *v > 0.0));
        assert_eq!(values[0], values[1]);
    }

    /// The sum over all blobs for each voxel, in the order of the blobs.
    #[test]
    fn rows_add_up_to_the_sums_of_every_blob() {
        let grid = Grid { shape: [23, 17, 11], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let indices: Vec<u64> = (0..grid.len()).filter(|n| n * n % 61 == 4 || n % 97 == 3).collect();
        let strengths: Vec<f32> = indices.iter().map(|n| 0.25 + (n % 13) as f32).collect();
        for sigma in [[0.65; 3], [1.3, 0.4, 2.1], [0.05; 3]] {
            let bells = sigma.map(bell);
            let mut all = vec![0f32; grid.len() as usize];
            for (index, strength) in indices.iter().zip(&strengths) {
                let [x, y, z] = grid.voxel(*index);
                for (slice, deep) in reached(&bells[2], z, 11) {
                    for (row, down) in reached(&bells[1], y, 17) {
                        for (column, across) in reached(&bells[0], x, 23) {
                            all[grid.index([column, row, slice]) as usize] += strength * deep * down * across;
                        }
                    }
                }
            }
            let core = [[3, 20], [0, 17]];
            let peak = brightest(&grid, (0..grid.len()).collect::<Vec<u64>>().iter().zip(&all), core);
            let wanted: Vec<(u64, f32)> = (0..grid.len()).zip(all).filter(|(_, light)| *light > 1e-3 * peak).collect();
            let (found, lights) = spread(&grid, &indices, &strengths, sigma, 1e-3, core);
            assert_eq!(found.into_iter().zip(lights).collect::<Vec<_>>(), wanted, "{sigma:?}");
        }
    }

    /// Scar: every worker held a whole slice, and every slice of the grid had a list.
    #[test]
    fn far_voxels_of_a_huge_grid_take_little_memory() {
        let grid = Grid { shape: [1000, 1 << 25, 1 << 25], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let indices = [grid.index([3, 5, 7]), grid.index([999, (1 << 25) - 1, (1 << 25) - 1])];
        let (found, _) = spread(&grid, &indices, &[1.0; 2], [0.65; 3], 1e-4, [[0, 1000], [0, 1 << 25]]);
        // By hand: places two off along one axis at most are above 1e-4 of the peak: 27 + 3 * 2 * 9, in a corner 8 + 3
        // * 4.
        assert!(found.len() == 81 + 20 && found.is_sorted(), "{}", found.len());
        assert!(estimated_bytes(&grid, &indices, [0.65; 3]) < 1e5);
    }
}
