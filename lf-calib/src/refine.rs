//! In: what the particles of frames say of their camera. Out: the camera with the parameters that they clearly correct.
//!
//! Each frame's particles were eliminated by lf-fit, so that the sum of the frames' equations is the bundle adjustment
//! of all of them (Wieneke 2008; block elimination as by Triggs et al. 2000). Parameters come in one after another, the
//! one that explains most first, until none is worth it.

use crate::fit::changes::record;
use lf_core::camera::{Correction, Evidence, PARAMETERS, Parameter, stepped};
use lf_core::linear::{cholesky, inverse_column, solve};
use lf_core::{Camera, Refusal};
use serde_json::json;

/// Smallest fall of -2 log L for a parameter, and smallest number of its standard uncertainties.
const GAIN: f64 = 25.0;
const SURE: f64 = 5.0;
/// A parameter moves light by at least this, px.
const LEAST_PX: f64 = 0.01;
/// Errors of the images of particles look like corrections of this size, px. It is added to the stated uncertainties.
const MODEL_PX: f64 = 0.0015;
/// A parameter whose information beside the others is less than this share of its own is not determined.
const DETERMINED: f64 = 1e-6;

/// A refined camera.
#[derive(Debug, Clone)]
pub struct Refined {
    /// `calibration.refine` holds what was found.
    pub camera: Camera,
    /// The parameters that were corrected.
    pub corrected: Vec<Correction>,
    /// Their correlations, by rows.
    pub correlations: Vec<Vec<f64>>,
    /// Number of particles.
    pub particles: usize,
    /// How far the frames differ from their common camera: root mean square of their own corrections' differences over
    /// what they state, 1 if they state right. 1 for one frame.
    pub scatter: f64,
    /// The drift of each frame that determines it: its number, px along x and y, and standard uncertainties.
    pub drifts: Vec<(usize, [f64; 2], [f64; 2])>,
}

/// Normal equations of some parameters.
struct Equations {
    parameters: Vec<&'static Parameter>,
    right: Vec<f64>,
    matrix: Vec<Vec<f64>>,
}

impl Equations {
    /// Equations of steps from the given camera, by one frame.
    fn of(evidence: &Evidence) -> Self {
        let by = |row: &Vec<f64>| row.iter().zip(&evidence.value_px).map(|(a, b)| a * b).sum::<f64>();
        let right = evidence.information.iter().zip(&evidence.gradient).map(|(row, slope)| by(row) + slope).collect();
        Self { parameters: evidence.known().collect(), right, matrix: evidence.information.clone() }
    }

    /// The sum of all frames. A parameter that some frame holds stays held.
    fn sum(frames: &[Self]) -> Self {
        let in_all = |parameter: &&&Parameter| frames.iter().all(|frame| frame.parameters.contains(*parameter));
        let parameters: Vec<&Parameter> = frames[0].parameters.iter().filter(in_all).copied().collect();
        let mut sum = Self { right: vec![0.0; parameters.len()], matrix: Vec::new(), parameters };
        sum.matrix = vec![sum.right.clone(); sum.right.len()];
        for frame in frames {
            let at = frame.places(&sum.parameters);
            for a in 0..at.len() {
                sum.right[a] += frame.right[at[a]];
                (0..at.len()).for_each(|b| sum.matrix[a][b] += frame.matrix[at[a]][at[b]]);
            }
        }
        sum
    }

    /// The places of parameters in these equations.
    fn places(&self, parameters: &[&Parameter]) -> Vec<usize> {
        let place = |parameter: &&Parameter| self.parameters.iter().position(|own| own == parameter);
        parameters.iter().filter_map(place).collect()
    }

    /// The steps of some parameters, the others being held. None if they are not determined.
    fn solve(&self, at: &[usize]) -> Option<Solution> {
        let size = at.len();
        let mut lower: Vec<f64> = at.iter().flat_map(|a| at.iter().map(|b| self.matrix[*a][*b])).collect();
        cholesky(&mut lower, size, DETERMINED)?;
        let right: Vec<f64> = at.iter().map(|a| self.right[*a]).collect();
        let mut steps = right.clone();
        solve(&lower, &mut steps);
        let covariance: Vec<Vec<f64>> = (0..size).map(|n| inverse_column(&lower, size, n)).collect();
        let gain = right.iter().zip(&steps).map(|(a, b)| a * b).sum();
        Some(Solution { steps, covariance, gain })
    }
}

/// Steps of parameters, px.
#[derive(Debug, Clone, Default)]
struct Solution {
    steps: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    /// Fall of -2 log L.
    gain: f64,
}

impl Solution {
    fn std(&self, n: usize) -> f64 {
        self.covariance[n][n].sqrt()
    }
}

/// The camera that the frames correct. All have the same `camera`.
/// Refuses frames that say nothing, or whose parameters have none in common.
pub fn refine(camera: &Camera, frames: &[Evidence]) -> Result<Refined, Refusal> {
    let each: Vec<Equations> = frames.iter().map(Equations::of).collect();
    let sum = Equations::sum(&each);
    Refusal::unless(
        !sum.parameters.is_empty(),
        || "no parameter that all frames determine",
        "wanted frames of one run",
    )?;

    // Take the parameters that are worth it. Frames that differ by more than they state know less.
    let (mut chosen, mut found, mut scatter) = (Vec::new(), Solution::default(), 1.0);
    while let Some((next, solution)) = best(camera, &sum, &chosen, (found.gain, scatter)) {
        chosen.push(next);
        scatter = scatter_of(&each, &sum, &chosen, &solution.steps);
        found = solution;
    }
    let is_sure = |n: usize| found.steps[n].abs() > (SURE * scatter * found.std(n)).max(LEAST_PX);
    let sure: Vec<usize> = (0..chosen.len()).filter(|n| is_sure(*n)).map(|n| chosen[n]).collect();
    if sure.len() < chosen.len() {
        found = sum.solve(&sure).unwrap_or_default();
        chosen = sure;
        scatter = scatter_of(&each, &sum, &chosen, &found.steps);
    }

    let mut refined = Refined {
        camera: stepped(camera, chosen.iter().map(|at| sum.parameters[*at]).zip(found.steps.iter().copied())),
        corrected: Vec::new(),
        correlations: Vec::new(),
        particles: frames.iter().map(|frame| frame.particles).sum(),
        scatter,
        drifts: frames.iter().zip(&each).filter_map(|(frame, equations)| drift(frame.frame, equations)).collect(),
    };
    for (n, at) in chosen.iter().enumerate() {
        let (parameter, step) = (*sum.parameters[*at], found.steps[n]);
        refined.corrected.push(Correction::new(parameter, camera, step, (scatter * found.std(n)).hypot(MODEL_PX)));
        let correlation = |m: usize| found.covariance[n][m] / (found.std(n) * found.std(m));
        refined.correlations.push((0..chosen.len()).map(correlation).collect());
    }
    let account = refined.account(frames.len());
    record(&mut refined.camera, "refine", account);
    Ok(refined)
}

/// The parameter that lowers -2 log L most beside the chosen ones, and the solution with it. None if none is worth it.
/// The camera can take all of its steps.
fn best(camera: &Camera, sum: &Equations, chosen: &[usize], (gain, scatter): (f64, f64)) -> Option<(usize, Solution)> {
    let with = |next: usize| {
        let at: Vec<usize> = chosen.iter().copied().chain([next]).collect();
        sum.solve(&at).map(|solution| (next, solution))
    };
    let others = (0..sum.parameters.len()).filter(|n| !chosen.contains(n));
    let is_worth = |(next, solution): &(usize, Solution)| {
        let last = chosen.len();
        let mut steps = chosen.iter().chain([next]).zip(&solution.steps);
        solution.gain - gain > GAIN * scatter * scatter
            && solution.steps[last].abs() > LEAST_PX
            && steps.all(|(at, step)| sum.parameters[*at].allows(camera, *step))
    };
    others.filter_map(with).filter(is_worth).max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))
}

/// See [`Refined::scatter`]; of the chosen parameters, whose steps are `common`. Never below 1.
fn scatter_of(each: &[Equations], sum: &Equations, chosen: &[usize], common: &[f64]) -> f64 {
    let parameters: Vec<&Parameter> = chosen.iter().map(|n| sum.parameters[*n]).collect();
    let (mut squares, mut count) = (0.0, 0);
    for frame in each {
        let at = frame.places(&parameters);
        let Some(own) = frame.solve(&at) else { continue };
        let off: Vec<f64> = own.steps.iter().zip(common).map(|(own, common)| own - common).collect();
        let along = |a: usize| (0..at.len()).map(|b| frame.matrix[at[a]][at[b]] * off[b]).sum::<f64>();
        squares += (0..at.len()).map(|a| off[a] * along(a)).sum::<f64>();
        count += 1;
    }
    let freedom = (count.max(1) - 1) * chosen.len();
    if freedom == 0 { 1.0 } else { (squares / freedom as f64).sqrt().max(1.0) }
}

/// The drift of a frame by its own particles, the other parameters being held.
fn drift(frame: usize, equations: &Equations) -> Option<(usize, [f64; 2], [f64; 2])> {
    let found = equations.solve(&equations.places(&[&PARAMETERS[0], &PARAMETERS[1]]))?;
    (found.steps.len() == 2).then(|| (frame, [found.steps[0], found.steps[1]], [found.std(0), found.std(1)]))
}

impl Refined {
    fn account(&self, frames: usize) -> serde_json::Value {
        let changes = self.corrected.iter().map(|Correction { parameter, step, std }| {
            json!({"parameter": parameter.key, "change": step, "standard_uncertainty": std})
        });
        let drifts = self.drifts.iter().map(|(frame, drift_px, std_px)| {
            json!({"frame": frame, "drift_px": drift_px, "standard_uncertainty_px": std_px})
        });
        json!({"frames": frames, "particles": self.particles, "scatter": self.scatter,
            "changes": changes.collect::<Vec<_>>(), "correlations": self.correlations,
            "drift_by_frame": drifts.collect::<Vec<_>>()})
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::view::tests::seed;
    use lf_core::camera::{Blur, Layout};

    /// A frame that determines each parameter to `std` px alone, with a correlation of a half between the first two.
    /// Its best steps are `truth` and an error. The fit has found `value`.
    fn frame(number: usize, truth: &[f64], value: &[f64], errors: &[f64], std: f64) -> Evidence {
        let size = truth.len();
        let entry = |a: usize, b: usize| match (a, b) {
            (a, b) if a == b => std.powi(-2),
            (0, 1) | (1, 0) => 0.5 * std.powi(-2),
            _ => 0.0,
        };
        let information: Vec<Vec<f64>> = (0..size).map(|a| (0..size).map(|b| entry(a, b)).collect()).collect();
        let left: Vec<f64> = (0..size).map(|n| truth[n] + errors[n] - value[n]).collect();
        let gradient = information.iter().map(|row| row.iter().zip(&left).map(|(a, b)| a * b).sum()).collect();
        Evidence {
            camera: seed(20, Layout::Square),
            frame: number,
            particles: 100,
            chi2: 1.0,
            parameters: PARAMETERS[..size].iter().map(|parameter| parameter.key.to_string()).collect(),
            value_px: value.to_vec(),
            gradient,
            information,
        }
    }

    /// Parameters that are 10 standard uncertainties off are corrected wherever the fit stood, and nothing else.
    #[test]
    fn clear_errors_are_corrected() {
        let camera = seed(20, Layout::Square);
        let truth = [0.1, 0.0, 0.0, -0.05, 0.004];
        let values = [[0.0; 5], [0.1, 0.0, 0.0, -0.05, 0.0]];
        let frames = [0, 1].map(|n| frame(n, &truth, &values[n], &[0.0; 5], 0.005));
        let found = refine(&camera, &frames).unwrap();
        let keys: Vec<&str> = found.corrected.iter().map(|one| one.parameter.key).collect();
        assert_eq!(keys, ["drift_x_px", "f_number_percent"]);
        let moved = found.camera.microlenses.offset_mm[0] - camera.microlenses.offset_mm[0];
        assert!((moved / camera.sensor.pixel_pitch_mm - 0.1).abs() < 1e-9);
        let f_number = found.camera.main_lens.working_f_number / camera.main_lens.working_f_number - 1.0;
        assert!((f_number + 0.05 / (0.5 * camera.pitch_px())).abs() < 1e-9);
        assert!((found.corrected[0].std - (0.005 / 2f64.sqrt()).hypot(MODEL_PX)).abs() < 1e-9 && found.scatter == 1.0);
        assert_eq!((found.particles, found.drifts.len()), (200, 2));
    }

    /// A camera that moves between frames: uncertainties grow with the differences, and the drifts show it.
    #[test]
    fn frames_that_disagree_state_less() {
        let camera = seed(20, Layout::Square);
        let errors = |sign: f64| [sign * 0.1, 0.0, 0.0];
        let frames: Vec<Evidence> =
            (0..8).map(|n| frame(n, &[0.3, 0.0, 0.0], &[0.0; 3], &errors([1.0, -1.0][n % 2]), 0.005)).collect();
        let found = refine(&camera, &frames).unwrap();
        assert!((found.scatter - (0.1 / 0.005) * (8f64 / 7.0).sqrt()).abs() < 0.1, "{}", found.scatter);
        assert!((found.corrected[0].std - (found.scatter * 0.005 / 8f64.sqrt()).hypot(MODEL_PX)).abs() < 1e-9);
        assert!((found.drifts[3].1[0] - 0.2).abs() < 1e-9);
    }

    /// Scar: a blur of 0.06 px was called 1.7 px too large. The other parameter is corrected without it.
    #[test]
    fn a_blur_stays_positive() {
        let mut camera = seed(20, Layout::Square);
        camera.blur = Some(Blur { sigma_px: 0.3, ..Blur::default() });
        let both = |blur_px: f64| {
            let mut one = frame(0, &[0.2, blur_px], &[0.0; 2], &[0.0; 2], 0.01);
            one.parameters[1] = "blur_px".into();
            refine(&camera, &[one]).unwrap().corrected.len()
        };
        assert_eq!([both(-1.7), both(-0.2), both(0.3)], [1, 2, 2]);
    }

    /// Two parameters that look the same in every frame: one of them is taken.
    #[test]
    fn one_of_two_that_look_the_same_is_corrected() {
        let camera = seed(20, Layout::Square);
        let mut one = frame(0, &[0.2, 0.2], &[0.0; 2], &[0.0; 2], 0.01);
        one.information = vec![vec![1e4; 2]; 2];
        one.gradient = vec![2e3; 2];
        assert_eq!(refine(&camera, &[one]).unwrap().corrected.len(), 1);
    }
}
