//! The result of a calibration of the main lens, and its record in the camera.

use super::{bundle::BundleFit, bundle::BundleMisfit, bundle::DotSighting, exposure::Exposure, selection::GroupResult};
use crate::{fit::changes::Changes, fit::changes::record, fit::parameter::Parameter};
use lf_core::Camera;
use serde_json::{Map, Value, json};

/// Pairs of parameters with a correlation above this can hardly be separated.
const CORRELATED: f64 = 0.95;

/// A calibration of the main lens.
#[derive(Debug, Clone)]
pub struct MainLensFit {
    /// `calibration.volume` holds what was measured.
    pub camera: Camera,
    /// Numbers of the images that could be used.
    pub used: Vec<usize>,
    /// Depths, mm, of images out of focus most of whose sub-images are not where the camera has them.
    pub against_mm: Vec<f64>,
    /// Why the camera by the images alone was not taken; None if it was.
    pub doubt: Option<String>,
    /// Names of the parameters that the data required, besides the pose and the magnification.
    pub selected: Vec<&'static str>,
    /// Pairs of parameters that can hardly be separated: the size of their correlation is above 0.95.
    pub correlated: Vec<(&'static str, &'static str, f64)>,
    /// Number of dots that were seen.
    pub dots: usize,
    /// Number of sub-images that were fitted, and number of those with weight.
    pub sub_images: [usize; 2],
    /// Root mean square residual of a coordinate, px: with only the pose free, fitted, and expected from noise.
    pub rms_px: [f64; 3],
    /// Name, value and standard uncertainty of each free parameter.
    pub values: Vec<(&'static str, f64, f64)>,
}

impl MainLensFit {
    /// Takes the reason why the camera by the images alone was not taken, and notes it under `calibration.volume`.
    pub(crate) fn with_doubt(mut self, doubt: Option<String>) -> Self {
        if let (Some(doubt), Some(calibration)) = (&doubt, &mut self.camera.calibration) {
            calibration["volume"]["by_images_alone"] = json!(doubt);
        }
        Self { doubt, ..self }
    }
}

/// Reports a fit, also under `calibration.volume`. `pose_only` is the misfit with only the pose free.
pub(crate) fn report(
    nominal: &Camera,
    fit: &BundleFit,
    results: &[GroupResult],
    pose_only: BundleMisfit,
    used: Vec<usize>,
    sightings: &[DotSighting],
    exposures: &[Exposure],
) -> MainLensFit {
    let mut camera = fit.changes.camera(nominal);
    let correlated = correlated(fit);
    let mut dots: Vec<usize> = sightings.iter().map(|sighting| sighting.dot).collect();
    dots.sort_unstable();
    dots.dedup();
    let misfit = fit.misfit;
    let found = json!({
        "images": exposures.len(),
        "depths_mm": used.iter().map(|&n| exposures[n].depth_mm()).collect::<Vec<_>>(),
        "dots": dots.len(),
        "sub_images": misfit.sub_images,
        "sub_images_kept": misfit.kept,
        "residual_rms_before_px": pose_only.rms_px,
        "residual_rms_px": misfit.rms_px,
        "expected_rms_px": misfit.expected_px,
        "image_distance_mm": camera.image_distance_mm(),
        "pupil_distance_mm": camera.pupil_distance_mm(),
        "demagnification": camera.demagnification(),
        "parameters": parameters(nominal, fit, results),
        "correlated": correlated.iter().map(|(a, b, r)| json!({"pair": [a, b], "correlation": r})).collect::<Vec<_>>(),
    });
    record(&mut camera, "volume", found);
    let value = |(n, parameter): (usize, &Parameter)| {
        (parameter.name(), fit.changes.value(*parameter, nominal), fit.estimate.uncertainty(n))
    };
    let selected = results.iter().filter(|result| result.is_free).flat_map(|result| result.group.parameters);
    MainLensFit {
        camera,
        used,
        against_mm: Vec::new(),
        doubt: None,
        selected: selected.map(|parameter| parameter.name()).collect(),
        correlated,
        dots: dots.len(),
        sub_images: [misfit.sub_images, misfit.kept],
        rms_px: [pose_only.rms_px, misfit.rms_px, misfit.expected_px],
        values: fit.parameters.iter().enumerate().map(value).collect(),
    }
}

/// Every parameter, free or not, with its value, uncertainty and evidence.
fn parameters(nominal: &Camera, fit: &BundleFit, results: &[GroupResult]) -> Map<String, Value> {
    let entry = |parameter: Parameter, changes: &Changes, uncertainty: f64, is_free: bool| {
        json!({
            "value": changes.value(parameter, nominal),
            "change": changes.get(parameter),
            "standard_uncertainty": uncertainty,
            "unit": parameter.unit(),
            "free": is_free,
        })
    };
    let mut entries = Map::new();
    for (n, parameter) in fit.parameters.iter().enumerate() {
        let uncertainty = fit.estimate.uncertainty(n);
        entries.insert(parameter.name().to_string(), entry(*parameter, &fit.changes, uncertainty, true));
    }
    for result in results {
        for (n, parameter) in result.group.parameters.iter().enumerate() {
            let name = parameter.name().to_string();
            if !result.is_free {
                let fixed = result.values.get(n).map(|&(change, uncertainty)| {
                    // The value that the parameter would have if it were free; the camera does not contain it.
                    entry(*parameter, &fit.changes.plus(*parameter, change), uncertainty, false)
                });
                entries.insert(name.clone(), fixed.unwrap_or_else(|| json!({"free": false, "told_apart": false})));
            }
            if let Some(evidence) = result.evidence {
                entries[&name]["evidence_deviations"] = json!(evidence.max(0.0).sqrt());
                entries[&name]["evidence_wanted"] = json!(result.group.needed().sqrt());
            }
        }
    }
    entries
}

fn correlated(fit: &BundleFit) -> Vec<(&'static str, &'static str, f64)> {
    let names: Vec<&'static str> = fit.parameters.iter().map(|parameter| parameter.name()).collect();
    let pairs = (0..names.len()).flat_map(|a| (0..a).map(move |b| (b, a)));
    let correlated = pairs.map(|(b, a)| (names[b], names[a], fit.estimate.correlation(b, a)));
    correlated.filter(|(_, _, correlation)| correlation.abs() > CORRELATED).collect()
}
