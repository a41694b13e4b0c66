//! From the sums of a window to its displacement.

use super::fit::{self, GaussianFit};
use super::score::{PairedVoxels, normalised};
use super::shifts::Shifts;
use super::sums::{Sums, channel};
use glam::DVec3;

/// The measurement of a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Peak {
    /// One of the volumes has no light.
    Dark,
    /// The score is highest at the edge of the search, at two places apart, or nowhere above zero.
    Outside,
    Inside(PeakFit),
}

impl Peak {
    /// The fitted peak; `None` unless it is inside the search.
    pub fn fit(&self) -> Option<PeakFit> {
        if let Self::Inside(fit) = self { Some(*fit) } else { None }
    }
}

/// A fitted correlation peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PeakFit {
    /// Displacement, voxels.
    pub shift_vox: DVec3,
    /// Normalised correlation at the fitted peak, 0 to 1.
    pub height: f64,
    /// First to second peak, at most [`RATIO_LIMIT`].
    pub ratio: f64,
    /// Covariance of the peak, taken as a Gaussian, voxels squared.
    pub covariance_vox2: [[f64; 3]; 3],
}

/// Constant: largest ratio, so that it is finite without a second peak.
const RATIO_LIMIT: f64 = 1e3;

/// Constant: a second peak of more than this share of the first is as high. Flanks of particle images that a window's
/// side cuts have one shape at many places, and such peaks differ by less, because intensities have 24 bits.
const TIE: f64 = 1.0 - 1e-6;

/// Finds the peak in the sums of a window; `pairs` holds the sums of each pair of volumes.
pub(crate) fn find(pairs: &[Sums], paired: &PairedVoxels) -> Peak {
    let is_lit = |channel: usize| pairs.iter().any(|sums| sums.channel(channel).iter().any(|&sum| sum > 0.0));
    if !(is_lit(channel::FIRST) && is_lit(channel::SECOND)) {
        return Peak::Dark;
    }
    let shifts = pairs[0].shifts;
    let score = normalised(pairs, paired);
    let best = (1..score.len()).fold(0, |best, k| if score[k] > score[best] { k } else { best });
    let at = shifts.place(best);
    if score[best] <= 0.0 || (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == shifts.n[axis]) {
        return Peak::Outside;
    }
    let second = second(&score, &shifts, best);
    if second >= TIE * score[best] {
        return Peak::Outside;
    }
    let GaussianFit { offset, height, covariance } = fit::gaussian(&score, shifts.n, at);
    let ratio = if second * RATIO_LIMIT > score[best] { score[best] / second } else { RATIO_LIMIT };
    let whole = DVec3::from_array([0, 1, 2].map(|axis| (shifts.low[axis] + at[axis] as i32) as f64));
    let (shift_vox, height) = (whole + offset, height.clamp(0.0, 1.0));
    Peak::Inside(PeakFit { shift_vox, height, ratio, covariance_vox2: covariance })
}

/// The score of the second peak: the highest local maximum over 26 neighbours that is no neighbour of `best`. So
/// neither the flank of a long peak nor the other half of a peak between two shifts is a second peak.
fn second(score: &[f64], shifts: &Shifts, best: usize) -> f64 {
    let [nx, ny, nz] = shifts.n;
    let mut second = 0.0;
    for (k, &candidate) in score.iter().enumerate() {
        let is_beside = |(a, b): (usize, usize)| a.abs_diff(b) <= 1;
        if candidate <= second || shifts.place(k).into_iter().zip(shifts.place(best)).all(is_beside) {
            continue;
        }
        let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
        let [x, y, z] = shifts.place(k);
        let mut rows = near(z, nz).flat_map(|z| near(y, ny).map(move |y| nx * (y + ny * z)));
        if rows.all(|row| score[row + near(x, nx).start..row + near(x, nx).end].iter().all(|&near| near <= candidate)) {
            second = candidate;
        }
    }
    second
}
