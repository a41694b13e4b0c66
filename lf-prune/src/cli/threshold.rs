//! The threshold where none is typed: low enough for faint particles where that costs few voxels.

use super::arguments::Arguments;
use lf_core::{Camera, Grid, Refusal, Session};
use lf_prune::{Automatic, PruneOptions, PrunePlan, Region};
use ndarray::ArrayView2;

/// Faint particles are kept too if at most this share of the voxels is then kept. In crowded frames a low threshold
/// rules out next to nothing.
const MOST_KEPT: f64 = 0.5;

/// The options with the threshold as typed, or as found from the image: see [`MOST_KEPT`], by a forecast for the whole
/// grid, so that tiles take what the whole takes. A threshold that is found is printed with `-v`.
pub fn options(
    arguments: &Arguments,
    found: &Automatic,
    camera: &Camera,
    grid: &Grid,
    pixels: ArrayView2<f32>,
    session: &mut Session,
) -> Result<PruneOptions, Refusal> {
    if let Some(typed) = arguments.typed_threshold() {
        return Ok(arguments.options(typed));
    }
    let (usual, faint) = (arguments.options(found.threshold), arguments.options(found.faint));
    let is_affordable = || {
        let whole: Vec<Region> = vec![[0..grid.shape[0], 0..grid.shape[1]]; grid.shape[2]];
        let plan = PrunePlan::new(camera, grid, &whole, &faint)?;
        Ok::<_, Refusal>(plan.estimated_kept(pixels)? <= MOST_KEPT * plan.voxels() as f64)
    };
    let is_open = faint.threshold < usual.threshold && !usual.keep_all;
    let options = if is_open && is_affordable()? { faint } else { usual };
    session.count("noise", found.noise);
    session.count("threshold", options.threshold);
    let of_light = if found.light > 0.0 { 100.0 * options.threshold / found.light } else { 0.0 };
    session.explain(format!(
        "threshold {:.2} % of the brightest pixel, {of_light:.0} % of the light's usual brightness; noise {:.2} %",
        100.0 * options.threshold,
        100.0 * found.noise
    ));
    Ok(options)
}
