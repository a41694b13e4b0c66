//! How far measured vectors lie from the true displacement.
//!
//! Error = measured - true, each component on its own, in the units of [`crate::scores::units`].

use crate::scores::displacement::coverage::Coverage;
use crate::scores::displacement::truth::{Sample, Truth, samples};
use crate::scores::pdf::Pdf;
use crate::scores::spread::Spread;
use crate::scores::units::{COMPONENTS, Unit, units};
use lf_core::field::{Field, MEASURED, REPLACED};
use lf_core::statistics::robust;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// An error is an outlier beyond this many robust standard deviations from the median error of its component: one vector
/// in two million of a normal distribution.
pub const OUTLIER_SIGMAS: f64 = 5.0;

/// ... and beyond this many voxels: what correlation leaves of uncertainty in good data, below which no vector is wild
/// however tight the others lie.
pub const OUTLIER_FLOOR_VOX: f64 = 0.1;

/// The score of a measured field against the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Displacement {
    /// What the truth is known from: `field`, `flow` or `tracks`.
    pub truth: &'static str,
    /// Vectors of the measured field.
    pub places: usize,
    /// Vectors flagged measured.
    pub measured: usize,
    /// Vectors flagged replaced.
    pub replaced: usize,
    /// Vectors without data.
    pub no_data: usize,
    /// Measured or replaced vectors for which there is no truth: outside its hull or beside one of its gaps. Not scored.
    pub outside_truth: usize,
    /// The particles, where they are the truth.
    #[serde(flatten)]
    pub particles: Option<Particles>,
    /// A pixel at the focal plane, mm; absent without a camera, and then so is every `px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_mm: Option<f64>,
    /// Voxel spacing of the volumes correlated, mm.
    pub voxel_mm: [f64; 3],
    /// All that are scored.
    #[serde(flatten)]
    pub all: Errors,
    /// Measured vectors alone.
    pub measured_only: Errors,
    /// Whether the stated uncertainty holds, of measured vectors.
    pub uncertainty: Coverage,
    /// Density of the errors of all that are scored; none in voxels that have no size.
    pub pdf: Option<Pdf>,
}

/// Particles that are the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Particles {
    /// Particles in both frames.
    pub particles: usize,
    /// Particles in one of the frames only. Not scored.
    pub unpaired: usize,
    /// Particles in both frames that lie outside the field's vectors or beside one of its gaps. Not scored.
    pub outside_field: usize,
}

/// Errors of a set of vectors, or of particles. In JSON one key for each of bias, rms, std and median_abs, component and
/// unit: `rms_u_px`.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// Vectors scored; with particles, particles.
    pub vectors: usize,
    /// Those with a component beyond [`OUTLIER_SIGMAS`] and [`OUTLIER_FLOOR_VOX`]. They stay in every other number.
    pub outliers: usize,
    /// Spread of each component, mm.
    pub spread_mm: [Spread; 3],
    units: Vec<Unit>,
}

/// Scores `field` against `truth`; `pixel_mm` is a pixel at the focal plane.
pub fn displacement(truth: &Truth, field: &Field, pixel_mm: Option<f64>) -> Displacement {
    let voxel_mm = field.layout.voxel_mm;
    let flagged = |flag: f32| field.flag.iter().filter(|found| **found == flag).count();
    let (measured, replaced) = (flagged(MEASURED), flagged(REPLACED));
    let (samples, outside) = samples(truth, field);
    let particles = match truth {
        Truth::Tracks(tracks) => {
            let (particles, unpaired) = (tracks.mid_mm.len(), tracks.unpaired);
            Some(Particles { particles, unpaired, outside_field: outside })
        }
        Truth::Field(_) | Truth::Flow { .. } => None,
    };
    let units = units(voxel_mm, pixel_mm);
    let measured_only: Vec<Sample> = samples.iter().copied().filter(|sample| sample.is_measured).collect();
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
        uncertainty: Coverage::of(&samples),
        pdf: Pdf::of(&samples, &units),
        all: Errors::of(&samples, voxel_mm, units.clone()),
        measured_only: Errors::of(&measured_only, voxel_mm, units),
    }
}

impl Errors {
    fn of(samples: &[Sample], voxel_mm: [f64; 3], units: Vec<Unit>) -> Self {
        let of_axis = |axis: usize| samples.iter().map(|sample| sample.error_mm[axis]).collect::<Vec<f64>>();
        let components = [0, 1, 2].map(of_axis);
        let limits = [0, 1, 2].map(|axis| {
            let (centre, sigma) = robust(&components[axis]);
            (centre, (OUTLIER_SIGMAS * sigma).max(OUTLIER_FLOOR_VOX * voxel_mm[axis]))
        });
        let wild =
            |sample: &&Sample| (0..3).any(|axis| (sample.error_mm[axis] - limits[axis].0).abs() > limits[axis].1);
        Self {
            vectors: samples.len(),
            outliers: samples.iter().filter(wild).count(),
            spread_mm: components.map(|component| Spread::of(&component)),
            units,
        }
    }

    /// The RMS error of each component in pixels; none without a pixel's size, NaN without vectors.
    pub fn rms_px(&self) -> Option<[f64; 3]> {
        self.px(|spread| spread.rms)
    }

    /// The mean error of each component in pixels; none without a pixel's size, NaN without vectors.
    pub fn bias_px(&self) -> Option<[f64; 3]> {
        self.px(|spread| spread.bias)
    }

    /// Share of the vectors that are outliers; NaN without vectors.
    pub fn outlier_share(&self) -> f64 {
        self.outliers as f64 / self.vectors as f64
    }

    fn px(&self, number: fn(&Spread) -> f64) -> Option<[f64; 3]> {
        let (_, per) = self.units.iter().find(|(unit, _)| *unit == "px")?;
        Some([0, 1, 2].map(|axis| number(&self.spread_mm[axis]) / per[axis]))
    }
}

impl Serialize for Errors {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("vectors", &self.vectors)?;
        map.serialize_entry("outliers", &self.outliers)?;
        for (unit, per_mm) in &self.units {
            for (name, number) in [
                ("bias", (|spread| spread.bias) as fn(&Spread) -> f64),
                ("rms", |spread| spread.rms),
                ("std", |spread| spread.std),
                ("median_abs", |spread| spread.median_abs),
            ] {
                for axis in 0..3 {
                    let key = format!("{name}_{}_{unit}", COMPONENTS[axis]);
                    map.serialize_entry(&key, &(number(&self.spread_mm[axis]) / per_mm[axis]))?;
                }
            }
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::displacement::tracks::Tracks;
    use crate::scores::displacement::trilinear::tests::{field, trilinear};
    use lf_core::field::NO_DATA;

    fn displacement(truth: &Field, field: &Field, pixel_mm: Option<f64>) -> Displacement {
        super::displacement(&Truth::Field(Box::new(truth.clone())), field, pixel_mm)
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
    fn truth_of_another_layout_is_interpolated() {
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
    fn nothing_to_score_is_null_and_valid_json() {
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
        let mid_mm = vec![[-0.9, 0.6, -2.9], [0.0, 1.0, 0.0], [0.4, 1.4, 0.9], [9.0, 1.0, 0.0]];
        let truth = Truth::Tracks(Tracks { displacement_mm: vec![[0.0; 3]; 4], mid_mm, unpaired: 2 });
        let score = super::displacement(&truth, &measured, None);
        assert_eq!(score.particles, Some(Particles { particles: 4, unpaired: 2, outside_field: 2 }));
        assert_eq!((score.outside_truth, score.all.vectors, score.measured_only.vectors), (0, 2, 1));
        assert_eq!((score.uncertainty.stated[0], score.uncertainty.within_1[0]), (1, 1.0));
        let found = json(&score);
        assert_eq!((&found["truth"], &found["unpaired"]), (&"tracks".into(), &2.into()));
        assert!((found["bias_u_mm"].as_f64().unwrap() - 0.01).abs() < 1e-8);
    }
}
