//! Errors of a vector field against the true displacement: measured - true, each component on its own.

use super::coarse::interpolation_mm;
use super::statistics::{Coverage, ErrorPdf, ErrorSummary};
use super::truth::{TrueDisplacement, VectorError, errors};
use crate::scores::units::units;
use lf_core::Field;
use lf_core::field::{MEASURED, REPLACED};
use serde::Serialize;

/// The score of a measured field against the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Displacement {
    /// Kind of the truth: `field`, `flow` or `tracks`.
    pub(crate) truth: &'static str,
    /// Vectors of the measured field.
    pub places: usize,
    pub(crate) measured: usize,
    pub(crate) replaced: usize,
    /// Vectors without data.
    pub no_data: usize,
    /// Measured or replaced vectors outside the hull of the truth or beside one of its gaps. Not scored.
    pub outside_truth: usize,
    /// Counts of the particles, if they are the truth.
    #[serde(flatten)]
    pub particles: Option<ParticleCounts>,
    /// Size of a pixel at the focal plane. Without a camera it is absent, and so is every `px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) pixel_mm: Option<f64>,
    /// Voxel spacing of the volumes correlated.
    pub(crate) voxel_mm: [f64; 3],
    /// RMS error of interpolation in a true field, estimated for u, v and w: a part of the errors. None for others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpolation_mm: Option<[f64; 3]>,
    /// Errors of all that are scored.
    #[serde(flatten)]
    pub all: ErrorSummary,
    pub(crate) measured_only: ErrorSummary,
    /// Stated uncertainty of the measured vectors against their errors.
    pub uncertainty: Coverage,
    /// Density of the errors of all that are scored. None in voxels without a size.
    pub(crate) pdf: Option<ErrorPdf>,
}

/// Particles that are the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ParticleCounts {
    /// Particles in both frames.
    pub particles: usize,
    /// Particles in only one of the frames. Not scored.
    pub(crate) unpaired: usize,
    /// Particles in both frames that lie outside the field's vectors or beside one of its gaps. Not scored.
    pub outside_field: usize,
}

/// A true field is too coarse if interpolation in it makes more than this share of an RMS error.
const COARSE: f64 = 0.4;

impl Displacement {
    /// The RMS error of interpolation in a true field that is too coarse for the score, mm.
    pub fn of_coarse_truth_mm(&self) -> Option<[f64; 3]> {
        let is_large = |axis: usize, error: f64| error > COARSE * self.all.spread_mm[axis].rms;
        self.interpolation_mm.filter(|errors| errors.iter().enumerate().any(|(axis, error)| is_large(axis, *error)))
    }
}

/// Scores `field` against `truth`. `pixel_mm`: size of a pixel at the focal plane.
pub fn displacement(truth: &TrueDisplacement, field: &Field, pixel_mm: Option<f64>) -> Displacement {
    let voxel_mm = field.layout.voxel_mm;
    let flagged = |flag: f32| field.flag.iter().filter(|found| **found == flag).count();
    let (measured, replaced) = (flagged(MEASURED), flagged(REPLACED));
    let (errors, outside) = errors(truth, field);
    let particles = match truth {
        TrueDisplacement::Tracks(tracks) => {
            let (particles, unpaired) = (tracks.mid_mm.len(), tracks.unpaired);
            Some(ParticleCounts { particles, unpaired, outside_field: outside })
        }
        TrueDisplacement::Field(_) | TrueDisplacement::Flow { .. } => None,
    };
    let units = units(voxel_mm, pixel_mm);
    let measured_only: Vec<VectorError> = errors.iter().copied().filter(|error| error.is_measured).collect();
    Displacement {
        truth: truth.name(),
        places: field.len(),
        measured,
        replaced,
        no_data: field.len() - measured - replaced,
        outside_truth: if particles.is_none() { outside } else { 0 },
        particles,
        pixel_mm,
        voxel_mm,
        interpolation_mm: match truth {
            TrueDisplacement::Field(truth) => Some(interpolation_mm(truth, field)),
            TrueDisplacement::Flow { .. } | TrueDisplacement::Tracks(_) => None,
        },
        uncertainty: Coverage::of(&errors),
        pdf: ErrorPdf::of(&errors, &units),
        all: ErrorSummary::of(&errors, voxel_mm, units.clone()),
        measured_only: ErrorSummary::of(&measured_only, voxel_mm, units),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::displacement::truth::Tracks;
    use crate::scores::fixtures::{field, trilinear};
    use glam::DVec3;
    use lf_core::field::NO_DATA;

    fn displacement(truth: &Field, field: &Field, pixel_mm: Option<f64>) -> Displacement {
        super::displacement(&TrueDisplacement::Field(Box::new(truth.clone())), field, pixel_mm)
    }

    fn json(score: &Displacement) -> serde_json::Value {
        serde_json::from_str(&serde_json::to_string(score).unwrap()).unwrap()
    }

    #[test]
    fn a_constant_error_is_all_bias() {
        let truth = field([4, 5, 3], |_| [0.02, -0.013, 0.06]);
        let mut measured = field([3, 4, 2], |_| [0.03, -0.013, 0.01]);
        measured.layout.origin_mm[0] += 0.2;
        let score = displacement(&truth, &measured, Some(0.005));
        let found = json(&score);
        assert_eq!((score.all.vectors, score.all.outliers), (24, 0));
        for (key, wanted) in [
            ("bias_u_mm", 0.01),
            ("rms_u_px", 2.0),
            ("bias_u_vox", 1.0),
            ("std_u_px", 0.0),
            ("rms_v_px", 0.0),
            ("bias_w_mm", -0.05),
            ("bias_w_px", -10.0),
            ("median_abs_w_vox", 0.5),
        ] {
            assert!((found[key].as_f64().unwrap() - wanted).abs() < 1e-5, "{key} is {}", found[key]);
            assert!((found["measured_only"][key].as_f64().unwrap() - wanted).abs() < 1e-5, "{key}");
        }
        assert_eq!(score.all.rms_px().map(|rms| rms[2].round()), Some(10.0));
        assert_eq!(score.all.bias_px().map(|bias| bias[2].round()), Some(-10.0));
        // 2 px in bins of 0.05 px, -10 px in bins of 0.5 px.
        assert_eq!((found["truth"].as_str(), found["pdf"]["unit"].as_str()), (Some("field"), Some("px")));
        for (x, density, place, wanted) in [("x_u", "u", 2.0, 20.0), ("x_w", "w", -10.0, 2.0)] {
            let bins = found["pdf"][x].as_array().unwrap();
            let bin = bins.iter().position(|bin| bin.as_f64() == Some(place)).unwrap();
            assert_eq!(found["pdf"][density][bin].as_f64(), Some(wanted), "{density}");
        }
    }

    #[test]
    fn a_truth_of_another_layout_is_interpolated() {
        let truth = field([5, 6, 4], trilinear);
        let mut measured = field([3, 3, 2], |_| [0.0; 3]);
        measured.layout.origin_mm = [-0.83, 0.61, -2.4];
        for at in 0..measured.len() {
            let vector = trilinear(measured.place_mm(at)).map(|component| component as f32);
            [measured.u[at], measured.v[at], measured.w[at]] = vector;
        }
        let score = displacement(&truth, &measured, None);
        assert_eq!(score.all.vectors, 18);
        assert!(score.all.spread_mm.iter().all(|spread| spread.rms < 1e-6));
    }

    #[test]
    fn every_vector_is_counted_once() {
        let truth = field([4, 5, 3], |_| [0.0; 3]);
        let mut measured = field([4, 5, 3], |_| [0.0; 3]);
        measured.layout.origin_mm[2] += 2.0;
        measured.flag[..5].copy_from_slice(&[NO_DATA, NO_DATA, REPLACED, MEASURED, NO_DATA]);
        measured.u[2] = 1.0;
        measured.v[0] = f32::NAN;
        let score = displacement(&truth, &measured, None);
        assert_eq!((score.places, score.measured, score.replaced, score.no_data), (60, 56, 1, 3));
        assert_eq!((score.outside_truth, score.all.vectors), (20, 37));
        assert_eq!((score.measured_only.vectors, score.all.outliers, score.measured_only.outliers), (36, 1, 0));
        assert_eq!(score.measured_only.spread_mm[0].rms, 0.0);
        assert!((score.all.spread_mm[0].rms - (1.0f64 / 37.0).sqrt()).abs() < 1e-12);
        assert!(json(&score).get("rms_u_px").is_none());
    }

    #[test]
    fn an_outlier_is_beyond_the_sigmas_and_beyond_the_floor() {
        // Voxels of 0.01 mm: a floor of 0.001 mm. Errors in u of -2 to 2 steps have a robust sigma of 1.4826 steps.
        let truth = field([5, 5, 4], |_| [0.0; 3]);
        let outliers = |step: f32, wild: f32| {
            let mut measured = truth.clone();
            measured.u.iter_mut().enumerate().for_each(|(at, u)| *u = step * (at as f32 % 5.0 - 2.0));
            measured.u[12] = wild;
            displacement(&truth, &measured, None).all.outliers
        };
        assert_eq!((outliers(1e-3, 7.3e-3), outliers(1e-3, 7.6e-3)), (0, 1));
        assert_eq!((outliers(1e-5, 9e-4), outliers(1e-5, -1.1e-3)), (0, 1));
    }

    #[test]
    fn a_score_of_no_vector_is_null_and_valid_json() {
        let truth = field([4, 5, 3], |_| [0.0; 3]);
        let mut measured = field([4, 5, 3], |_| [0.0; 3]);
        measured.flag.fill(NO_DATA);
        let score = displacement(&truth, &measured, Some(0.0055));
        let found = json(&score);
        assert_eq!((score.all.vectors, score.no_data), (0, 60));
        assert!(found["rms_w_px"].is_null() && found["measured_only"]["bias_u_mm"].is_null());
        assert!(score.all.rms_px().unwrap()[0].is_nan() && score.all.outlier_share().is_nan());
        assert!(found["pdf"]["u"][80].is_null() && found["uncertainty"]["within_1_v"].is_null());
    }

    #[test]
    fn particles_are_counted_and_the_field_is_judged_at_them() {
        let mut measured = field([4, 5, 3], |_| [0.01, 0.0, 0.0]);
        measured.flag[0] = NO_DATA;
        measured.flag[59] = REPLACED;
        measured.su.fill(0.02);
        let mid_mm = [[-0.9, 0.6, -2.9], [0.0, 1.0, 0.0], [0.4, 1.4, 0.9], [9.0, 1.0, 0.0]].map(DVec3::from).to_vec();
        let truth = TrueDisplacement::Tracks(Tracks { displacement_mm: vec![DVec3::ZERO; 4], mid_mm, unpaired: 2 });
        let score = super::displacement(&truth, &measured, None);
        assert_eq!(score.particles, Some(ParticleCounts { particles: 4, unpaired: 2, outside_field: 2 }));
        assert_eq!((score.outside_truth, score.all.vectors, score.measured_only.vectors), (0, 2, 1));
        assert_eq!((score.uncertainty.stated[0], score.uncertainty.within_1[0]), (1, 1.0));
        let found = json(&score);
        assert_eq!((&found["truth"], &found["unpaired"]), (&"tracks".into(), &2.into()));
        assert!((found["bias_u_mm"].as_f64().unwrap() - 0.01).abs() < 1e-8);
    }
}
