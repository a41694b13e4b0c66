//! The judgements at the top of the page, each with its limit: what decides whether the vectors can be believed.

use super::html::Section;
use super::motion::FieldStatistics;
use lf_core::Camera;
use serde_json::Value;

/// Largest RMS distance of lenslet images from the lattice, px. Calibrations leave 0.005 to 0.08.
const RESIDUAL_PX: f64 = 0.1;
/// Limits of lf-fit's own warnings: the misfit, and the correlation of the differences of neighbouring pixels.
const MISFIT: f64 = 1.4;
const BESIDE: f64 = 0.15;
/// Limits of lf-xcorr's own warnings: the smallest share of the particles of one frame that are found in the other, and
/// of measured vectors. A fit that invents particles finds few of them again.
const SHARED: f64 = 0.7;
const MEASURED: f64 = 0.8;
/// Largest stated uncertainty as a share of what a component varies by. At 1 all variation may be noise.
const NOISE: f64 = 0.5;

/// Adds a table of what is known to the summary. The worst frame and the worst pair decide.
pub(super) fn judge(
    summary: &mut Section,
    stats: &[(String, Value)],
    camera: Option<&Camera>,
    motion: Option<&FieldStatistics>,
) {
    let runs: Vec<&Value> = stats.iter().map(|(_, run)| run).collect();
    let lines = [
        camera.and_then(lattice),
        explained(&runs),
        shared(&runs),
        motion.map(FieldStatistics::measured_share).map(measured),
        motion.and_then(FieldStatistics::noise_share).map(noise),
    ];
    let rows: Vec<Vec<String>> = lines.into_iter().flatten().map(Judgement::row).collect();
    if !rows.is_empty() {
        summary.table(&[], &rows, 2);
    }
}

struct Judgement {
    question: &'static str,
    /// The figure, and its limit.
    found: String,
    is_good: bool,
}

impl Judgement {
    fn row(self) -> Vec<String> {
        let answer = if self.is_good { "yes" } else { "NO" };
        vec![self.question.to_owned(), format!("{answer}: {}", self.found)]
    }
}

fn lattice(camera: &Camera) -> Option<Judgement> {
    let found = camera.calibration.as_ref()?["lattice"]["residual_rms_px"].as_f64()?;
    Some(Judgement {
        question: "Are the lenslets where the camera has them?",
        found: format!("{found:.3} px RMS (at most {RESIDUAL_PX})"),
        is_good: found <= RESIDUAL_PX,
    })
}

/// The counts of the runs of a tool that have this one.
fn counts<'a>(runs: &'a [&Value], tool: &'a str, name: &'a str) -> impl Iterator<Item = &'a Value> {
    runs.iter().filter(move |run| run["tool"] == tool && run["counts"][name].is_number()).map(|run| &run["counts"])
}

fn explained(runs: &[&Value]) -> Option<Judgement> {
    let most = |name| counts(runs, "lf-fit", name).filter_map(|found| found[name].as_f64()).reduce(f64::max);
    let (misfit, beside) = (most("chi2")?, most("residual_correlation")?);
    Some(Judgement {
        question: "Do camera and noise explain the frames?",
        found: format!("chi2 {misfit:.2} (at most {MISFIT}), pixels alike by {beside:.2} (at most {BESIDE})"),
        is_good: misfit <= MISFIT && beside <= BESIDE,
    })
}

fn shared(runs: &[&Value]) -> Option<Judgement> {
    let share = |found: &Value| {
        let [pairs, wrong, first, second] = ["particle_pairs", "pairs_wrong", "particles_a", "particles_b"]
            .map(|name| found[name].as_f64().unwrap_or(0.0));
        (pairs - wrong) / first.min(second).max(1.0)
    };
    let found = counts(runs, "lf-xcorr", "particle_pairs").map(share).reduce(f64::min)?;
    Some(Judgement {
        question: "Are particles of one frame in the other?",
        found: format!("{:.0} % (at least {:.0} %)", 100.0 * found, 100.0 * SHARED),
        is_good: found >= SHARED,
    })
}

fn measured(found: f64) -> Judgement {
    Judgement {
        question: "Are vectors measured?",
        found: format!("{:.1} % (at least {:.0} %)", 100.0 * found, 100.0 * MEASURED),
        is_good: found >= MEASURED,
    }
}

fn noise((component, found): (&str, f64)) -> Judgement {
    Judgement {
        question: "Do vectors differ by more than their uncertainty?",
        found: format!("that of {component} is {found:.2} of its spread (at most {NOISE})"),
        is_good: found <= NOISE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_worst_frame_decides() {
        let fit = |chi2: f64, beside: f64| json!({"tool": "lf-fit", "counts": {"chi2": chi2, "residual_correlation": beside}});
        let pair = |pairs: usize| json!({"tool": "lf-xcorr", "counts": {"particle_pairs": pairs, "particles_a": 200, "particles_b": 100}});
        let good = [&fit(1.0, 0.1), &fit(1.39, -0.1), &pair(71), &json!({"tool": "lf-mart", "counts": {}})];
        assert!(explained(&good).unwrap().is_good && shared(&good).unwrap().is_good);
        let bad = [&fit(1.0, 0.16), &fit(1.1, 0.0), &pair(90), &pair(69)];
        assert!(!explained(&bad).unwrap().is_good && !shared(&bad).unwrap().is_good);
        assert!(explained(&bad).unwrap().found.starts_with("chi2 1.10 (at most 1.4), pixels alike by 0.16"));
        assert!(explained(&bad[2..]).is_none() && shared(&bad[..2]).is_none());
        assert!(measured(0.8).is_good && !measured(0.79).is_good && noise(("w", 0.5)).is_good);
    }
}
