//! Scores that a benchmark asks beside the scores of particles and fields: tracks, errors over the bound, resolution.

use super::displacement::TrueDisplacement;
use super::distribution::ErrorSpread;
use super::particles::matches;
use super::units::{AXES, COMPONENTS};
use glam::DVec3;
use lf_core::field::{Field, NO_DATA};
use lf_core::{Particle, statistics::median};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use std::collections::HashMap;

/// Distance along x that keeps frames apart, mm.
const APART_MM: f64 = 1e4;

/// The particles of many frames as those of one: each frame has its own place along x, so that none matches a particle
/// of another.
pub fn apart(particles: &[Particle]) -> Vec<Particle> {
    let aside = |particle: &Particle| {
        let [x, y, z] = particle.place_mm;
        Particle { place_mm: [x + APART_MM * particle.frame as f64, y, z], ..*particle }
    };
    particles.iter().map(aside).collect()
}

/// Standard deviations of particles that no unbiased method goes below, by depth, as `lf-validate precision` prints
/// them.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Bound {
    /// Middles of slabs of equal depth, mm, rising.
    pub z_mm: Vec<f64>,
    /// The deviation of x, mm; None where the image does not determine it.
    pub sx_mm: Vec<Option<f64>>,
    /// The deviation of y, mm.
    pub sy_mm: Vec<Option<f64>>,
    /// The deviation of z, mm.
    pub sz_mm: Vec<Option<f64>>,
}

/// Standard deviation over median absolute value of a normal distribution.
const SIGMA_OF_MEDIAN: f64 = 1.4826;

/// Errors of the matched particles along x, y and z over the bound at their depth, 1 for a method that reaches it: by
/// the median of the absolute values. None without a match where there is a bound.
pub fn over_bound(truth: &[Particle], found: &[Particle], box_mm: [f64; 3], bound: &Bound) -> [Option<f64>; 3] {
    let pairs = matches(truth, found, box_mm);
    let nearest =
        |z: f64| (0..bound.z_mm.len()).min_by(|a, b| (bound.z_mm[*a] - z).abs().total_cmp(&(bound.z_mm[*b] - z).abs()));
    [0, 1, 2].map(|axis| {
        let std = [&bound.sx_mm, &bound.sy_mm, &bound.sz_mm][axis];
        let ratio = |(t, n): &(usize, usize)| {
            let least = (*std.get(nearest(truth[*t].place_mm[2])?)?)?;
            Some((found[*n].place_mm[axis] - truth[*t].place_mm[axis]).abs() / least)
        };
        let mut ratios: Vec<f64> = pairs.iter().filter_map(ratio).collect();
        (!ratios.is_empty()).then(|| SIGMA_OF_MEDIAN * median(&mut ratios))
    })
}

/// The score of tracks: particles that are followed from a frame to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackScore {
    /// True steps from frame to frame, found steps, and steps that are both.
    pub counts: [usize; 3],
    /// Errors of the middle of a step along x, y, z, then of the displacement.
    spread_mm: [ErrorSpread; 6],
    pixel_mm: f64,
}

impl Serialize for TrackScore {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        let [truth, found, both] = self.counts;
        let share = |part: usize, whole: usize| (whole > 0).then(|| part as f64 / whole as f64);
        for (key, count) in [("truth", truth), ("found", found), ("matched", both)] {
            map.serialize_entry(key, &count)?;
        }
        map.serialize_entry("recall", &share(both, truth))?;
        map.serialize_entry("ghosts", &share(found - both, found))?;
        for (name, spread) in AXES.iter().chain(&COMPONENTS).zip(&self.spread_mm) {
            for (what, mm) in spread.entries() {
                map.serialize_entry(&format!("{what}_{name}_px"), &(mm / self.pixel_mm))?;
            }
        }
        map.end()
    }
}

/// Steps of tracks from each frame to the next: the middle as a place, and the displacement.
fn steps(particles: &[Particle]) -> (Vec<Particle>, Vec<DVec3>) {
    let key = |particle: &Particle| (particle.frame, particle.id);
    let places: HashMap<(usize, u64), DVec3> = particles.iter().map(|p| (key(p), p.place_mm.into())).collect();
    let step = |particle: &Particle| {
        let (from, to) = (DVec3::from(particle.place_mm), places.get(&(particle.frame + 1, particle.id))?);
        let middle = Particle { place_mm: (0.5 * (from + *to)).into(), uncertainty: None, ..*particle };
        Some((middle, *to - from))
    };
    let (middles, displacements): (Vec<Particle>, Vec<DVec3>) = particles.iter().filter_map(step).unzip();
    (apart(&middles), displacements)
}

/// Scores tracks. A step is right if both its ends are in the box about those of one true step.
pub fn tracks(truth: &[Particle], found: &[Particle], box_mm: [f64; 3], pixel_mm: f64) -> TrackScore {
    let ((true_middle, true_by), (middle, by)) = (steps(truth), steps(found));
    let errors = |&(t, n): &(usize, usize)| {
        let off = DVec3::from(middle[n].place_mm) - DVec3::from(true_middle[t].place_mm);
        let off_by = by[n] - true_by[t];
        let is_in = |end: DVec3| (0..3).all(|axis| end[axis].abs() <= box_mm[axis]);
        (is_in(off - 0.5 * off_by) && is_in(off + 0.5 * off_by)).then_some([off, off_by])
    };
    let all: Vec<[DVec3; 2]> = matches(&true_middle, &middle, box_mm).iter().filter_map(errors).collect();
    let along = |n: usize| all.iter().map(|error| error[n / 3][n % 3]).collect::<Vec<f64>>();
    TrackScore {
        counts: [true_middle.len(), middle.len(), all.len()],
        spread_mm: std::array::from_fn(|n| ErrorSpread::of(&along(n))),
        pixel_mm,
    }
}

/// Sides of cubes that are tried, in the field's longest extent.
const SIDES: usize = 24;
/// Places and weights of a Gaussian quadrature along a side of 1.
const QUADRATURE: [(f64, f64); 3] =
    [(-0.387_298_334_620_741_7, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.387_298_334_620_741_7, 5.0 / 18.0)];
/// A flow whose means over all cubes are as near to the field as this, relatively, says nothing of resolution.
const ALIKE: f64 = 1e-3;

/// Effective resolution of a field, mm: the side of the cube over which the mean of the true flow is nearest to the
/// field. Up to half of the field's longest extent. None if the truth is no flow, or one without structure.
pub fn resolution_mm(truth: &TrueDisplacement, field: &Field) -> Option<f64> {
    let TrueDisplacement::Flow { velocity, interval } = truth else { return None };
    let vectors: Vec<usize> = (0..field.len()).filter(|at| field.flag[*at] != NO_DATA).collect();
    let extent = |axis: usize| field.layout.bounds_mm(axis)[1] - field.layout.bounds_mm(axis)[0];
    let longest = (0..3).map(extent).fold(0.0, f64::max);
    let far_from_mean = |side: f64| {
        let mut means = vec![DVec3::ZERO; vectors.len()];
        for n in 0..27 {
            let [x, y, z] = [n % 3, n / 3 % 3, n / 9].map(|n| QUADRATURE[n]);
            let aside = side * DVec3::new(x.0, y.0, z.0);
            let places: Vec<[f64; 3]> =
                vectors.iter().map(|at| (DVec3::from(field.place_mm(*at)) + aside).to_array()).collect();
            let moved = velocity.displacements_mm(&places, *interval);
            means.iter_mut().zip(moved).for_each(|(mean, by)| *mean += x.1 * y.1 * z.1 * DVec3::from(by));
        }
        vectors.iter().zip(means).map(|(at, mean)| (field.displacement_mm(*at) - mean).length_squared()).sum::<f64>()
    };
    let tried: Vec<(f64, f64)> = (0..SIDES)
        .map(|n| 0.5 * longest * n as f64 / (SIDES - 1) as f64)
        .map(|side| (side, far_from_mean(side)))
        .collect();
    let (best, least) = tried.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let most = tried.iter().fold(0.0, |most: f64, (_, sum)| most.max(*sum));
    (most - least > ALIKE * most).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::field;
    use lf_core::flow::Flows;

    fn at(frame: usize, id: u64, place_mm: [f64; 3]) -> Particle {
        Particle { frame, id, place_mm, intensity: 1.0, uncertainty: None }
    }

    #[test]
    fn errors_count_by_the_bound_of_their_depth_and_within_their_frame() {
        let bound = Bound {
            z_mm: vec![-1.0, 1.0],
            sx_mm: vec![Some(0.1), Some(0.01)],
            sy_mm: vec![Some(0.1), None],
            sz_mm: vec![None, None],
        };
        let truth = apart(&[at(0, 0, [0.0, 0.0, -1.2]), at(1, 0, [0.0, 0.0, 0.7]), at(1, 1, [5.0, 0.0, 0.0])]);
        let found = apart(&[at(0, 8, [0.1, 0.2, -1.0]), at(1, 9, [0.01, 0.0, 1.0]), at(0, 7, [5.0, 0.0, 0.0])]);
        let [x, y, z] = over_bound(&truth, &found, [0.5; 3], &bound);
        assert!((x.unwrap() - 1.4826).abs() < 1e-6 && (y.unwrap() - 2.0 * 1.4826).abs() < 1e-6, "{x:?} {y:?}");
        assert_eq!(z, None);
    }

    /// Three true steps: one is found, one is a wrong link, one is missed.
    #[test]
    fn a_step_needs_both_ends() {
        let step = |id: u64, from: f64, by: f64| [at(0, id, [from, 0.0, 0.0]), at(1, id, [from + by, 0.0, 0.0])];
        let truth = [step(0, 0.0, 0.1), step(1, 5.0, 0.1), step(2, 9.0, 0.1)].concat();
        let found = [step(7, 0.02, 0.12), step(8, 5.0, 0.3), step(9, 50.0, 0.0)].concat();
        let score = tracks(&truth, &found, [0.15, 0.1, 0.1], 0.01);
        assert_eq!(score.counts, [3, 3, 1]);
        let value = serde_json::to_value(&score).unwrap();
        assert!((value["rms_x_px"].as_f64().unwrap() - 3.0).abs() < 1e-9, "{value}");
        assert!((value["rms_u_px"].as_f64().unwrap() - 2.0).abs() < 1e-9, "{value}");
    }

    /// A field that is the mean of a wave over 0.6 mm has this resolution; a uniform flow has none.
    #[test]
    fn a_mean_over_a_cube_is_found() {
        let flow = |text: &str| {
            let flows: Flows = serde_json::from_str(text).unwrap();
            TrueDisplacement::Flow { velocity: flows.velocity(Vec::new(), [[-1.0, 1.0]; 3], 0.01), interval: 1.0 }
        };
        let wave = flow(r#"{"kind": "taylor-green", "wavelength_mm": 2.0, "displacement_mm": 0.001}"#);
        let side = 0.6 * std::f64::consts::PI / 2.0;
        let damped = |x: f64| (side.sin() / side).powi(3) * 0.001 * x;
        let wavenumber = std::f64::consts::PI;
        let measured = field([4, 5, 3], |[x, y, z]| {
            let [x, y, z] = [x, y, z].map(|mm| wavenumber * mm);
            [damped(x.sin() * y.cos() * z.cos()), damped(-x.cos() * y.sin() * z.cos()), 0.0]
        });
        let found = resolution_mm(&wave, &measured).unwrap();
        assert!((found - 0.6).abs() < 0.1, "{found}");
        let uniform = flow(r#"{"kind": "uniform", "displacement_mm": [0.01, 0, 0]}"#);
        assert_eq!(resolution_mm(&uniform, &measured), None);
    }
}
