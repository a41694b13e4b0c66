//! Whether the parts of a particle's image agree on its place. Noise lets them differ by as much as the uncertainty
//! says. An error of the model reaches over many pixels, and makes them differ by more.
//!
//! Equation: the covariance of a fit whose model is wrong (Huber 1967, White 1982), by sums over parts of the image.

use crate::cameras::view::Cameras;
use crate::model::particle_image::{COUNTS, ParticleImage, UNKNOWNS};
use crate::model::window::Window;
use crate::particle::FoundParticle;
use glam::{DMat4, DVec2, DVec4};
use lf_core::statistics::{median, upper_median};
use std::f64::consts::TAU;

/// Parts of the image in a camera: a disc and the ring about it, which hold the same area, by directions.
const DIRECTIONS: usize = 8;
const PARTS: usize = 2 * DIRECTIONS;
/// Fewer parts with light say nothing.
const FEWEST: usize = 12;
/// Particles next to each other in depth err alike. Fewer particles say nothing.
const ALIKE: usize = 50;
/// Median of the square of a pull over its mean: noise of some twelve independent parts.
const MEDIAN: f64 = 0.94;
/// The median of [`ALIKE`] such squares, over noise, is within this: three standard deviations.
const BY_CHANCE: f64 = 1.22;
/// A particle whose parts pull by more than this, in variances, is wrong by itself: noise does so once in a thousand.
const ALONE: f64 = 3.0;

/// How far the parts of an image pull its place apart, along x, y and z: sums of squares, over the variance of the
/// place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pull {
    pub(crate) found: [f64; 3],
    /// By noise alone.
    pub(crate) expected: [f64; 3],
}

/// Gradient and information of the unknowns from a part of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    gradient: DVec4,
    information: DMat4,
}

/// A part without light.
const DARK: Part = Part { gradient: DVec4::ZERO, information: DMat4::ZERO };

impl Pull {
    /// The pull of a particle. None if its image has too few parts, as it has in focus.
    pub(crate) fn new(image: &ParticleImage, window: &Window, cameras: &Cameras) -> Option<Self> {
        let at = |n: usize| {
            let camera = window.camera_of(n);
            let n = n - window.parts[camera].start;
            (camera, DVec2::new((n % window.columns) as f64, (n / window.columns) as f64))
        };

        // Light, its centre, and the mean square of the distance from there, by camera.
        let mut moments = vec![(0.0, DVec2::ZERO, 0.0); window.parts.len()];
        image.pixels(window.columns, |n, pixel| {
            let ((camera, place), light) = (at(n), f64::from(pixel[COUNTS]));
            let (sum, first, second) = &mut moments[camera];
            (*sum, *first, *second) = (*sum + light, *first + light * place, *second + light * place.length_squared());
        });
        for (sum, first, second) in &mut moments {
            *first /= *sum;
            *second = *second / *sum - first.length_squared();
        }

        let mut parts = vec![DARK; PARTS * window.parts.len()];
        image.pixels(window.columns, |n, pixel| {
            let (seen, light) = (window.seen[n], window.light[n]);
            if seen.is_nan() {
                return;
            }
            let (camera, place) = at(n);
            let (_, centre, square) = moments[camera];
            let off = place - centre;
            let direction = (off.y.atan2(off.x) / TAU).rem_euclid(1.0) * DIRECTIONS as f64;
            let ring = usize::from(off.length_squared() > square);
            let part = &mut parts[PARTS * camera + 2 * (direction as usize).min(DIRECTIONS - 1) + ring];
            let weight = f64::from(window.noise(cameras, n).variance(light)).recip();
            let by = DVec4::from_array(pixel.map(f64::from));
            part.gradient += weight * f64::from(seen - light) * by;
            part.information += DMat4::from_cols_array_2d(&by.to_array().map(|v| (weight * v * by).to_array()));
        });
        parts.retain(|part| *part != DARK);
        if parts.len() < FEWEST { None } else { Self::of(&parts) }
    }

    /// The squares of the pulls along x, y and z, over those of noise.
    fn over_noise(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.found[axis] / self.expected[axis])
    }

    fn of(parts: &[Part]) -> Option<Self> {
        let covariance = parts.iter().fold(DMat4::ZERO, |sum, part| sum + part.information).inverse();
        let mut pull = Self { found: [0.0; 3], expected: [0.0; 3] };
        for Part { gradient, information } in parts {
            let pulled = covariance * *gradient;
            // The fit has taken its share of the noise.
            let noise = covariance * (*information - *information * covariance * *information) * covariance;
            for k in 0..UNKNOWNS - 1 {
                let variance = covariance.col(k)[k];
                pull.found[k] += pulled[k].powi(2) / variance;
                pull.expected[k] += noise.col(k)[k] / variance;
            }
        }
        (0..3).all(|k| pull.found[k].is_finite() && pull.expected[k] > 0.0).then_some(pull)
    }
}

/// Factors of the variances of x, y and z of each particle, at least 1, for the pulls of all: those usual at its depth,
/// and its own if these are not noise.
fn widening(pulls: &[(f64, Option<Pull>)]) -> Vec<[f64; 3]> {
    let mut known: Vec<(f64, [f64; 3])> =
        pulls.iter().filter_map(|(z_mm, pull)| Some((*z_mm, pull.as_ref()?.over_noise()))).collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    if known.len() < ALIKE {
        return vec![[1.0; 3]; pulls.len()];
    }
    let factors = |(z_mm, own): &(f64, Option<Pull>)| {
        let after = known.partition_point(|(other_mm, _)| other_mm < z_mm);
        let first = after.saturating_sub(ALIKE / 2).min(known.len() - ALIKE);
        let near = &known[first..first + ALIKE];
        let own = own.map_or([0.0; 3], |pull| pull.over_noise());
        std::array::from_fn(|axis| {
            let usual = median(&mut near.iter().map(|(_, ratios)| ratios[axis]).collect::<Vec<f64>>()) / MEDIAN;
            let own = own[axis];
            let usual = if usual > BY_CHANCE { usual } else { 1.0 };
            if own > ALONE { own.max(usual) } else { usual }
        })
    };
    pulls.iter().map(factors).collect()
}

/// Widens the uncertainties of particles by their pulls, and all variances by at least the factor `least`. Returns the
/// usual factors of the standard uncertainties of x, y and z by the pulls.
pub(crate) fn widen(particles: &mut [FoundParticle], pulls: &[Option<Pull>], least: f64) -> [f64; 3] {
    let depths = particles.iter().map(|found| found.particle.place_mm[2]);
    let factors = widening(&depths.zip(pulls.iter().copied()).collect::<Vec<_>>());
    for (particle, factors) in particles.iter_mut().zip(&factors) {
        particle.widen(factors.map(|factor| factor.max(least)), least);
    }
    std::array::from_fn(|axis| {
        upper_median(&mut factors.iter().map(|factors| factors[axis]).collect::<Vec<f64>>()).map_or(1.0, f64::sqrt)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four parts, each of which says as much of x, y, z and light. Two pull x apart, and two y.
    #[test]
    fn a_pull_by_hand() {
        let part = |gradient: [f64; 4]| Part { gradient: gradient.into(), information: DMat4::IDENTITY };
        let [x, y] = [2.0, 1.0];
        let parts =
            [part([x, 0.0, 0.0, 0.0]), part([-x, 0.0, 0.0, 0.0]), part([0.0, y, 0.0, 0.0]), part([0.0, -y, 0.0, 0.0])];
        let pull = Pull::of(&parts).unwrap();
        // The variance of each unknown is 1 / 4. Two parts move x by 2 / 4, and noise moves each part by a variance of
        // 1 / 16, of which the fit takes a quarter.
        assert_eq!(pull.found, [2.0, 0.5, 0.0]);
        assert_eq!(pull.expected, [0.75; 3]);
    }

    #[test]
    fn usual_pulls_widen_the_particles_of_a_depth_and_large_ones_their_own() {
        let pull = |x: f64, z: f64| Some(Pull { found: [x, 0.5, z], expected: [1.0; 3] });
        // Near particles are pulled along z, far ones are not, one far one is pulled along x; two have no parts.
        let mut pulls: Vec<(f64, Option<Pull>)> =
            (0..200).map(|n| (f64::from(n), pull(0.9, if n < 100 { 1.88 } else { 0.94 }))).collect();
        pulls[150].1 = pull(7.0, 1.0);
        (pulls[20].1, pulls[180].1) = (None, None);
        let factors = widening(&pulls);
        for (n, wanted) in [
            (0, [1.0, 1.0, 2.0]),
            (20, [1.0, 1.0, 2.0]),
            (150, [7.0, 1.0, 1.0]),
            (151, [1.0; 3]),
            (180, [1.0; 3]),
            (199, [1.0; 3]),
        ] {
            (0..3).for_each(|k| assert!((factors[n][k] - wanted[k]).abs() < 1e-12, "{n}: {:?}", factors[n]));
        }
        assert_eq!(widening(&pulls[..40]), vec![[1.0; 3]; 40]);
    }
}
