//! The verdict on a frame, in one sentence.

use super::agreement::Agreement;
use super::held_out::HeldOut;
use serde::Serialize;

/// chi2 of held-out pixels up to which the model explains them.
const MOST_CHI2: f64 = 1.3;
/// chi2 of held-out pixels below which the noise is stated too large.
const LEAST_CHI2: f64 = 0.77;
/// Factor on the stated uncertainties up to which they are right.
const MOST_FACTOR: f64 = 1.25;
/// Share of particles without a partner up to which the two fits found the same ones.
const MOST_ALONE: f64 = 0.2;
/// Pairs that a statement needs.
const FEWEST: usize = 20;

/// The checks of a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelfCheck {
    /// The verdict, a sentence.
    pub verdict: String,
    /// The largest factor by which stated uncertainties along x, y and z are too small. None without pairs.
    pub factor: Option<f64>,
    /// The pixels that were held out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
    /// Two fits to parts of the frame.
    #[serde(flatten)]
    pub agreement: Option<Agreement>,
}

/// Judges the checks that were made.
pub fn self_check(agreement: Option<Agreement>, held_out: Option<HeldOut>) -> SelfCheck {
    let factors = agreement.iter().flat_map(|found| (0..3).filter_map(|axis| found.all.factor(axis)));
    let factor = factors.reduce(f64::max);
    let verdict = verdict(agreement.as_ref(), factor, held_out);
    SelfCheck { verdict, factor, held_out, agreement }
}

/// The gravest finding first: a wrong model makes all other numbers meaningless.
fn verdict(agreement: Option<&Agreement>, factor: Option<f64>, held_out: Option<HeldOut>) -> String {
    if let Some(chi2) = held_out.map(|held_out| held_out.chi2).filter(|chi2| *chi2 > MOST_CHI2) {
        return format!(
            "the model does not explain the image: chi2 of held-out pixels is {chi2:.2}, up to {MOST_CHI2} is good; check \
             the camera (lf-calib lattice, refine), its blur, the background and the noise of the sensor"
        );
    }
    if let Some(chi2) = held_out.map(|held_out| held_out.chi2).filter(|chi2| *chi2 < LEAST_CHI2) {
        return format!(
            "the noise is stated too large: chi2 of held-out pixels is {chi2:.2}, from {LEAST_CHI2} is good; measure it \
             (lf-calib noise)"
        );
    }
    let Some(agreement) = agreement else { return "good: the fit predicts the pixels that it did not see".into() };
    let (pairs, alone) = (agreement.all.counts[2], agreement.all.alone().unwrap_or(1.0));
    if pairs < FEWEST {
        return format!("too few particles: {pairs} pairs, {FEWEST} or more are needed");
    }
    if alone > MOST_ALONE {
        return format!(
            "the two fits find different particles: {:.0} % have no partner, up to {:.0} % is good; check the camera, or \
             take fewer particles",
            100.0 * alone,
            100.0 * MOST_ALONE
        );
    }
    match factor {
        Some(factor) if factor > MOST_FACTOR => format!(
            "the stated uncertainties are too small by a factor of {factor:.2}, up to {MOST_FACTOR} is good; between halves \
             of the stop this is the camera's error (lf-calib lattice, volume), otherwise the noise of the sensor \
             (lf-calib noise)"
        ),
        _ => "good: the two fits agree within the stated uncertainties".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::agreement::{agreement, tests::at};
    use super::*;

    /// Two lists of 30 particles. Places along z differ by 1, 2, ... 30 times `step_mm`, with a stated 1 mm.
    fn lists(step_mm: f64, partners: usize) -> Agreement {
        let std = 1.0 / 2f64.sqrt();
        let place = |n: usize| [n as f64 * 100.0, 0.0, 0.0];
        let a: Vec<_> = (0..30).map(|n| at(place(n), std)).collect();
        let b: Vec<_> =
            (0..30)
                .map(|n| {
                    if n < partners {
                        at([place(n)[0], 0.0, step_mm * n as f64], std)
                    } else {
                        at([0.0, 50.0, 0.0], std)
                    }
                })
                .collect();
        agreement([&a, &b], [1.0, 1.0, 100.0], &[], 1.0).unwrap()
    }

    #[test]
    fn the_gravest_finding_is_said() {
        let of = |chi2: f64| Some(HeldOut { lit: 200, dark: 200, chi2, chi2_dark: 1.0 });
        for (agreement, held_out, begins) in [
            (Some(lists(0.04, 30)), of(1.0), "good: the two fits agree"),
            (None, of(1.1), "good: the fit predicts"),
            (Some(lists(0.04, 30)), of(2.0), "the model does not explain the image"),
            (None, of(0.5), "the noise is stated too large: chi2 of held-out pixels is 0.50"),
            (Some(lists(0.2, 30)), of(1.0), "the stated uncertainties are too small by a factor of 3.9"),
            (Some(lists(0.04, 22)), None, "the two fits find different particles: 27 %"),
            (Some(lists(0.04, 9)), None, "too few particles: 9 pairs"),
        ] {
            let found = self_check(agreement, held_out);
            assert!(found.verdict.starts_with(begins), "{}", found.verdict);
        }
    }
}
