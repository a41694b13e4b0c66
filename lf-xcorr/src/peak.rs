//! From the sums of a window to its displacement.

use crate::fit::{self, Fit};
use crate::score::{Room, normalised};
use crate::shifts::{Shifts, Sums, channel};

/// What a window measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Peak {
    /// No light in one of the volumes: nothing to correlate.
    Dark,
    /// The score is highest at the edge of the search, or nowhere above zero: no peak inside.
    Outside,
    /// A peak inside the search.
    Inside(Reading),
}

/// A correlation peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reading {
    /// Displacement, voxels.
    pub shift_vox: [f64; 3],
    /// Normalised correlation at the fitted peak, 0 to 1.
    pub height: f64,
    /// First to second peak, at most [`RATIO_LIMIT`].
    pub ratio: f64,
    /// Covariance of the peak, taken as a Gaussian, voxels squared.
    pub covariance_vox2: [[f64; 3]; 3],
}

/// Constant: the ratio where no second peak rises above a thousandth of the first; it keeps the ratio finite everywhere.
pub(crate) const RATIO_LIMIT: f64 = 1e3;

/// Finds the peak in the sums of a window, those of each pair.
pub(crate) fn find(pairs: &[Sums], room: &Room) -> Peak {
    let lit = |channel: usize| pairs.iter().any(|sums| sums.channel(channel).iter().any(|&sum| sum > 0.0));
    if !(lit(channel::FIRST) && lit(channel::SECOND)) {
        return Peak::Dark;
    }
    let shifts = pairs[0].shifts;
    let score = normalised(pairs, room);
    let best = (1..score.len()).fold(0, |best, k| if score[k] > score[best] { k } else { best });
    let at = [best % shifts.n[0], best / shifts.n[0] % shifts.n[1], best / shifts.n[0] / shifts.n[1]];
    if score[best] <= 0.0 || (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == shifts.n[axis]) {
        return Peak::Outside;
    }
    let Fit { offset, height, covariance } = fit::gaussian(&score, shifts.n, at);
    let second = second(&score, &shifts, best);
    let ratio = if second * RATIO_LIMIT > score[best] { score[best] / second } else { RATIO_LIMIT };
    let shift_vox = std::array::from_fn(|axis| (shifts.low[axis] + at[axis] as i32) as f64 + offset[axis]);
    Peak::Inside(Reading { shift_vox, height: height.clamp(0.0, 1.0), ratio, covariance_vox2: covariance })
}

/// The score of the second peak: the highest shift, `best` apart, that none of its 26 neighbours exceeds. The flank of a
/// long peak is no peak, however far it reaches.
fn second(score: &[f64], shifts: &Shifts, best: usize) -> f64 {
    let [nx, ny, nz] = shifts.n;
    let mut second = 0.0;
    for (k, &candidate) in score.iter().enumerate() {
        if candidate <= second || k == best {
            continue;
        }
        let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
        let (x, y, z) = (k % nx, k / nx % ny, k / nx / ny);
        let mut rows = near(z, nz).flat_map(|z| near(y, ny).map(move |y| nx * (y + ny * z)));
        if rows.all(|row| score[row + near(x, nx).start..row + near(x, nx).end].iter().all(|&near| near <= candidate)) {
            second = candidate;
        }
    }
    second
}
