//! Matches the particles that several cameras found, each alone, and merges them into one list.

use crate::particle::{FoundParticle, Particle};
use glam::{DMat3, DVec3};
use lf_core::camera::Pose;
use lf_core::statistics::upper_median;
use rayon::prelude::*;

/// Largest distance of a pair, standard deviations.
const GATE: f64 = 4.0;
/// Uncertainty of the pose when particles are matched, and the smallest uncertainty of a place when two are averaged:
/// pixels of the focal plane.
const POSE_PX: f64 = 2.0;
const MODEL_PX: f64 = 0.05;

/// A particle in a frame, with the covariance of its place, mm^2.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    place: DVec3,
    light: f64,
    log_size: f64,
    covariance: DMat3,
}

/// The particles that a camera found, in the frame from which `pose` leads to the camera's own.
pub(crate) fn placed(found: &[FoundParticle], pose: &Pose) -> Vec<Placed> {
    let back = pose.matrix().transpose();
    let one = |found: &FoundParticle| {
        let [xx, xy, xz, yy, yz, zz] = found.covariance_mm2;
        let covariance = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let place = DVec3::from(pose.to_common(found.particle.place_mm));
        let Particle { light, log_size, .. } = found.particle;
        Placed { place, light, log_size, covariance: back * covariance * back.transpose() }
    };
    found.iter().map(one).collect()
}

/// Pairs of a particle of each list, by their numbers, the nearest first.
fn pairs(a: &[Placed], b: &[Placed], pixel_mm: f64) -> Vec<(usize, usize)> {
    let floor = DMat3::from_diagonal(DVec3::splat((POSE_PX * pixel_mm).powi(2)));
    let near = |(i, one): (usize, &Placed)| -> Vec<(f64, usize, usize)> {
        let far = |other: &Placed| {
            let between = other.place - one.place;
            let sum = one.covariance + other.covariance + floor;
            let is_far = (0..3).any(|k| between[k].powi(2) > GATE * GATE * sum.col(k)[k]);
            (!is_far).then(|| between.dot(sum.inverse() * between)).filter(|square| *square < GATE * GATE)
        };
        b.iter().enumerate().filter_map(|(j, other)| far(other).map(|square| (square, i, j))).collect()
    };
    let mut all: Vec<(f64, usize, usize)> = a.par_iter().enumerate().flat_map_iter(near).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut is_taken, mut is_used) = (vec![false; a.len()], vec![false; b.len()]);
    all.retain(|(_, i, j)| {
        let is_free = !is_taken[*i] && !is_used[*j];
        (is_taken[*i], is_used[*j]) = (true, true);
        is_free
    });
    all.into_iter().map(|(_, i, j)| (i, j)).collect()
}

/// Pairs that two lists share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shared {
    /// Light of a particle in the second list over that in the first.
    pub(crate) light: f64,
    pub(crate) pairs: usize,
}

/// Adds the particles that another camera found. Each pair becomes one particle, at the mean weighted by the
/// covariances. None without pairs.
pub(crate) fn merge(list: &mut Vec<Placed>, other: &[Placed], pixel_mm: f64) -> Option<Shared> {
    let pairs = pairs(list, other, pixel_mm);
    let mut ratios: Vec<f64> = pairs.iter().map(|(i, j)| other[*j].light / list[*i].light).collect();
    let light = upper_median(&mut ratios)?;
    let floor = DMat3::from_diagonal(DVec3::splat((MODEL_PX * pixel_mm).powi(2)));
    let mut is_alone = vec![true; other.len()];
    for (i, j) in &pairs {
        is_alone[*j] = false;
        let (own, more) = (&mut list[*i], &other[*j]);
        let (a, b) = ((own.covariance + floor).inverse(), (more.covariance + floor).inverse());
        let covariance = (a + b).inverse();
        own.place = covariance * (a * own.place + b * more.place);
        own.covariance = covariance;
    }
    let alone = other.iter().zip(is_alone).filter(|(_, is_alone)| *is_alone);
    list.extend(alone.map(|(placed, _)| Placed { light: placed.light / light, ..*placed }));
    Some(Shared { light, pairs: pairs.len() })
}

/// The particles themselves.
pub(crate) fn particles(list: &[Placed]) -> Vec<Particle> {
    let particle = |placed: &Placed| Particle {
        place_mm: placed.place.to_array(),
        light: placed.light,
        log_size: placed.log_size,
    };
    list.iter().map(particle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cameras at 90 degrees about y, each of which knows its own depth badly: the merged place has both.
    #[test]
    fn a_pair_takes_what_each_camera_knows() {
        let pose =
            Pose { rotation: [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], translation_mm: [0.0, 0.1, 0.0] };
        let found = |place_mm: [f64; 3], light: f64| FoundParticle {
            particle: Particle::new(place_mm, light),
            covariance_mm2: [1e-8, 0.0, 0.0, 1e-8, 0.0, 1e-2],
            light_std: 1.0,
        };
        let truth = [0.3, -0.4, 1.2];
        let [x, y, z] = truth;
        let [a, b, c] = pose.to_camera(truth);
        let mut list = placed(&[found([x, y, z + 0.1], 100.0), found([2.0, 2.0, 2.0], 90.0)], &Pose::default());
        let other = placed(&[found([5.0, 5.0, 5.0], 40.0), found([a, b, c - 0.1], 50.0)], &pose);
        assert_eq!(merge(&mut list, &other, 0.0055), Some(Shared { light: 0.5, pairs: 1 }));
        let merged = particles(&list);
        assert_eq!(merged.len(), 3);
        (0..3).for_each(|k| assert!((merged[0].place_mm[k] - truth[k]).abs() < 1e-5, "{merged:?}"));
        assert_eq!((merged[0].light, merged[2].light), (100.0, 80.0));
        assert_eq!(merge(&mut list[1..2].to_vec(), &other[1..], 0.0055), None);
    }
}
