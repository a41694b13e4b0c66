//! Averages by phase, of fields that were measured in a cycle.

use super::statistics::Ensemble;
use super::sums::EnsembleSums;
use lf_core::field::NO_DATA;
use lf_core::{Field, Refusal, VectorGrid};
use serde::Serialize;

/// Sums of fields by phase: field n, counted from 0, has phase n modulo the number of phases.
#[derive(Debug, Clone)]
pub struct PhaseSums {
    sums: Vec<EnsembleSums>,
    next: usize,
}

/// Numbers that the phases tell; RMS over places and phases, for u, v and w.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseSummary {
    /// Fields of each phase.
    pub fields: Vec<usize>,
    /// Means of the phases about the mean of all: the motion that repeats.
    pub coherent_mm: [f64; 3],
    /// Fluctuations about the mean of the phase: what does not repeat, noise included.
    pub incoherent_mm: [f64; 3],
}

impl PhaseSums {
    /// Sums of no field, in so many phases.
    pub fn new(layout: &VectorGrid, phases: usize) -> Self {
        Self { sums: vec![EnsembleSums::new(layout); phases], next: 0 }
    }

    /// Adds the next field; refuses as [`EnsembleSums::add`] does.
    pub fn add(&mut self, field: &Field) -> Result<(), Refusal> {
        let phase = self.next % self.sums.len();
        self.next += 1;
        self.sums[phase].add(field)
    }

    /// The statistics of every phase, and what they tell against those of all fields.
    pub fn finish(self, least: u32, all: &Ensemble) -> (Vec<Ensemble>, PhaseSummary) {
        let phases: Vec<Ensemble> = self.sums.into_iter().map(|sums| sums.finish(least)).collect();
        let components = |field: &Field, i: usize| field.displacement_mm(i).to_array();
        let (mut coherent, mut incoherent, mut places) = ([0.0; 3], [0.0; 3], [0.0; 2]);
        for phase in &phases {
            let has_data = |i: &usize| phase.mean.flag[*i] != NO_DATA && all.mean.flag[*i] != NO_DATA;
            for i in (0..all.mean.len()).filter(has_data) {
                let (one, mean) = (components(&phase.mean, i), components(&all.mean, i));
                (0..3).for_each(|c| coherent[c] += (one[c] - mean[c]).powi(2));
                places[0] += 1.0;
                let rms = [0, 1, 2].map(|c| f64::from(phase.rms_mm[c][i]));
                if rms.iter().all(|rms| rms.is_finite()) {
                    (0..3).for_each(|c| incoherent[c] += rms[c].powi(2));
                    places[1] += 1.0;
                }
            }
        }
        let summary = PhaseSummary {
            fields: phases.iter().map(|phase| phase.fields).collect(),
            coherent_mm: coherent.map(|sum| (sum / places[0]).sqrt()),
            incoherent_mm: incoherent.map(|sum| (sum / places[1]).sqrt()),
        };
        (phases, summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::{disturb, field};
    use std::f64::consts::TAU;

    #[test]
    fn a_cycle_is_parted_from_what_does_not_repeat() {
        let layout = field([12, 10, 8], |_| [0.0; 3]).layout;
        let (mut phases, mut sums) = (PhaseSums::new(&layout, 4), EnsembleSums::new(&layout));
        for n in 0..40u64 {
            let swing = (TAU * n as f64 / 4.0).sin();
            let mut one = field([12, 10, 8], |_| [0.1 + 0.03 * swing, 0.0, 0.05]);
            disturb(&mut one, [0.01; 3], n);
            phases.add(&one).unwrap();
            sums.add(&one).unwrap();
        }
        let (means, told) = phases.finish(1, &sums.finish(1));
        assert_eq!(told.fields, [10; 4]);
        // 0.03 sin over a cycle, and the noise of a mean of ten.
        let wanted = (0.5 * 0.03f64.powi(2) + 0.01f64.powi(2) * (0.1 - 0.025)).sqrt();
        assert!((told.coherent_mm[0] / wanted - 1.0).abs() < 0.02, "{told:?}");
        assert!((told.incoherent_mm[0] / 0.01 - 1.0).abs() < 0.02, "{told:?}");
        assert!(told.coherent_mm[1] < 0.004);
        let mean = means[1].mean.u.iter().sum::<f32>() / means[1].mean.u.len() as f32;
        assert!((mean - 0.13).abs() < 1e-3, "{mean}");
    }
}
