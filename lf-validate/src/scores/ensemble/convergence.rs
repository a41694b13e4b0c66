//! How statistics settle with the number of fields, which shows how many are enough.

use super::statistics::Ensemble;
use super::sums::EnsembleSums;
use crate::scores::distribution::root_mean;
use serde::Serialize;

/// The share of the mean displacement that its uncertainty should fall to.
const ENOUGH: f64 = 0.01;

/// Statistics of the first fields.
#[derive(Debug, Clone)]
struct Snapshot {
    fields: usize,
    mean_mm: [Vec<f32>; 3],
    fluctuation_mm: [f64; 3],
}

/// Statistics after 2, 4, 8, ... fields.
#[derive(Debug, Clone, Default)]
pub struct ConvergenceLog {
    snapshots: Vec<Snapshot>,
}

/// Statistics of the first fields against those of all; RMS over the places, for u, v and w.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConvergenceStep {
    /// Number of fields.
    pub fields: usize,
    /// Difference of their mean from the mean of all.
    pub change_mm: [f64; 3],
    /// Their fluctuations.
    pub fluctuation_mm: [f64; 3],
}

impl ConvergenceLog {
    /// Bytes of the statistics kept for `fields` fields of `places` vectors.
    pub fn bytes(places: usize, fields: usize) -> f64 {
        12.0 * places as f64 * (fields.max(1).ilog2() + 1) as f64
    }

    /// Keeps the statistics after 2, 4, 8, ... fields. Expects the sums after every field.
    pub fn record(&mut self, sums: &EnsembleSums) {
        let fields = sums.fields();
        if fields > 1 && fields.is_power_of_two() {
            let (mean_mm, fluctuation_mm) = (sums.mean_mm(), sums.fluctuation_mm());
            self.snapshots.push(Snapshot { fields, mean_mm, fluctuation_mm });
        }
    }

    /// The statistics kept, against those of all fields.
    pub fn finish(self, all: &Ensemble) -> Vec<ConvergenceStep> {
        let last = [&all.mean.u, &all.mean.v, &all.mean.w];
        let change = |snapshot: &Snapshot, c: usize| {
            let differences = snapshot.mean_mm[c].iter().zip(last[c]).map(|(first, all)| f64::from(first - all));
            let known = differences.zip(&all.count).filter(|(d, count)| **count > 0.0 && d.is_finite());
            root_mean(known.map(|(d, _)| d * d))
        };
        let step = |snapshot: &Snapshot| ConvergenceStep {
            fields: snapshot.fields,
            change_mm: [0, 1, 2].map(|c| change(snapshot, c)),
            fluctuation_mm: snapshot.fluctuation_mm,
        };
        self.snapshots.iter().filter(|snapshot| snapshot.fields < all.fields).map(step).collect()
    }
}

/// Number of fields after which the uncertainty of the mean is 1 % of the mean displacement, both RMS over the places,
/// if fields are independent. NaN without a displacement or without an uncertainty.
pub fn fields_for_1_percent(all: &Ensemble) -> [f64; 3] {
    let [displacement, uncertainty] = [all.displacement_mm(), all.uncertainty_mm()];
    let one = |c: usize| {
        let fields = all.fields as f64 * (uncertainty[c] / (ENOUGH * displacement[c])).powi(2);
        if fields.is_finite() { fields.ceil().max(1.0) } else { f64::NAN }
    };
    [0, 1, 2].map(one)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::{disturb, field};

    #[test]
    fn the_mean_of_noise_settles_with_the_root_of_the_number() {
        let (mut log, mut sums) = (ConvergenceLog::default(), None);
        for seed in 0..32 {
            let mut one = field([20, 18, 10], |_| [0.1, 0.0, 0.2]);
            disturb(&mut one, [0.01, 0.02, 0.04], seed);
            let sums = sums.get_or_insert_with(|| EnsembleSums::new(&one.layout));
            sums.add(&one).unwrap();
            log.record(sums);
        }
        let all = sums.unwrap().finish(1);
        let steps = log.finish(&all);
        assert_eq!(steps.iter().map(|step| step.fields).collect::<Vec<_>>(), [2, 4, 8, 16]);
        for step in &steps {
            // The first n fields differ from all 32 by the errors of both, which share n fields.
            let n = step.fields as f64;
            let wanted = 0.04 * (1.0 / n - 1.0 / 32.0).sqrt();
            assert!((step.change_mm[2] / wanted - 1.0).abs() < 0.05, "{step:?}");
            assert!((step.fluctuation_mm[1] / 0.02 - 1.0).abs() < 0.05, "{step:?}");
        }
        // 0.01 / sqrt(100) is 1 % of 0.1; 0.04 needs 400 fields for 0.002.
        let [u, v, w] = fields_for_1_percent(&all);
        assert!((u / 100.0 - 1.0).abs() < 0.06 && (w / 400.0 - 1.0).abs() < 0.06 && v > 1000.0, "{u} {v} {w}");
    }
}
