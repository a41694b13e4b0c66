//! How much of the error a linear treatment leaves: errors drawn at random go through the same treatment.

use super::errors::Correlated;
use rayon::prelude::*;

/// Constant: draws that are treated at the same time.
pub(super) const BATCH: u64 = 4;

/// Sums of squares of drawn errors before and after the treatment, place by place.
pub(super) struct Spread {
    before: Vec<f64>,
    after: Vec<f64>,
}

impl Spread {
    /// Draws `draws` sets of errors. `treat` turns errors, mm, into those that are left and a number; the mean of that
    /// number over the draws is returned too.
    pub fn new<const N: usize>(
        errors: &Correlated,
        sigma: [&[f64]; N],
        draws: u64,
        treat: impl Fn([Vec<f64>; N]) -> ([Vec<f64>; N], f64) + Sync,
    ) -> ([Self; N], f64) {
        let draw = |n: u64| {
            let drawn: [Vec<f64>; N] = std::array::from_fn(|c| errors.draw(3 * n + c as u64));
            let scaled = std::array::from_fn(|c| drawn[c].iter().zip(sigma[c]).map(|(e, s)| e * s).collect());
            let (left, number) = treat(scaled);
            (drawn, left, number)
        };
        let mut sums: [Self; N] =
            sigma.map(|sigma| Self { before: vec![0.0; sigma.len()], after: vec![0.0; sigma.len()] });
        let mut number = 0.0;
        in_batches(draws, draw, |(drawn, left, one)| {
            number += one / draws as f64;
            sums.iter_mut().enumerate().for_each(|(c, sums)| sums.add(&drawn[c], &left[c], sigma[c]));
        });
        (sums, number)
    }

    fn add(&mut self, drawn: &[f64], left: &[f64], sigma: &[f64]) {
        self.before.iter_mut().zip(drawn).for_each(|(sum, error)| *sum += error * error);
        let scaled = left.iter().zip(sigma).map(|(left, sigma)| left / sigma);
        self.after.iter_mut().zip(scaled).for_each(|(sum, error)| *sum += error * error);
    }

    /// The share of the variance that is left, place by place: means over a box of `reach` vectors to either side along
    /// x, y, z.
    pub fn shares(&self, shape: [usize; 3], reach: [usize; 3]) -> Vec<f64> {
        let [before, after] = [&self.before, &self.after].map(|sums| box_mean(sums, shape, reach));
        after.iter().zip(before).map(|(after, before)| after / before).collect()
    }
}

/// Makes `draws` draws in parallel, and adds them in order. A batch at a time bounds the memory.
pub(super) fn in_batches<T: Send>(draws: u64, draw: impl Fn(u64) -> T + Sync, mut add: impl FnMut(T)) {
    for first in (0..draws).step_by(BATCH as usize) {
        let batch: Vec<T> = (first..draws.min(first + BATCH)).into_par_iter().map(&draw).collect();
        batch.into_iter().for_each(&mut add);
    }
}

/// Root mean square of the numbers that are finite.
pub(super) fn rms(numbers: impl Iterator<Item = f64>) -> f64 {
    let finite = numbers.filter(|number| number.is_finite());
    let (sum, count) = finite.fold((0.0, 0.0), |(sum, count), number| (sum + number * number, count + 1.0));
    (sum / count).sqrt()
}

/// Means over a box of `reach` values to either side along x, y, z, cut at the ends of the grid.
pub(super) fn box_mean(values: &[f64], shape: [usize; 3], reach: [usize; 3]) -> Vec<f64> {
    along_lines(values, shape, |axis, at, line| {
        let (low, high) = (at.saturating_sub(reach[axis]), (at + reach[axis]).min(shape[axis] - 1));
        (low..=high).map(line).sum::<f64>() / (high + 1 - low) as f64
    })
}

/// Replaces all values along x, then y, then z. `value(axis, at, line)` returns the new value at place `at` of a line
/// along the axis; `line(n)` is the old value at place n.
pub(super) fn along_lines(
    values: &[f64],
    shape: [usize; 3],
    value: impl Fn(usize, usize, &dyn Fn(usize) -> f64) -> f64,
) -> Vec<f64> {
    let mut values = values.to_vec();
    for axis in 0..3 {
        let (count, stride): (usize, usize) = (shape[axis], shape[..axis].iter().product());
        let one = |i: usize| {
            let at = i / stride % count;
            value(axis, at, &|n| values[i + n * stride - at * stride])
        };
        values = (0..values.len()).map(one).collect();
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::VectorGrid;

    #[test]
    fn halved_errors_leave_a_quarter_of_the_variance() {
        let layout = VectorGrid { shape: [6, 5, 4], spacing_mm: [1.0; 3], ..VectorGrid::default() };
        let sigma: Vec<f64> = (0..120).map(|i| 1.0 + f64::from(i)).collect();
        let halved = |[errors]: [Vec<f64>; 1]| ([errors.into_iter().map(|error| 0.5 * error).collect()], 7.0);
        let ([spread], number) = Spread::new(&Correlated::new(&layout), [&sigma], 3, halved);
        assert_eq!(number, 7.0);
        assert!(spread.shares(layout.shape, [1; 3]).iter().all(|share| (share - 0.25).abs() < 1e-12));
    }

    #[test]
    fn means_over_a_box_by_hand() {
        assert_eq!(box_mean(&[1.0, 2.0, 6.0, 7.0], [4, 1, 1], [1; 3]), [1.5, 3.0, 5.0, 6.5]);
    }
}
