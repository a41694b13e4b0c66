//! Warnings about a calibration of the main lens that has succeeded.

use super::exposure::Exposure;
use super::recognise::spacing_mm;
use super::report::MainLensFit;
use crate::fit::parameter::LARGEST_CHANGE;
use crate::points::refocus::refocus;
use glam::DVec2;
use lf_core::{Camera, Optics};

/// Warn if the residual exceeds both 2 times what noise explains and 0.03 px. A smaller one has no effect on a
/// reconstruction.
const DOUBTFUL_TIMES: f64 = 2.0;
const DOUBTFUL_PX: f64 = 0.03;
/// Peaks of light are closer than dots below this ratio.
const CLOSER: f64 = 0.75;
/// Smallest number of peaks that shows a spacing, and cells of the refocused image per spacing.
const FEWEST: usize = 9;
const CELLS: f64 = 32.0;

/// Warnings about a calibration, each with its figure.
pub fn fit_warnings(found: &MainLensFit, nominal: &Camera) -> Vec<String> {
    let [_, rms, expected] = found.rms_px;
    let mut warnings = Vec::new();
    if is_doubtful(rms, expected) {
        warnings.push(format!(
            "the residual of {rms:.3} px is {:.1} times what the sub-images' noise explains: check for clipped or uneven dots, \
             wrong depths, and a thick window",
            rms / expected
        ));
    }
    if !found.against_mm.is_empty() {
        let depths: Vec<String> = found.against_mm.iter().map(|depth| format!("{depth}")).collect();
        warnings.push(format!(
            "images at {} mm do not show the dots where this camera has them: check the depths, the direction of z, and the data \
             sheets",
            depths.join(", ")
        ));
    }
    let checks = "check the depths, the spacing of the dots, the liquid and the data sheets";
    if let Some(doubt) = &found.doubt {
        warnings.push(format!(
            "by the images alone {doubt}; a camera near its data sheets, which is taken, shows the dots as well: behind a thick \
             lens, lengths trade for each other; otherwise {checks}"
        ));
    }
    for far in far_lengths(&found.camera, nominal) {
        warnings.push(format!("{far}: {checks}"));
    }
    warnings
}

/// Whether a residual shows that something is wrong.
fn is_doubtful(rms_px: f64, expected_px: f64) -> bool {
    rms_px >= DOUBTFUL_TIMES * expected_px && rms_px >= DOUBTFUL_PX
}

/// Lengths of a camera that are farther from the data sheets than careful ones are from the truth.
pub(super) fn far_lengths(camera: &Camera, nominal: &Camera) -> Vec<String> {
    let lengths = [
        ("gap_mm", camera.gap_mm(), nominal.gap_mm()),
        ("focal_length_mm", camera.main_lens.focal_length_mm, nominal.main_lens.focal_length_mm),
        ("magnification", camera.main_lens.magnification, nominal.main_lens.magnification),
    ];
    let far = lengths.into_iter().filter(|(_, value, stated)| (value / stated - 1.0).abs() > LARGEST_CHANGE);
    let text = |(name, value, stated): (&str, f64, f64)| {
        format!(
            "{name} was found to be {value:.4}, {:+.0} % from the {stated:.4} stated",
            100.0 * (value / stated - 1.0)
        )
    };
    far.map(text).collect()
}

/// Distance between the dots that the images show, and that stated, mm, if they are clearly closer than stated. Looks
/// at the image nearest to focus of those used.
pub fn closer_dots_mm(exposures: &[Exposure], used: &[usize], camera: &Camera) -> Option<[f64; 2]> {
    let nearest =
        used.iter().min_by(|&&a, &&b| exposures[a].depth_mm().abs().total_cmp(&exposures[b].depth_mm().abs()))?;
    let exposure = &exposures[*nearest];
    let stated = spacing_mm(&exposure.flat_mm())?;
    let (optics, view) = (Optics::new(camera), DVec2::from(camera.half_view_mm()));
    let half = view.min(DVec2::splat(4.0 * stated));
    let refocused = refocus(exposure.pixels.view(), &optics, exposure.depth_mm(), half, stated / CELLS);
    let peaks: Vec<DVec2> = refocused.peaks(0.2 * stated).into_iter().map(|(_, place)| place).collect();
    let seen = spacing_mm(&peaks).filter(|_| peaks.len() >= FEWEST)?;
    (seen < CLOSER * stated).then_some([seen, stated])
}
