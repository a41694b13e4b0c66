//! Corrections of a camera's parameters, beside its drift and its blur.

use lf_core::Camera;
use lf_core::camera::{COUNT, Correction, PARAMETERS, Parameter};

/// Drift and blur come first among the parameters.
const OTHERS: usize = 3;
/// Number of these parameters.
pub(crate) const LENSES: usize = COUNT - OTHERS;

/// One of these parameters.
pub(crate) fn lens(n: usize) -> &'static Parameter {
    &PARAMETERS[OTHERS + n]
}

/// Which of them particles may correct. Beside a rim that cuts the stop light is right to 1 % only, which looks like
/// another f-number and pitch: 31 of 63 particles were then found within 1.5 px, and 63 with these held.
pub(crate) fn correctable(camera: &Camera) -> [bool; LENSES] {
    std::array::from_fn(|n| !camera.has_cut_stop() || !lens(n).scales_images())
}

/// The parameters that were corrected.
pub(crate) fn corrections(camera: &Camera, steps_px: [f64; LENSES], std_px: &[f64]) -> Vec<Correction> {
    let corrected = (0..LENSES).filter(|n| steps_px[*n] != 0.0);
    corrected.map(|n| Correction::new(*lens(n), camera, steps_px[n], std_px[n])).collect()
}
