//! The normal equations of a group of particles: blocks on the diagonal, products by way of the image.

use super::buffers::Buffers;
use super::image::{SpotImage, UNKNOWNS};

type Vector = [f64; UNKNOWNS];
type Matrix = [[f64; UNKNOWNS]; UNKNOWNS];

/// Gradient and diagonal blocks.
#[derive(Debug, Clone, Default)]
pub(super) struct Blocks {
    pub(super) gradient: Vec<Vector>,
    pub(super) diagonal: Vec<Matrix>,
}

/// Effort of conjugate gradients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    steps: usize,
    enough: f64,
}

/// Most steps of conjugate gradients, and the share of the first residual at which they end. Blocks make them quick:
/// particles of a usual density hang together by a few per cent.
pub(super) const FINE: Effort = Effort { steps: 6, enough: 1e-3 };
/// For the answer of the particles to a change of the shape, with which they are closely tied.
pub(super) const DEEP: Effort = Effort { steps: 12, enough: 1e-6 };
/// Least diagonal, as a share of the largest of its block: an unknown that no pixel tells stays.
const LEAST: f64 = 1e-12;

impl Blocks {
    /// From painted and weighed buffers.
    pub(super) fn new(images: &[SpotImage], columns: usize, buffers: &Buffers) -> Self {
        let (mut gradient, mut diagonal) = (Vec::new(), Vec::new());
        for image in images {
            let (mut pull, mut block) = ([0f64; UNKNOWNS], [[0f64; UNKNOWNS]; UNKNOWNS]);
            image.lines(columns, |start, line| {
                let range = start..start + line.len();
                let places = buffers.weight[range.clone()].iter().zip(&buffers.pull[range]);
                for (pixel, (weight, off)) in line.iter().zip(places) {
                    let pixel = pixel.map(f64::from);
                    let (weight, off) = (f64::from(*weight), f64::from(*off));
                    for a in 0..UNKNOWNS {
                        pull[a] += off * pixel[a];
                        let weighed = weight * pixel[a];
                        for b in 0..UNKNOWNS {
                            block[a][b] += weighed * pixel[b];
                        }
                    }
                }
            });
            gradient.push(pull);
            diagonal.push(block);
        }
        Self { gradient, diagonal }
    }
}

impl Blocks {
    /// The damping of the diagonal.
    fn damped(&self, damping: f64) -> Vec<Vector> {
        let more = |block: &Matrix| {
            let most = (0..UNKNOWNS).fold(0f64, |most, n| most.max(block[n][n]));
            std::array::from_fn(|n| damping * block[n][n] + LEAST * most + f64::MIN_POSITIVE)
        };
        self.diagonal.iter().map(more).collect()
    }

    /// Cholesky factors of the blocks.
    fn factors(&self, damped: &[Vector]) -> Vec<[f64; UNKNOWNS * UNKNOWNS]> {
        let factor = |(block, more): (&Matrix, &Vector)| {
            let mut matrix = [0.0; UNKNOWNS * UNKNOWNS];
            for row in 0..UNKNOWNS {
                matrix[row * UNKNOWNS..(row + 1) * UNKNOWNS].copy_from_slice(&block[row]);
                matrix[row * UNKNOWNS + row] += more[row];
            }
            cholesky(&mut matrix, UNKNOWNS);
            matrix
        };
        self.diagonal.iter().zip(damped).map(factor).collect()
    }
}

fn solve_blocks(factors: &[[f64; UNKNOWNS * UNKNOWNS]], right: &[Vector]) -> Vec<Vector> {
    let solved = |(vector, factor): (&Vector, &[f64; UNKNOWNS * UNKNOWNS])| {
        let mut vector = *vector;
        solve(factor, UNKNOWNS, &mut vector);
        vector
    };
    right.iter().zip(factors).map(solved).collect()
}

/// The lower triangle L of `matrix = L L'`; pivots are held above `least` of the matrix's diagonal.
pub(super) fn cholesky(matrix: &mut [f64], size: usize) {
    for column in 0..size {
        let own = matrix[column * size + column];
        for row in column..size {
            let mut sum = matrix[row * size + column];
            for k in 0..column {
                sum -= matrix[row * size + k] * matrix[column * size + k];
            }
            matrix[row * size + column] = if row == column {
                sum.max(LEAST * own).max(f64::MIN_POSITIVE).sqrt()
            } else {
                sum / matrix[column * size + column]
            };
        }
    }
}

/// Solves `L L' x = b` in place.
pub(super) fn solve(lower: &[f64], size: usize, b: &mut [f64]) {
    for row in 0..size {
        for k in 0..row {
            b[row] -= lower[row * size + k] * b[k];
        }
        b[row] /= lower[row * size + row];
    }
    for row in (0..size).rev() {
        for k in row + 1..size {
            b[row] -= lower[k * size + row] * b[k];
        }
        b[row] /= lower[row * size + row];
    }
}

fn dot(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()).sum()
}

/// The step that solves `(F + damping diag F) step = gradient`, by conjugate gradients with the diagonal blocks as
/// preconditioner. `buffers` is painted and weighed.
pub(super) fn conjugate_gradients(
    normal: &Blocks,
    images: &[SpotImage],
    columns: usize,
    damping: f64,
    effort: Effort,
    buffers: &mut Buffers,
) -> Vec<Vector> {
    let damped = normal.damped(damping);
    let factors = normal.factors(&damped);
    let precondition = |residual: &[Vector]| solve_blocks(&factors, residual);
    let mut step = vec![[0.0; UNKNOWNS]; images.len()];
    let mut residual = normal.gradient.clone();
    let mut ahead = precondition(&residual);
    let mut direction = ahead.clone();
    let first = dot(&residual, &ahead);
    let mut size = first;
    if images.len() == 1 {
        return ahead;
    }
    for _ in 0..effort.steps {
        if size <= effort.enough * first || !size.is_normal() {
            break;
        }
        let mut turned = product(images, columns, &direction, buffers);
        for ((turned, direction), more) in turned.iter_mut().zip(&direction).zip(&damped) {
            (0..UNKNOWNS).for_each(|n| turned[n] += more[n] * direction[n]);
        }
        let length = size / dot(&direction, &turned);
        for n in 0..step.len() {
            for k in 0..UNKNOWNS {
                step[n][k] += length * direction[n][k];
                residual[n][k] -= length * turned[n][k];
            }
        }
        ahead = precondition(&residual);
        let next = dot(&residual, &ahead);
        let keep = next / size;
        for (direction, ahead) in direction.iter_mut().zip(&ahead) {
            (0..UNKNOWNS).for_each(|k| direction[k] = ahead[k] + keep * direction[k]);
        }
        size = next;
    }
    step
}

/// `J' W J direction`.
fn product(images: &[SpotImage], columns: usize, direction: &[Vector], buffers: &mut Buffers) -> Vec<Vector> {
    let Buffers { lane, weight, touched, .. } = buffers;
    for (image, along) in images.iter().zip(direction) {
        let along = along.map(|value| value as f32);
        image.lines(columns, |start, line| {
            for (lane, pixel) in lane[start..start + line.len()].iter_mut().zip(line) {
                *lane += (pixel[0] * along[0] + pixel[1] * along[1]) + (pixel[2] * along[2] + pixel[3] * along[3]);
            }
        });
    }
    touched.iter().for_each(|n| lane[*n as usize] *= weight[*n as usize]);
    let turned = images
        .iter()
        .map(|image| {
            let mut sum = [0f32; UNKNOWNS];
            image.lines(columns, |start, line| {
                for (lane, pixel) in lane[start..start + line.len()].iter().zip(line) {
                    for k in 0..UNKNOWNS {
                        sum[k] += lane * pixel[k];
                    }
                }
            });
            sum.map(f64::from)
        })
        .collect();
    touched.iter().for_each(|n| lane[*n as usize] = 0.0);
    turned
}
