//! Recall, ghosts, errors and coverage.

use super::matches::matches;
use crate::scores::distribution::{ErrorSpread, root_mean};
use crate::scores::units::AXES;
use lf_core::Particle;
use lf_core::statistics::median;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// The score of a list of found particles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParticleScore {
    /// Half of the box of a match along x, y, z before uncertainties widen it, mm.
    pub box_mm: [f64; 3],
    /// Light of a found particle over that of the true one: the median. Errors of the light are about it.
    pub gain: f64,
    /// All particles.
    #[serde(flatten)]
    pub all: Accuracy,
    /// Particles between two distances from the focal plane.
    pub by_depth: Vec<Slab>,
}

/// The particles between two distances from the focal plane.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Slab {
    /// The distances, mm.
    pub z_mm: [f64; 2],
    /// The score of these particles.
    #[serde(flatten)]
    pub accuracy: Accuracy,
}

/// The score of some particles. In JSON a number without data is null.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Accuracy {
    /// True particles, found particles, and particles that are both.
    pub counts: [usize; 3],
    /// Errors, mm, and standard uncertainties, mm, if stated, of each match.
    errors: Vec<([f64; 3], Option<[f64; 3]>)>,
    /// Relative error and standard uncertainty of the light of each match.
    light: Vec<(f64, Option<f64>)>,
    pixel_mm: Option<f64>,
}

impl Accuracy {
    /// Share of the true particles that are found.
    pub fn recall(&self) -> Option<f64> {
        let [truth, _, both] = self.counts;
        (truth > 0).then(|| both as f64 / truth as f64)
    }

    /// Share of the found particles that are not true.
    pub fn ghosts(&self) -> Option<f64> {
        let [_, found, both] = self.counts;
        (found > 0).then(|| (found - both) as f64 / found as f64)
    }

    /// Root mean square error along an axis, mm. None without a match.
    pub fn rms_mm(&self, axis: usize) -> Option<f64> {
        mean(self.errors.iter().map(|(error, _)| error[axis].powi(2))).map(f64::sqrt)
    }

    /// Share of the errors along an axis within `sigmas` stated uncertainties. None without stated uncertainties.
    pub fn within(&self, axis: usize, sigmas: f64) -> Option<f64> {
        within(self.errors.iter().filter_map(|(error, std)| Some((error[axis], (*std)?[axis]))), sigmas)
    }
}

/// Share of errors within `sigmas` of their standard uncertainty. None without an error.
fn within(pairs: impl Iterator<Item = (f64, f64)>, sigmas: f64) -> Option<f64> {
    mean(pairs.map(|(error, std)| (error.abs() <= sigmas * std) as u8 as f64))
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    values.for_each(|value| (sum, count) = (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

impl Serialize for Accuracy {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        let [truth, found, both] = self.counts;
        for (key, count) in [("truth", truth), ("found", found), ("matched", both)] {
            map.serialize_entry(key, &count)?;
        }
        map.serialize_entry("recall", &self.recall())?;
        map.serialize_entry("ghosts", &self.ghosts())?;
        for (axis, name) in AXES.iter().enumerate() {
            let errors: Vec<f64> = self.errors.iter().map(|(error, _)| error[axis]).collect();
            let ErrorSpread { bias, rms, median_abs, p90, .. } = ErrorSpread::of(&errors);
            let stated = root_mean(self.errors.iter().filter_map(|(_, std)| Some((*std)?[axis].powi(2))));
            let units = [("mm", Some(1.0)), ("px", self.pixel_mm)];
            for (unit, length_mm) in units.into_iter().filter_map(|(unit, length)| Some((unit, length?))) {
                let numbers =
                    [("rms", rms), ("bias", bias), ("median_abs", median_abs), ("p90", p90), ("rms_stated", stated)];
                for (what, mm) in numbers {
                    map.serialize_entry(&format!("{what}_{name}_{unit}"), &(mm / length_mm))?;
                }
            }
            for sigmas in [1, 2] {
                map.serialize_entry(&format!("within_{sigmas}_{name}"), &self.within(axis, sigmas.into()))?;
            }
        }
        map.serialize_entry("rms_intensity", &root_mean(self.light.iter().map(|(error, _)| error * error)))?;
        for sigmas in [1.0, 2.0] {
            let stated = self.light.iter().filter_map(|(error, std)| Some((*error, (*std)?)));
            map.serialize_entry(&format!("within_{sigmas}_intensity"), &within(stated, sigmas))?;
        }
        map.end()
    }
}

/// Scores found particles of a frame against the true ones. A match is at most `box_mm`, or three standard
/// uncertainties of the found particle, away along each axis. `depths_mm` are rising distances from the focal plane; a
/// true particle counts at its true depth, a ghost at its own. `pixel_mm` is the side of a pixel at the focal plane.
pub fn particles(
    truth: &[Particle],
    found: &[Particle],
    box_mm: [f64; 3],
    depths_mm: &[f64],
    pixel_mm: Option<f64>,
) -> ParticleScore {
    let pairs = matches(truth, found, box_mm);
    let mut gains: Vec<f64> = pairs.iter().map(|&(t, n)| found[n].intensity / truth[t].intensity).collect();
    gains.retain(|gain| gain.is_finite() && *gain > 0.0);
    let gain = if gains.is_empty() { 1.0 } else { median(&mut gains) };
    let mut is_match = vec![None; found.len()];
    pairs.iter().for_each(|&(t, n)| is_match[n] = Some(t));

    let of_slab = |low: f64, high: f64| {
        let is_in = |particle: &Particle| (low..high).contains(&particle.place_mm[2].abs());
        let mut score = Accuracy { pixel_mm, ..Accuracy::default() };
        score.counts[0] = truth.iter().filter(|particle| is_in(particle)).count();
        // A match counts at its true depth, whatever depth was found.
        let place = |n: usize| is_match[n].map_or(&found[n], |t| &truth[t]);
        score.counts[1] = (0..found.len()).filter(|n| is_in(place(*n))).count();
        for (true_one, found_one) in pairs.iter().map(|&(t, n)| (&truth[t], &found[n])).filter(|(t, _)| is_in(t)) {
            score.counts[2] += 1;
            let error = [0, 1, 2].map(|axis| found_one.place_mm[axis] - true_one.place_mm[axis]);
            let uncertainty = found_one.uncertainty;
            score.errors.push((error, uncertainty.map(|uncertainty| uncertainty.std_mm().to_array())));
            let expected = gain * true_one.intensity;
            if expected > 0.0 {
                let std = uncertainty.map(|uncertainty| uncertainty.intensity / expected);
                score.light.push((found_one.intensity / expected - 1.0, std));
            }
        }
        score
    };
    let slab = |depths: &[f64]| Slab { z_mm: [depths[0], depths[1]], accuracy: of_slab(depths[0], depths[1]) };
    ParticleScore { box_mm, gain, all: of_slab(0.0, f64::INFINITY), by_depth: depths_mm.windows(2).map(slab).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};
    use lf_core::particles::Uncertainty;
    use serde_json::json;

    fn at(place_mm: [f64; 3], intensity: f64) -> Particle {
        Particle { frame: 0, id: 0, place_mm, intensity, uncertainty: None }
    }

    /// By hand: two of three are found, one of three is a ghost, z is off by 3 and -1 with stated 2 and 2.
    #[test]
    fn a_score_by_hand() {
        let truth = [at([0.0; 3], 10.0), at([1.0, 0.0, 10.0], 20.0), at([2.0, 0.0, -20.0], 10.0)];
        let variance = DVec3::new(1.0, 1.0, 4.0);
        let sure = Uncertainty { covariance_mm2: DMat3::from_diagonal(variance), intensity: 2.0 };
        let fitted = |place: [f64; 3], light: f64| Particle { uncertainty: Some(sure), ..at(place, light) };
        let found = [fitted([0.5, 0.0, 3.0], 22.0), fitted([1.0, 0.0, 9.0], 38.0), fitted([50.0, 0.0, 1.0], 1.0)];
        let score = particles(&truth, &found, [1.0; 3], &[0.0, 5.0, 15.0, 25.0], Some(0.5));
        let value = serde_json::to_value(&score).unwrap();
        assert_eq!((score.all.counts, value["recall"].clone()), ([3, 3, 2], json!(2.0 / 3.0)));
        assert_eq!(value["ghosts"], json!(1.0 / 3.0));
        assert_eq!([&value["rms_z_mm"], &value["bias_z_px"]], [&json!(5f64.sqrt()), &json!(2.0)]);
        assert_eq!([&value["within_1_z"], &value["within_2_z"]], [&json!(0.5), &json!(1.0)]);
        // Gains 2.2 and 1.9: about 2.05 the light is off by 0.15 / 2.05, more than 2 / 20.5 and 2 / 41 twice.
        assert!((score.gain - 2.05).abs() < 1e-12);
        assert!((value["rms_intensity"].as_f64().unwrap() - 0.15 / 2.05).abs() < 1e-12);
        assert_eq!([&value["within_1_intensity"], &value["within_2_intensity"]], [&json!(0.5), &json!(1.0)]);
        let counts: Vec<[usize; 3]> = score.by_depth.iter().map(|slab| slab.accuracy.counts).collect();
        assert_eq!(counts, [[1, 2, 1], [1, 1, 1], [1, 0, 0]]);
        assert_eq!(value["by_depth"][2]["rms_x_mm"], json!(null));
    }
}
