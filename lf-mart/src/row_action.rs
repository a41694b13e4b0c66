//! The paper's MART (eq. 1), pixel after pixel:
//!
//! ```text
//! E_j <- E_j (I_i / sum_j w_ij E_j)^(mu w_ij)
//! ```
//!
//! The result depends on the order of the pixels, which the paper does not give. Here it is the order of the image,
//! rows from the top, each from the left. The weights are stored, pixel by pixel, as the method needs them.

use crate::simultaneous::change;
use crate::{GREATEST_STRENGTH, Problem, Solved, Sweep};
use lf_core::weights::{Footprint, Piece, Scratch};
use rayon::prelude::*;

/// A voxel and its weight on a pixel.
#[derive(Clone, Copy)]
struct Weight {
    voxel: u32,
    weight: f32,
}

/// What fades below this is dark. Voxels fade for ever, and what a faint one sends to a pixel becomes a denormal number,
/// which took most of the time of hundreds of sweeps.
const LEAST_STRENGTH: f32 = 1e-25;

/// Support voxels whose weights are made at once, to be stored in their order.
pub(crate) const RUN: usize = 1 << 12;

/// The weights of a voxel, each pixel once, by rising pixel: `row * width + column`.
fn weights(footprint: &Footprint, index: u64, scratch: &mut Buffers, width: usize) -> Vec<(u32, f32)> {
    if footprint.in_line() && !footprint.circle() {
        products(footprint, index, scratch, width)
    } else {
        merged(footprint, index, &mut scratch.visit, width)
    }
}

#[derive(Default)]
struct Buffers {
    visit: Scratch,
    pieces: Vec<Piece>,
    columns: Vec<(u32, f32)>,
    rows: Vec<(u32, f32)>,
    shares: Vec<f32>,
}

/// Behind a square stop in line the weights of a voxel are the products of its column shares with its row shares, each
/// summed over the lenslets.
fn products(footprint: &Footprint, index: u64, buffers: &mut Buffers, width: usize) -> Vec<(u32, f32)> {
    let [x, y, z] = footprint.grid().voxel(index);
    let Buffers { pieces, columns, rows, shares, .. } = buffers;
    pieces.clear();
    footprint.columns(x, z, pieces);
    summed(pieces, columns);
    pieces.clear();
    footprint.rows(y, z, pieces);
    summed(pieces, rows);
    // Shares apart from their pixels: multiplied in pairs, the pixels' bits would be denormal numbers, thirty times slower.
    let scale = footprint.scale();
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

/// Any camera's, by a sort.
fn merged(footprint: &Footprint, index: u64, scratch: &mut Scratch, width: usize) -> Vec<(u32, f32)> {
    let mut weights: Vec<(u32, f32)> = Vec::new();
    footprint.visit(
        footprint.grid().voxel(index),
        scratch,
        |_| true,
        |column, row, weight| {
            weights.push((row * width as u32 + column, weight));
        },
    );
    sum_equal(&mut weights);
    weights
}

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

fn runs(footprint: &Footprint, indices: &[u64], width: usize, mut take: impl FnMut(usize, Vec<(u32, f32)>)) {
    for (run, part) in indices.chunks(RUN).enumerate() {
        let made: Vec<Vec<(u32, f32)>> = part
            .par_iter()
            .map_init(Buffers::default, |buffers, index| weights(footprint, *index, buffers, width))
            .collect();
        for (n, weights) in made.into_iter().enumerate() {
            take(run * RUN + n, weights);
        }
    }
}

/// Bytes of a stored weight and what points to it.
pub(crate) const WEIGHT_BYTES: u64 = size_of::<Weight>() as u64;

pub(crate) fn solve(problem: &Problem, mut done: impl FnMut(&Sweep)) -> Result<Solved, String> {
    let Problem { ref image, footprint, indices, options, .. } = *problem;
    let (height, width) = image.dim();
    let mut starts = vec![0u64; height * width + 1];
    let mut seen = vec![false; indices.len()];
    runs(footprint, indices, width, |voxel, weights| {
        seen[voxel] = !weights.is_empty();
        for (pixel, _) in weights {
            starts[pixel as usize + 1] += 1;
        }
    });
    for pixel in 0..height * width {
        starts[pixel + 1] += starts[pixel];
    }
    let count = starts[height * width];
    let bytes = count * WEIGHT_BYTES;
    if bytes > options.max_bytes {
        return Err(format!("{count} weights of {WEIGHT_BYTES} bytes take {:.1} GB", bytes as f64 * 1e-9));
    }
    let mut next = starts.clone();
    let mut stored = vec![Weight { voxel: 0, weight: 0.0 }; count as usize];
    runs(footprint, indices, width, |voxel, weights| {
        for (pixel, weight) in weights {
            let place = &mut next[pixel as usize];
            stored[*place as usize] = Weight { voxel: voxel as u32, weight };
            *place += 1;
        }
    });

    let dark = options.floor as f32;
    let mut strengths = problem.first_strengths();
    strengths.iter_mut().zip(&seen).filter(|(_, seen)| !**seen).for_each(|(strength, _)| *strength = 0.0);
    let (relaxation, greatest) = (options.relaxation as f32, options.clamp.ln() as f32);
    let mut sweeps: Vec<Sweep> = Vec::new();
    for number in 1..=options.iterations {
        let before = strengths.clone();
        let (mut off, mut all, mut pixels) = (0.0, 0.0, 0);
        for (pixel, measured) in image.iter().enumerate() {
            let weights = &stored[starts[pixel] as usize..starts[pixel + 1] as usize];
            if weights.is_empty() || measured.is_nan() {
                continue;
            }
            let projected: f32 = weights.iter().map(|w| w.weight * strengths[w.voxel as usize]).sum();
            off += f64::from(measured - projected).powi(2);
            all += f64::from(*measured).powi(2);
            pixels += 1;
            let ratio = relaxation * (measured.max(dark) / projected.max(dark)).ln();
            for w in weights {
                let strength = &mut strengths[w.voxel as usize];
                let factor = (ratio * w.weight).clamp(-greatest, greatest).exp();
                let next = (*strength * factor).min(GREATEST_STRENGTH);
                *strength = if next < LEAST_STRENGTH { 0.0 } else { next };
            }
        }
        let misfit = if all > 0.0 { f64::sqrt(off / all) } else { 0.0 };
        let sweep =
            Sweep { number, misfit, change: change(&before, &strengths), voxels: indices.len(), weights: 2 * count };
        done(&sweep);
        sweeps.push(sweep);
        if problem.enough(&sweeps, pixels, all.sqrt()) {
            break;
        }
    }
    Ok(Solved { indices: indices.to_vec(), strengths, sweeps, unseen: seen.iter().filter(|seen| !**seen).count() })
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
            (Model::Exact, Basis::Blob { sigma_vox: 0.65 }),
        ] {
            let footprint = Footprint::new(camera, &grid, model, basis).unwrap();
            let (width, _) = footprint.sensor();
            for index in voxels(&grid) {
                let mut buffers = Buffers::default();
                let found = products(&footprint, index, &mut buffers, width);
                let wanted = merged(&footprint, index, &mut buffers.visit, width);
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
