//! A second, more forgiving pruning of a frame whose light the kept voxels do not explain.

use lf_core::{Camera, Grid, Refusal, Session};
use lf_prune::{Automatic, BRIGHT_THRESHOLDS, FORGIVING, PruneOptions, PrunePlan, Region, Score, Support};
use ndarray::ArrayView2;

/// Prune again if the kept voxels explain less than this share of the light, and keep the new voxels if they explain
/// this much more. Usual scenes are explained to 0.998 or more.
const EXPLAINED: f64 = 0.98;
const GAINED: f64 = 0.01;

/// Standard deviations of the noise that light must reach to be asked for, and that the lower threshold keeps.
const LIT_NOISE: f64 = 5.0;
const LEAST_NOISE: f64 = 2.0;

/// The frame and the volume.
pub struct Frame<'a> {
    pub pixels: ArrayView2<'a, f32>,
    pub camera: &'a Camera,
    pub grid: &'a Grid,
    pub found: &'a Automatic,
    /// Whether the whole grid is pruned. Voxels beside a tile may explain its light.
    pub is_whole: bool,
}

impl Frame<'_> {
    /// The share of the light that `support` explains: see [`Support::explained`].
    fn explained(&self, support: &Support, options: &PruneOptions) -> Option<f64> {
        let peak = self.pixels.iter().fold(0f32, |peak, value| peak.max(*value));
        let least = options.threshold.max(LIT_NOISE * self.found.noise);
        let range = [least, self.found.light].map(|share| share as f32 * peak);
        let is_asked = self.is_whole && !options.keep_all;
        is_asked.then(|| support.explained(self.pixels, self.camera, self.grid, range)).flatten()
    }
}

/// The voxels kept, the options that kept them, and the share of the light that they explain.
pub struct Pruned {
    pub support: Support,
    pub options: PruneOptions,
    pub explained: Option<f64>,
}

impl Pruned {
    pub fn new(support: Support, options: PruneOptions, frame: &Frame) -> Self {
        let explained = frame.explained(&support, &options);
        Self { support, options, explained }
    }
}

/// Prunes again if light is left and the threshold is ours to choose. Gives what explains more.
pub fn improve(
    first: Pruned,
    frame: &Frame,
    regions: &[Region],
    is_automatic: bool,
    session: &mut Session,
) -> Result<Pruned, Refusal> {
    let before = match first.explained {
        Some(share) if share < EXPLAINED && is_automatic && first.options.score == Score::Geometric => share,
        _ => return Ok(first),
    };
    let ([dark, lower], usual) = (FORGIVING, first.options.threshold);
    let threshold = (lower * usual).max(LEAST_NOISE * frame.found.noise).min(usual);
    let bright = (BRIGHT_THRESHOLDS * threshold).min(1.0);
    let options = PruneOptions { threshold, dark: dark * threshold, bright, ..first.options };
    let plan = PrunePlan::new(frame.camera, frame.grid, regions, &options)?;
    let progress = session.progress("slices, again", frame.grid.shape[2] as u64);
    let support = plan.prune(frame.pixels, |slices| progress.add(slices));
    drop(progress);
    // With the limits of the first pruning, so that the shares compare.
    let explained = frame.explained(&support, &first.options);
    let gained = explained.map_or(0.0, |after| after - before);
    session.explain(format!(
        "pruned again with a lower threshold, {:.2} % of the brightest pixel, and four rays in ten free to be dark: it \
         explains {:.0} % more of the light",
        100.0 * threshold,
        100.0 * gained
    ));
    Ok(if gained > GAINED { Pruned { support, options, explained } } else { first })
}
