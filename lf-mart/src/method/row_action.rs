//! The paper's MART (eq. 1), pixel after pixel:
//!
//! ```text
//! E_j <- E_j (I_i / sum_j w_ij E_j)^(mu w_ij)
//! ```
//!
//! The result depends on the order of the pixels, which the paper does not give. Here it is the order of the image:
//! rows from the top, each from the left. The method needs the weights pixel by pixel, so they are stored.

use super::problem::{DARK, GREATEST_STRENGTH, Misfit, Problem, Solved, change};
use crate::{operator::count_weights, reconstruction::Sweep};
use lf_core::weights::{Aligned, Path, Piece, Scratch};
use lf_core::{Refusal, Weights};
use rayon::prelude::*;

/// A voxel and its weight on a pixel.
#[derive(Clone, Copy)]
struct Weight {
    voxel: u32,
    weight: f32,
}

/// Strengths below this become 0. Voxels fade for ever, and their light becomes denormal numbers, which took most of
/// the time of hundreds of sweeps.
const LEAST_STRENGTH: f32 = 1e-25;

/// Voxels whose weights are made at once, to be stored in their order.
const RUN: usize = 1 << 12;

const WEIGHT_BYTES: u64 = size_of::<Weight>() as u64;

/// Bytes of the stored weights and of those being made, from a sample of the voxels.
pub(crate) fn weight_bytes(weights: &Weights, indices: &[u64]) -> u64 {
    let stored = count_weights(weights, indices);
    let run = stored as f64 / indices.len().max(1) as f64 * RUN as f64;
    (stored + 2 * run as u64) * WEIGHT_BYTES
}

#[derive(Default)]
struct ProductBuffers {
    scratch: Scratch,
    pieces: Vec<Piece>,
    columns: Vec<(u32, f32)>,
    rows: Vec<(u32, f32)>,
    shares: Vec<f32>,
}

/// The weights of a voxel, each pixel once, by rising pixel: `row * width + column`.
fn voxel_weights(weights: &Weights, index: u64, buffers: &mut ProductBuffers) -> Vec<(u32, f32)> {
    match &weights.path {
        Path::Aligned(aligned) if !aligned.has_round_stop() => products(aligned, index, buffers),
        _ => merged(weights, index, &mut buffers.scratch),
    }
}

/// Behind a square stop the weights of an aligned camera are the products of a voxel's column shares with its row
/// shares, each summed over the lenslets.
fn products(aligned: &Aligned, index: u64, buffers: &mut ProductBuffers) -> Vec<(u32, f32)> {
    let [x, y, z] = aligned.grid().voxel(index);
    let [width, _] = aligned.sensor_px();
    let ProductBuffers { pieces, columns, rows, shares, .. } = buffers;
    pieces.clear();
    aligned.columns(x, z, pieces);
    summed(pieces, columns);
    pieces.clear();
    aligned.rows(y, z, pieces);
    summed(pieces, rows);
    // Keep shares apart from pixels: multiplied in pairs, the pixels' bits would be denormal numbers, 30 times slower.
    let scale = aligned.scale();
    shares.clear();
    shares.extend(columns.iter().map(|(_, share)| scale * share));
    let mut weights = Vec::with_capacity(columns.len() * rows.len());
    for (row, row_share) in rows {
        let first = *row * width as u32;
        weights.extend(columns.iter().zip(&*shares).map(|((column, _), share)| (first + column, *row_share * *share)));
    }
    weights
}

/// Shares by rising pixel, each pixel once.
fn summed(pieces: &[Piece], out: &mut Vec<(u32, f32)>) {
    out.clear();
    out.extend(pieces.iter().map(|piece| (piece.pixel, piece.weight)));
    sum_equal(out);
}

/// The weights of a voxel of any camera, by a sort.
fn merged(weights: &Weights, index: u64, scratch: &mut Scratch) -> Vec<(u32, f32)> {
    let width = weights.sensor_px()[0] as u32;
    let mut found: Vec<(u32, f32)> = Vec::new();
    let add = |column, row, weight| found.push((row * width + column, weight));
    weights.visit(weights.grid().voxel(index), scratch, |_| true, add);
    sum_equal(&mut found);
    found
}

/// Sorts by pixel, and adds the weights of equal pixels.
fn sum_equal(weights: &mut Vec<(u32, f32)>) {
    weights.sort_unstable_by_key(|(pixel, _)| *pixel);
    weights.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
}

/// All weights, pixel by pixel.
struct PixelWeights {
    /// Weights on pixel i are `weights[starts[i]..starts[i + 1]]`.
    starts: Vec<u64>,
    weights: Vec<Weight>,
    /// Whether any pixel sees the voxel.
    seen: Vec<bool>,
}

impl PixelWeights {
    fn new(problem: &Problem) -> Result<Self, Refusal> {
        let pixels = problem.image.len();
        let mut starts = vec![0u64; pixels + 1];
        let mut seen = vec![false; problem.indices.len()];
        // Count the weights on each pixel.
        for_each_voxel(problem, |voxel, weights| {
            seen[voxel] = !weights.is_empty();
            weights.iter().for_each(|(pixel, _)| starts[*pixel as usize + 1] += 1);
        });
        for pixel in 0..pixels {
            starts[pixel + 1] += starts[pixel];
        }
        let (count, most_bytes) = (starts[pixels], problem.options.max_bytes);
        if count * WEIGHT_BYTES > most_bytes {
            let [bytes, most] = [count * WEIGHT_BYTES, most_bytes].map(|bytes| bytes as f64 * 1e-9);
            let found = format!("{count} weights of {WEIGHT_BYTES} bytes take {bytes:.1} GB");
            return Err(Refusal::new(found, format!("wanted {most} GB at most, as --max-memory allows")));
        }
        // Make them again, and store each behind the ones of its pixel.
        let mut next = starts.clone();
        let mut weights = vec![Weight { voxel: 0, weight: 0.0 }; count as usize];
        for_each_voxel(problem, |voxel, of_voxel| {
            for (pixel, weight) in of_voxel {
                let place = &mut next[pixel as usize];
                weights[*place as usize] = Weight { voxel: voxel as u32, weight };
                *place += 1;
            }
        });
        Ok(Self { starts, weights, seen })
    }

    fn sweep(&self, problem: &Problem, strengths: &mut [f32]) -> Misfit {
        let options = problem.options;
        let (relaxation, greatest) = (options.relaxation as f32, options.clamp.ln() as f32);
        let mut misfit = Misfit::default();
        for (pixel, measured) in problem.image.iter().enumerate() {
            let weights = &self.weights[self.starts[pixel] as usize..self.starts[pixel + 1] as usize];
            if weights.is_empty() || measured.is_nan() {
                continue;
            }
            // Project onto the pixel.
            let projected: f32 = weights.iter().map(|w| w.weight * strengths[w.voxel as usize]).sum();
            misfit.add_pixel(*measured, projected);
            // Move the strengths of its voxels.
            let ratio = relaxation * (measured.max(DARK) / projected.max(DARK)).ln();
            for w in weights {
                let strength = &mut strengths[w.voxel as usize];
                let factor = (ratio * w.weight).clamp(-greatest, greatest).exp();
                let next = (*strength * factor).min(GREATEST_STRENGTH);
                *strength = if next < LEAST_STRENGTH { 0.0 } else { next };
            }
        }
        misfit
    }
}

/// Calls `take(voxel, weights)` for the voxels in their order; the weights are made by all threads.
fn for_each_voxel(problem: &Problem, mut take: impl FnMut(usize, Vec<(u32, f32)>)) {
    for (run, indices) in problem.indices.chunks(RUN).enumerate() {
        let made: Vec<Vec<(u32, f32)>> = indices
            .par_iter()
            .map_init(ProductBuffers::default, |buffers, index| voxel_weights(problem.weights, *index, buffers))
            .collect();
        for (n, weights) in made.into_iter().enumerate() {
            take(run * RUN + n, weights);
        }
    }
}

pub(crate) fn solve(problem: &Problem, mut done: impl FnMut(&Sweep)) -> Result<Solved, Refusal> {
    let stored = PixelWeights::new(problem)?;
    let mut strengths = problem.first_strengths();
    strengths.iter_mut().zip(&stored.seen).filter(|(_, seen)| !**seen).for_each(|(strength, _)| *strength = 0.0);
    let (voxels, weights) = (problem.indices.len(), 2 * stored.weights.len() as u64);
    let mut sweeps: Vec<Sweep> = Vec::new();
    for number in 1..=problem.options.iterations {
        let before = strengths.clone();
        let misfit = stored.sweep(problem, &mut strengths);
        let change = change(&before, &strengths);
        let sweep = Sweep { number, misfit: misfit.value(), change, voxels, weights };
        done(&sweep);
        sweeps.push(sweep);
        if problem.is_done(&sweeps, &misfit) {
            break;
        }
    }
    let is_unseen = |(index, seen): (&u64, &bool)| (!seen).then_some(*index);
    let unseen = problem.indices.iter().zip(&stored.seen).filter_map(is_unseen).collect();
    Ok(Solved { indices: problem.indices.to_vec(), strengths, sweeps, unseen })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{cameras, grid, voxels};
    use lf_core::weights::{Basis, Model};

    #[test]
    fn products_are_the_weights() {
        let (camera, grid) = (&cameras()[0], grid());
        for (model, basis) in [
            (Model::Drt { sections: None }, Basis::Point),
            (Model::Drt { sections: Some(3) }, Basis::Point),
            (Model::Exact, Basis::Blob { sigma_px: 0.65 }),
        ] {
            let weights = Weights::choose(camera, &grid, model, basis).unwrap();
            let Path::Aligned(aligned) = &weights.path else { panic!("{}", weights.reason) };
            for index in voxels(&grid) {
                let mut buffers = ProductBuffers::default();
                let found = products(aligned, index, &mut buffers);
                let wanted = merged(&weights, index, &mut buffers.scratch);
                assert!(found.len() >= wanted.len() && found.len() < 2 * wanted.len().max(1), "{model:?} {index}");
                let sum: f32 = found.iter().map(|(_, weight)| weight).sum();
                for (pixel, weight) in wanted {
                    let at = found.binary_search_by_key(&pixel, |(pixel, _)| *pixel).unwrap();
                    assert!((found[at].1 - weight).abs() <= 1e-5 * sum, "{model:?}, voxel {index}, pixel {pixel}");
                }
            }
        }
    }
}
