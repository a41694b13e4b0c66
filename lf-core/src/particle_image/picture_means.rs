//! Means of a cell over the pixels of a lenslet, with their slopes and curvatures, from a particle's picture.

use super::pictures::{LANES, PHASES, Picture};
use super::spline::Stencil;
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
