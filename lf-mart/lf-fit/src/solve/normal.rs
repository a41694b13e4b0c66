//! The normal equations of a group of particles: a block for each particle, and one for each two that share pixels.

use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{ParticleImage, UNKNOWNS};
use lf_core::linear::{cholesky_above, solve};
use lf_core::simd::fastest;

type Vector = [f64; UNKNOWNS];
type Matrix = [[f64; UNKNOWNS]; UNKNOWNS];
type Beside = [[f32; UNKNOWNS]; UNKNOWNS];

/// Gradient and blocks.
#[derive(Debug, Clone, Default)]
pub(crate) struct Normal {
    pub(crate) gradient: Vec<Vector>,
    diagonal: Vec<Matrix>,
    /// For each particle the later ones that share pixels with it, and their blocks: those of particle n are from
    /// `firsts[n]` up to `firsts[n + 1]`.
    firsts: Vec<usize>,
    others: Vec<u32>,
    blocks: Vec<Beside>,
}

/// When conjugate gradients end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CgLimits {
    steps: usize,
    /// Share of the first residual.
    residual: f64,
}

/// Limits for a step of particles. The block preconditioner keeps the steps few: at usual seeding, coupling between
/// particles is a few per cent.
pub(crate) const FINE: CgLimits = CgLimits { steps: 10, residual: 1e-4 };
/// For the answer of the particles to a change of the shape, with which they are closely tied.
pub(crate) const DEEP: CgLimits = CgLimits { steps: 30, residual: 1e-8 };
/// Smallest diagonal, as a share of the largest of its block: an unknown that no pixel determines stays.
const LEAST: f64 = 1e-12;
/// Hold on a particle's step, px^-2, and on that of the logarithm of its light: the inverse square of the longest steps
/// of a fit. A window shows only a sliver of some particles. Without a hold their steps have no bound, and one of them
/// spoils the step of all. A particle's own pixels usually outweigh the hold a hundred times.
const HOLD: [f64; UNKNOWNS] = [1.0, 1.0, 1.0 / 400.0, 1.0];
/// No block yet.
const NONE: u32 = u32::MAX;

/// Adds the product of a column and a row.
#[inline(always)]
fn add_product(sum: &mut Beside, column: &[f32; UNKNOWNS], row: &[f32; UNKNOWNS]) {
    for n in 0..UNKNOWNS {
        for k in 0..UNKNOWNS {
            sum[n][k] += column[n] * row[k];
        }
    }
}

#[inline(always)]
fn gradient(image: &ParticleImage, columns: usize, residual: &[f32]) -> Vector {
    let mut sum = [0f64; UNKNOWNS];
    image.lines(
        columns,
        #[inline(always)]
        |start, line| {
            for (pixel, residual) in line.iter().zip(&residual[start..start + line.len()]) {
                (0..UNKNOWNS).for_each(|k| sum[k] += f64::from(residual * pixel[k]));
            }
        },
    );
    sum
}

impl Normal {
    /// The normal equations from painted and weighted buffers.
    pub(crate) fn new<'i>(
        images: impl Iterator<Item = &'i ParticleImage> + Clone,
        columns: usize,
        buffers: &mut FitBuffers,
    ) -> Self {
        let mut normal = Self::default();
        fastest(
            #[inline(always)]
            || normal = Self::of(images, columns, buffers),
        );
        normal
    }

    #[inline(always)]
    fn of<'i>(
        images: impl Iterator<Item = &'i ParticleImage> + Clone,
        columns: usize,
        buffers: &mut FitBuffers,
    ) -> Self {
        let FitBuffers { entries, weight, residual, touched, counts, slots, .. } = buffers;
        entries.fill(images.clone(), columns, counts, touched);
        slots.clear();
        slots.resize(images.clone().count(), NONE);
        let mut normal = Self { firsts: vec![0], ..Self::default() };
        let Self { others, blocks, firsts, gradient: gradients, diagonal } = &mut normal;
        for (owner, image) in images.enumerate() {
            let owner = owner as u32;
            let mut block = Beside::default();
            image.pixels(
                columns,
                #[inline(always)]
                |n, _| {
                    let Some(rest) = entries.take(n, owner) else { return };
                    let weight = weight[n];
                    let [x, y, z, light] = rest.by;
                    let weighed = [weight * x, weight * y, weight * z, weight * light];
                    add_product(&mut block, &weighed, &rest.by);
                    for (other, by) in rest.owners.iter().zip(rest.others) {
                        let slot = &mut slots[*other as usize];
                        if *slot == NONE {
                            *slot = blocks.len() as u32;
                            others.push(*other);
                            blocks.push(Beside::default());
                        }
                        add_product(&mut blocks[*slot as usize], &weighed, by);
                    }
                },
            );
            let first = firsts[owner as usize];
            others[first..].iter().for_each(|other| slots[*other as usize] = NONE);
            firsts.push(others.len());
            gradients.push(gradient(image, columns, residual));
            diagonal.push(block.map(|row| row.map(f64::from)));
        }
        normal
    }

    /// Takes the gradient of other buffers; the blocks stay.
    pub(crate) fn set_gradient<'i>(
        &mut self,
        images: impl Iterator<Item = &'i ParticleImage>,
        columns: usize,
        buffers: &FitBuffers,
    ) {
        fastest(
            #[inline(always)]
            || self.gradient = images.map(|image| gradient(image, columns, &buffers.residual)).collect(),
        );
    }

    /// The rows and columns of some particles, dense, in their order.
    pub(crate) fn dense(&self, chosen: &[usize]) -> Vec<f64> {
        let size = UNKNOWNS * chosen.len();
        let mut matrix = vec![0.0; size * size];
        for (i, &a) in chosen.iter().enumerate() {
            for (j, &b) in chosen.iter().enumerate().skip(i) {
                let block = self.block(a, b);
                for (row, line) in block.iter().enumerate() {
                    for (column, value) in line.iter().enumerate() {
                        let (row, column) = (i * UNKNOWNS + row, j * UNKNOWNS + column);
                        matrix[row * size + column] = *value;
                        matrix[column * size + row] = *value;
                    }
                }
            }
        }
        matrix
    }

    /// The block in the rows of one particle and the columns of another.
    fn block(&self, a: usize, b: usize) -> Matrix {
        let find = |a: usize, b: usize| {
            let [first, end] = [self.firsts[a], self.firsts[a + 1]];
            (first..end).find(|n| self.others[*n] as usize == b).map(|n| self.blocks[n])
        };
        if a == b {
            self.diagonal[a]
        } else if a < b {
            find(a, b).map_or(Matrix::default(), |block| block.map(|row| row.map(f64::from)))
        } else {
            let turned = self.block(b, a);
            std::array::from_fn(|row| std::array::from_fn(|column| turned[column][row]))
        }
    }

    /// `J' W J direction`.
    #[inline(always)]
    fn product(&self, direction: &[Vector]) -> Vec<Vector> {
        let mut turned = vec![[0f64; UNKNOWNS]; direction.len()];
        for (a, block) in self.diagonal.iter().enumerate() {
            let mut own = turned[a];
            for row in 0..UNKNOWNS {
                for column in 0..UNKNOWNS {
                    own[row] += block[column][row] * direction[a][column];
                }
            }
            let beside = self.firsts[a]..self.firsts[a + 1];
            for (b, block) in self.others[beside.clone()].iter().zip(&self.blocks[beside]) {
                let b = *b as usize;
                let mut across = turned[b];
                for row in 0..UNKNOWNS {
                    let line: Vector = [0, 1, 2, 3].map(|column| f64::from(block[row][column]));
                    let ahead = direction[a][row];
                    for column in 0..UNKNOWNS {
                        across[column] += line[column] * ahead;
                    }
                    own[row] += (line[0] * direction[b][0] + line[1] * direction[b][1])
                        + (line[2] * direction[b][2] + line[3] * direction[b][3]);
                }
                turned[b] = across;
            }
            turned[a] = own;
        }
        turned
    }

    /// The damping and the hold, which a step adds to the diagonal.
    fn damped(&self, damping: f64) -> Vec<Vector> {
        let more = |block: &Matrix| {
            let most = (0..UNKNOWNS).fold(0f64, |most, n| most.max(block[n][n]));
            std::array::from_fn(|n| damping * block[n][n] + LEAST * most + HOLD[n])
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
        solve(factor, &mut vector);
        vector
    };
    right.iter().zip(factors).map(solved).collect()
}

/// The lower triangle L of `matrix = L L'`; pivots are held above `least` of the matrix's diagonal.
pub(crate) fn cholesky(matrix: &mut [f64], size: usize) {
    cholesky_above(matrix, size, |_, own| (LEAST * own).max(f64::MIN_POSITIVE));
}

pub(crate) fn dot(a: &[Vector], b: &[Vector]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()).sum()
}

/// The step that solves `(F + damping diag F + hold) step = right`, by conjugate gradients. The diagonal blocks are the
/// preconditioner.
pub(crate) fn conjugate_gradients(normal: &Normal, right: &[Vector], damping: f64, limits: CgLimits) -> Vec<Vector> {
    let mut step = Vec::new();
    fastest(
        #[inline(always)]
        || step = descend(normal, right, damping, limits),
    );
    step
}

#[inline(always)]
fn descend(normal: &Normal, right: &[Vector], damping: f64, limits: CgLimits) -> Vec<Vector> {
    let damped = normal.damped(damping);
    let factors = normal.factors(&damped);
    let precondition = |residual: &[Vector]| solve_blocks(&factors, residual);
    let mut step = vec![[0.0; UNKNOWNS]; right.len()];
    let mut residual = right.to_vec();
    let mut ahead = precondition(&residual);
    let mut direction = ahead.clone();
    let first = dot(&residual, &ahead);
    let mut size = first;
    if right.len() == 1 {
        return ahead;
    }
    for _ in 0..limits.steps {
        if size <= limits.residual * first || !size.is_normal() {
            break;
        }
        let mut turned = normal.product(&direction);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Three particles, one of which lights a pixel through two lenslets: the blocks are `J' W J`.
    #[test]
    fn blocks_are_the_products_of_the_derivatives() {
        let pixel = |seed: usize| std::array::from_fn(|k| ((seed * 7 + k * 5) % 11) as f32 - 5.0);
        let line = |start: usize, count: usize, seed: usize| (start, (0..count).map(|n| pixel(seed + n)).collect());
        let images = [
            ParticleImage::by_hand(&[line(0, 3, 1), line(2, 2, 9)]),
            ParticleImage::by_hand(&[line(1, 3, 4)]),
            ParticleImage::by_hand(&[line(3, 1, 20), line(6, 2, 30)]),
        ];
        let mut buffers = FitBuffers::default();
        buffers.fit(8);
        buffers.paint(images.iter(), 8);
        let weight = |n: usize| 0.5 + n as f32;
        for n in 0..8 {
            (buffers.weight[n], buffers.residual[n]) = (weight(n), n as f32 - 2.0);
        }
        let normal = Normal::new(images.iter(), 8, &mut buffers);
        let mut jacobian = vec![[0f64; 12]; 8];
        for (owner, image) in images.iter().enumerate() {
            let mut add = |n: usize, by: &[f32; UNKNOWNS]| {
                (0..UNKNOWNS).for_each(|k| jacobian[n][owner * UNKNOWNS + k] += f64::from(by[k]));
            };
            image.pixels(8, &mut add);
        }
        let dense = normal.dense(&[0, 1, 2]);
        for a in 0..12 {
            let pulled: f64 = (0..8).map(|n| jacobian[n][a] * (n as f64 - 2.0)).sum();
            assert!((normal.gradient[a / UNKNOWNS][a % UNKNOWNS] - pulled).abs() < 1e-4);
            for b in 0..12 {
                let sum: f64 = (0..8).map(|n| jacobian[n][a] * jacobian[n][b] * f64::from(weight(n))).sum();
                assert!((dense[a * 12 + b] - sum).abs() < 1e-3, "{a} {b}: {} for {sum}", dense[a * 12 + b]);
            }
        }
    }

    /// By hand: two particles and their common block; conjugate gradients give the exact answer.
    #[test]
    fn a_pair_is_solved_together() {
        let unit: Matrix = std::array::from_fn(|a| std::array::from_fn(|b| if a == b { 2.0 } else { 0.0 }));
        let mut beside = Beside::default();
        beside[0][1] = 1.0;
        let normal = Normal {
            gradient: vec![[1.0, 0.0, 0.0, 0.0], [0.0; UNKNOWNS]],
            diagonal: vec![unit; 2],
            firsts: vec![0, 1, 1],
            others: vec![1],
            blocks: vec![beside],
        };
        let step = conjugate_gradients(&normal, &normal.gradient, 0.0, DEEP);
        // The hold is on the diagonal too.
        let on = 2.0 + 2.0 * LEAST + HOLD[0];
        let [own, other] = [on, -1.0].map(|value| value / (on * on - 1.0));
        assert!((step[0][0] - own).abs() < 1e-14 && (step[1][1] - other).abs() < 1e-14, "{step:?}");
        let dense = normal.dense(&[1, 0]);
        assert_eq!([dense[0], dense[8 + 4], dense[4 * 8 + 1]], [2.0, 1.0, 1.0]);
    }

    /// The window shows a whole particle, and a sliver of another that is off by three standard deviations, which are
    /// 1e4 px here. The one takes the step that its pixels ask for, the other hardly moves.
    #[test]
    fn a_sliver_does_not_run_away() {
        let unit = |size: f64| std::array::from_fn(|a| std::array::from_fn(|b| if a == b { size } else { 0.0 }));
        let normal = Normal {
            gradient: vec![[2e3; UNKNOWNS], [3e-4; UNKNOWNS]],
            diagonal: vec![unit(1e4), unit(1e-8)],
            firsts: vec![0, 0, 0],
            ..Normal::default()
        };
        let step = conjugate_gradients(&normal, &normal.gradient, 1e-6, FINE);
        assert!(step[0].iter().all(|step| (step / 0.2 - 1.0).abs() < 1e-3), "{step:?}");
        assert!(step[1].iter().zip([1.0, 1.0, 20.0, 1.0]).all(|(step, most)| step.abs() < most), "{step:?}");
    }
}
