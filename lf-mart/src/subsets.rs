//! Ordered subsets of simultaneous MART (SMART): Byrne (1996), subsets as in Hudson & Larkin (1994).
//!
//! ```text
//! E_j <- E_j exp(mu sum_i w_ij ln(I_i / p_i) / sum_i w_ij),   p_i = sum_j w_ij E_j,   i over one subset of pixels
//! ```
//!
//! A subset is every n-th image row, n the pixels under a lenslet: every voxel has rows in every subset, out of focus
//! as in focus, and each subset moves all strengths once, so a sweep moves them n times.

use crate::operator::{Operator, Plane, Rows};
use crate::{DARK, Options, Solved};
use lf_core::footprint::Footprint;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Pixels a lenslet for [`SUBSETS`]; fixed, since it was tuned with the relaxation.
const SUBSETS: usize = 14;

/// One update multiplies a strength by no more than this, or divides it.
const GREATEST_STEP: f32 = 20.0;

/// A voxel whose strength has fallen to this share of the strongest is spent: it is dropped. On the `core` scenes this
/// moves Q by less than 3e-4 (upwards) and takes nine voxels of ten off the second sweep.
const SPENT: f32 = 1e-4;

/// A larger support is looked at roughly first, where that is quicker: see [`Footprint::rough`].
const LARGE: usize = 20_000;

/// Subsets in an order that has neighbours far apart: steps of 5 of 14.
fn order(subsets: usize) -> impl Iterator<Item = usize> {
    (0..subsets).map(move |n| n * 5 % subsets)
}

pub(crate) fn keep<T>(values: &mut Vec<T>, held: &[bool]) {
    let mut held = held.iter();
    values.retain(|_| *held.next().expect("one for each"));
}

pub(crate) fn solve(
    image: ArrayView2<f32>,
    footprint: &Footprint,
    indices: &[u64],
    options: &Options,
    done: impl Fn(u64),
) -> Solved {
    let (height, width) = image.dim();
    let mut active = indices.to_vec();
    // The first sweep needs no more than to tell the voxels that have light from those that have none.
    let first_look = footprint.rough();
    let mut rough = !footprint.in_line() && active.len() > LARGE;
    let mut operator = Operator::new(if rough { &first_look } else { footprint }, &active, SUBSETS);
    let peak = image.iter().fold(0f32, |peak, value| peak.max(*value));
    let dark = (DARK * peak).max(f32::MIN_POSITIVE);
    let total: f64 = image.iter().map(|value| f64::from(*value)).sum();

    // Start from an even volume of the image's light; voxels that no pixel sees are put out.
    let even = (total / indices.len().max(1) as f64) as f32;
    let mut plane = Plane::new(width, height);
    // A subset that sees little of a voxel may not move it as far as one that sees its share.
    let mut share = operator.shares();
    let unseen = share.iter().filter(|share| **share <= 0.0).count();
    let mut strengths: Vec<f32> = share.iter().map(|share| if *share > 0.0 { even } else { 0.0 }).collect();
    share.iter_mut().for_each(|share| *share /= SUBSETS as f32);

    let relaxation = options.relaxation as f32;
    let greatest = GREATEST_STEP.ln();
    let mut misfit = Vec::with_capacity(options.iterations);
    for sweep in 0..options.iterations {
        if rough && sweep > 0 {
            operator = Operator::new(footprint, &active, SUBSETS);
            rough = false;
        }
        let (mut off, mut all) = (0f64, 0f64);
        for subset in order(SUBSETS) {
            let rows = Rows { subset, subsets: SUBSETS };
            operator.project(rows, &strengths, &mut plane);
            let parts: Vec<(f64, f64)> = plane
                .values
                .par_chunks_mut(Plane::stride(width))
                .enumerate()
                .filter(|(row, _)| row % SUBSETS == subset)
                .map(|(row, projected)| {
                    let (mut off, mut all) = (0.0, 0.0);
                    for (value, &pixel) in projected[..width].iter_mut().zip(image.row(row)) {
                        if *value > 0.0 {
                            off += f64::from(pixel - *value).powi(2);
                            all += f64::from(pixel).powi(2);
                            *value = (pixel.max(dark) / value.max(dark)).ln();
                        }
                    }
                    (off, all)
                })
                .collect();
            for (part_off, part_all) in parts {
                off += part_off;
                all += part_all;
            }
            operator.back_project(rows, &plane, &mut strengths, |voxel, strength, sum, weight| {
                if weight > 0.0 {
                    let step = relaxation * sum / weight.max(share[voxel]);
                    *strength *= step.clamp(-greatest, greatest).exp();
                }
            });
            let least = SPENT * strengths.iter().fold(0f32, |peak, strength| peak.max(*strength));
            let alive = |strength: &f32| *strength > least;
            let spent = active.len() - strengths.iter().filter(|strength| alive(strength)).count();
            // Dropping costs a look at each voxel; making weights anew, half of a sweep.
            let in_line = footprint.in_line();
            if spent * if in_line { 20 } else { 2 } > active.len() {
                let held: Vec<bool> = strengths.iter().map(alive).collect();
                keep(&mut active, &held);
                keep(&mut share, &held);
                keep(&mut strengths, &held);
                if !operator.retain(&held) {
                    operator = Operator::new(footprint, &active, SUBSETS);
                    rough = false;
                }
            }
        }
        misfit.push(if all > 0.0 { (off / all).sqrt() } else { 0.0 });
        done(1);
    }
    Solved { indices: active, strengths, misfit, unseen }
}
