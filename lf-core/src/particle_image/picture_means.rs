//! Means of a cell over the pixels of a lenslet, with their slopes and curvatures, from a particle's picture.

use super::pictures::{LANES, PHASES, Picture};
use super::spline::{Stencil, quick_stencil};
use super::spots::Spots;
use crate::simd::fastest;

/// Numbers of a mean: level, slopes along x and y, and curvatures xx, xy and yy.
pub(super) const NUMBERS: usize = 6;
/// The orders along x and y of each.
pub(super) const ORDERS: [[usize; 2]; NUMBERS] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

/// A particle's picture, and the means of the last lenslet's pixels.
#[derive(Debug, Default)]
pub(super) struct PictureMeans {
    pub(super) picture: Picture,
    /// Its scale, and that of the lenslet in the middle of the particle's light; 0 for none.
    pub(super) scale: f64,
    pub(super) middle: f64,
    /// For each pixel, the numbers of its mean, and its place from the picture's middle along x and y.
    pub(super) means: [Vec<f32>; NUMBERS],
    pub(super) places: [Vec<f32>; 2],
}

impl Picture {
    /// Fills the means at the hits of spots on the array, and their slopes and curvatures there. The picture's scale is
    /// in px a mm.
    pub(super) fn fill_means(&self, scale: f32, spots: &mut Spots) {
        let count = spots.room();
        let Spots { hit: [x, y], means, .. } = spots;
        let per_mm = scale * PHASES as f32;
        let width = self.half.map(|half| 2 * half);
        let nodes = |hit: f32, axis: usize| {
            let last = (width[axis] * PHASES - 3) as f32;
            quick_stencil(hit * per_mm + (self.half[axis] * PHASES) as f32, last)
        };
        for n in 0..count {
            let (column, level_x, slope_x, curve_x) = nodes(x[n], 0);
            let (row, level_y, slope_y, curve_y) = nodes(y[n], 1);
            let (across, down) = ([level_x, slope_x, curve_x], [level_y, slope_y, curve_y]);
            let mut sums = [0f32; NUMBERS];
            for j in 0..4 {
                let mut lines = [0f32; 3];
                for i in 0..4 {
                    let node = self.values[self.index(column + i, row + j)];
                    lines.iter_mut().zip(&across).for_each(|(sum, weights)| *sum += weights[i] * node);
                }
                for (sum, [along_x, along_y]) in sums.iter_mut().zip(ORDERS) {
                    *sum += down[along_y][j] * lines[along_x];
                }
            }
            for ((list, sum), [along_x, along_y]) in means.iter_mut().zip(sums).zip(ORDERS) {
                list[n] = sum * per_mm.powi((along_x + along_y) as i32);
            }
        }
    }

    /// Where the node of this column and row is kept.
    #[inline(always)]
    fn index(&self, column: usize, row: usize) -> usize {
        let plane = (row % PHASES) * PHASES + column % PHASES;
        (plane * 2 * self.half[1] + row / PHASES) * 2 * self.half[0] + column / PHASES
    }
}

impl PictureMeans {
    /// Forgets the picture of the particle before.
    pub(super) fn begin(&mut self, middle: f64) {
        (self.scale, self.middle) = (0.0, middle);
    }

    /// Reads the first K numbers of the means of pixels, whose first one lies `first` px from the picture's middle.
    #[inline(never)]
    pub(super) fn read<const K: usize>(&mut self, first: [f64; 2], size: [usize; 2]) {
        fastest(
            #[inline(always)]
            || self.read_all::<K>(first, size),
        );
    }

    #[inline(always)]
    fn read_all<const K: usize>(&mut self, first: [f64; 2], [columns, rows]: [usize; 2]) {
        let Self { picture: Picture { half, values }, means, places, .. } = self;
        let width = [2 * half[0], 2 * half[1]];
        let stencil = |axis: usize| {
            let place = (first[axis] + half[axis] as f64) * PHASES as f64;
            Stencil::new(place, PHASES as f64, width[axis] * PHASES)
        };
        let (x, y) = (stencil(0), stencil(1));
        let weights = |stencil: &Stencil| stencil.weights.map(|weights| weights.map(|weight| weight as f32));
        let (across, down) = (weights(&x), weights(&y));
        // Rows of the picture that the first row of pixels reads, for the nodes along y and x.
        let start = |j: usize, i: usize| {
            let (at_y, at_x) = (y.first + j, x.first + i);
            let plane = (at_y % PHASES) * PHASES + at_x % PHASES;
            (plane * width[1] + at_y / PHASES) * width[0] + at_x / PHASES
        };
        let starts: [[usize; 4]; 4] = std::array::from_fn(|j| std::array::from_fn(|i| start(j, i)));
        let room = columns * rows + LANES;
        means[..K].iter_mut().for_each(|numbers| numbers.resize(room, 0.0));
        places.iter_mut().for_each(|places| places.resize(room, 0.0));
        for row in 0..rows {
            for column in (0..columns).step_by(LANES) {
                let mut sums = [[0f32; LANES]; K];
                for j in 0..4 {
                    let mut lines = [[0f32; LANES]; 3];
                    for i in 0..4 {
                        let at = starts[j][i] + row * width[0] + column;
                        let nodes: &[f32; LANES] = values[at..at + LANES].try_into().expect("eight nodes");
                        for order in 0..if K > 1 { 3 } else { 1 } {
                            for k in 0..LANES {
                                lines[order][k] += across[order][i] * nodes[k];
                            }
                        }
                    }
                    for (sum, [along_x, along_y]) in sums.iter_mut().zip(ORDERS) {
                        for k in 0..LANES {
                            sum[k] += down[along_y][j] * lines[along_x][k];
                        }
                    }
                }
                // Lanes beyond the row are overwritten by the next one.
                let at = row * columns + column;
                for (numbers, sum) in means.iter_mut().zip(&sums) {
                    numbers[at..at + LANES].copy_from_slice(sum);
                }
                for k in 0..LANES {
                    places[0][at + k] = first[0] as f32 + (column + k) as f32;
                    places[1][at + k] = first[1] as f32 + row as f32;
                }
            }
        }
    }
}
