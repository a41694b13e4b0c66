//! The time that a reconstruction will take, from the rates at which a sample of its voxels is projected and kept.
//!
//! How many voxels a sweep still holds is not known before the sweep. Here it falls as it does on the ready scenes, see
//! [`held`]. So the forecast errs by a factor of up to two; sparse images and `--until` end sooner.

use crate::operator::{Operator, Plane, Storage};
use lf_core::{Weights, weights::RowSet};
use std::hint::black_box;

/// Voxels of the sample.
const SAMPLE: usize = 4096;

/// Subsets of rows that are timed.
const TIMED: usize = 3;

/// Part of the time of a sweep over all voxels that the first sweep takes, while it drops most of them.
const FIRST_SWEEP: f64 = 0.5;

/// Part of the support's voxels that ordered subsets hold after so many sweeps. Ready scenes have 0.16 to 0.20 after one,
/// 0.09 to 0.12 after two, 0.05 after ten and 0.03 after twenty.
fn held(sweeps: usize) -> f64 {
    0.18 * (sweeps as f64).powf(-0.6)
}

/// Seconds of one thread.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rates {
    /// A subset's rows forward and back, beside the voxels; and for a voxel.
    step: [f64; 2],
    /// The same with kept weights.
    kept_step: [f64; 2],
    /// To keep a voxel's weights.
    keep: f64,
    /// To prepare a voxel's weights that are not kept.
    prepare: f64,
}

impl Rates {
    /// Times a sample of the voxels `indices` (rising). `clock` tells seconds.
    pub(crate) fn measure(weights: &Weights, indices: &[u64], subsets: usize, clock: &dyn Fn() -> f64) -> Self {
        let sample = sample(indices, weights.grid().shape[0]);
        let count = sample.len().max(1) as f64;
        // Seconds to make an operator, and of a step by it. One operator is in memory at a time.
        let of = |is_kept: bool, voxels: &[u64]| {
            let start = clock();
            let operator = match is_kept {
                true => Operator::kept(weights, voxels, subsets),
                false => Operator::remade(weights, voxels, subsets),
            };
            let made = clock() - start;
            [made, step(weights, operator, voxels.len(), subsets, clock)]
        };
        let ([empty, fixed], [prepare, step]) = (of(false, &[]), of(false, &sample));
        let ([_, kept_fixed], [keep, kept_step]) = (of(true, &[]), of(true, &sample));
        Self {
            step: [fixed, (step - fixed).max(0.0) / count],
            kept_step: [kept_fixed, (kept_step - kept_fixed).max(0.0) / count],
            keep: keep / count,
            prepare: (prepare - empty).max(0.0) / count,
        }
    }

    /// Seconds of one thread for so many sweeps at most over `voxels` voxels. `drops` tells whether voxels are dropped.
    /// `is_kept` tells whether the weights of a part of the voxels are kept, after how many sweeps.
    pub(crate) fn seconds(
        &self,
        storage: Storage,
        voxels: usize,
        (sweeps, subsets): (usize, usize),
        drops: bool,
        is_kept: impl Fn(f64, usize) -> bool,
    ) -> f64 {
        let voxels = voxels as f64;
        let sweep = |[fixed, voxel]: [f64; 2], part: f64| subsets as f64 * (fixed + part * voxels * voxel);
        let mut kept = matches!(storage, Storage::Kept | Storage::ByPixel);
        let mut seconds = voxels * if kept { self.keep } else { self.prepare };
        for number in 0..sweeps {
            let part = match (drops, number) {
                (false, _) => 1.0,
                (true, 0) => FIRST_SWEEP,
                (true, _) => held(number),
            };
            if !kept && is_kept(part, number) {
                kept = true;
                seconds += part * voxels * self.keep;
            }
            seconds += sweep(if kept { self.kept_step } else { self.step }, part);
        }
        seconds
    }
}

/// Whole lines of the voxels, spread over all.
fn sample(indices: &[u64], nx: usize) -> Vec<u64> {
    let line = |index: &u64| index / nx as u64;
    let lines: Vec<&[u64]> = indices.chunk_by(|a, b| line(a) == line(b)).collect();
    let apart = (indices.len() / SAMPLE).max(1);
    lines.into_iter().skip(apart / 2).step_by(apart).flatten().copied().collect()
}

/// Seconds of a step of a subset's rows: the mean of some.
fn step(weights: &Weights, mut operator: Operator, voxels: usize, subsets: usize, clock: &dyn Fn() -> f64) -> f64 {
    let [width, height] = weights.sensor_px();
    let mut plane = Plane::new(width, height);
    let mut strengths = vec![1.0; voxels];
    let mut pass = |number: usize| {
        let rows = RowSet { first: number as u32, step: subsets as u32 };
        operator.project(rows, &strengths, &mut plane);
        operator.back_project(rows, &plane, &mut strengths, |_, strength, sum, _| *strength = 0.5 * (*strength + sum));
    };
    // Tables are made at the first use.
    pass(0);
    let many = TIMED.min(subsets);
    let start = clock();
    (0..many).for_each(|n| pass(n * subsets / many));
    black_box(&strengths);
    (clock() - start) / many as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::simultaneous;
    use crate::options::Method;
    use crate::tests::{cameras, grid, voxels};
    use lf_core::weights::{Basis, Model};
    use std::cell::Cell;

    const RATES: Rates = Rates { step: [1.0, 0.1], kept_step: [0.5, 0.01], keep: 2.0, prepare: 0.25 };

    /// By hand, for 100 voxels and 2 subsets.
    #[test]
    fn seconds_by_hand() {
        let never = |_: f64, _: usize| false;
        let all = RATES.seconds(Storage::Tables, 100, (3, 2), false, never);
        assert!((all - (25.0 + 3.0 * 2.0 * 11.0)).abs() < 1e-9, "{all}");
        let kept = RATES.seconds(Storage::Kept, 100, (3, 2), false, never);
        assert!((kept - (200.0 + 3.0 * 2.0 * 1.5)).abs() < 1e-9, "{kept}");
        // The first sweep is half, then 18 voxels are kept.
        let later = RATES.seconds(Storage::Tables, 100, (2, 2), true, |part, number| number > 0 && part < 0.4);
        assert!((later - (25.0 + 2.0 * 6.0 + 36.0 + 2.0 * 0.68)).abs() < 1e-9, "{later}");
    }

    /// A clock that ticks once a look gives rates of whole ticks, whatever the weights.
    #[test]
    fn every_path_is_timed() {
        let grid = grid();
        for camera in cameras() {
            let weights = Weights::choose(&camera, &grid, Model::Exact, Basis::Point).unwrap();
            let ticks = Cell::new(0.0);
            let clock = || {
                ticks.set(ticks.get() + 1.0);
                ticks.get()
            };
            let rates =
                Rates::measure(&weights, &voxels(&grid), simultaneous::subsets(&weights, Method::Subsets), &clock);
            assert!(rates.step[0] > 0.0 && rates.kept_step[0] > 0.0 && rates.keep > 0.0, "{rates:?}");
        }
    }

    #[test]
    fn a_sample_has_whole_lines_from_all_over() {
        let indices: Vec<u64> = (0..200_000).filter(|index| index % 100 < 37).collect();
        let found = sample(&indices, 100);
        assert!(found.len().is_multiple_of(37) && (3000..6000).contains(&found.len()), "{}", found.len());
        assert!(found[0] < 10_000 && *found.last().unwrap() > 190_000 && found.is_sorted());
        assert_eq!(sample(&indices[..50], 100), &indices[..50]);
    }
}
