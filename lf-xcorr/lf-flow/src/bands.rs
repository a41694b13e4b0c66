//! Symmetric matrices with two bands beside the diagonal, one for each line of a grid along an axis: `L d L'`.

/// The factors of all lines along an axis.
pub(super) struct Bands {
    stride: usize,
    count: usize,
    /// 1 / d at each place.
    inverse: Vec<f64>,
    /// L one and two places before each place.
    below: [Vec<f64>; 2],
}

impl Bands {
    /// Factors the lines along an axis with `count` places, `stride` apart in memory, of `len` places in all.
    /// `entry(first, i, back)` is the entry between places i and i - back of the line that starts at `first`. Matrices
    /// are positive; rounding may take that from some.
    pub fn new(stride: usize, count: usize, len: usize, entry: impl Fn(usize, usize, usize) -> f64) -> Self {
        let mut bands = Self { stride, count, inverse: vec![0.0; len], below: [vec![0.0; len], vec![0.0; len]] };
        let mut d = vec![0.0; count];
        for first in (0..len).filter(|i| (i / stride).is_multiple_of(count)) {
            for i in 0..count {
                let at = first + i * stride;
                let l2 = if i >= 2 { entry(first, i, 2) / d[i - 2] } else { 0.0 };
                let cross = if i >= 2 { l2 * d[i - 2] * bands.below[0][at - stride] } else { 0.0 };
                let l1 = if i >= 1 { (entry(first, i, 1) - cross) / d[i - 1] } else { 0.0 };
                let own = entry(first, i, 0);
                d[i] = own;
                if i >= 1 {
                    d[i] -= l1 * l1 * d[i - 1];
                }
                if i >= 2 {
                    d[i] -= l2 * l2 * d[i - 2];
                }
                d[i] = d[i].max(1e-12 * own);
                (bands.below[0][at], bands.below[1][at], bands.inverse[at]) = (l1, l2, 1.0 / d[i]);
            }
        }
        bands
    }

    /// Solves all lines in place.
    pub fn solve(&self, values: &mut [f64]) {
        let Self { stride, count, inverse, below: [l1, l2] } = self;
        let block = stride * count;
        // Rows of lines side by side: forwards, then backwards.
        for first in (0..values.len()).step_by(block) {
            for at in (first + stride..first + block).step_by(*stride) {
                for i in at..at + stride {
                    let before = if at >= first + 2 * stride { l2[i] * values[i - 2 * stride] } else { 0.0 };
                    values[i] -= l1[i] * values[i - stride] + before;
                }
            }
            for at in (first..first + block).step_by(*stride).rev() {
                for i in at..at + stride {
                    let mut value = values[i] * inverse[i];
                    if i + stride < first + block {
                        value -= l1[i + stride] * values[i + stride];
                    }
                    if i + 2 * stride < first + block {
                        value -= l2[i + 2 * stride] * values[i + 2 * stride];
                    }
                    values[i] = value;
                }
            }
        }
    }
}
