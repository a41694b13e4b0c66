//! Fast rays from one depth: Snell's law as a polynomial, or the closed form of a telecentric lens.
//!
//! Window and medium are symmetric about the axis. So the slope of a ray in the air before the lens is `g offset`,
//! where g depends only on the length of the offset between the point and the place on the lens. A polynomial through
//! a few exact rays gives g.

use crate::Optics;
use crate::optics::{LensShares, TelecentricRays};
use glam::DVec2;

/// Exact rays through which the polynomial passes: it is off by less than 1e-9 of g within 0.2 rad of the axis.
const TERMS: usize = 6;
/// Newton's steps to the place on the lens of a ray through an exit pupil; each leaves a hundredth of the error.
const PUPIL_STEPS: usize = 4;

/// The rays from one depth.
#[derive(Debug, Clone)]
pub(super) struct SliceRays {
    /// Squared offsets of the exact rays, mm^2, and Newton's divided differences of g there.
    nodes: [f64; TERMS],
    terms: [f64; TERMS],
    /// Place on the array per place on the lens and per slope; see [`Optics`].
    by_lens: f64,
    by_slope: f64,
    pupil: Option<Pupil>,
    /// The rays of a telecentric lens, and their depth, mm.
    telecentric: Option<(TelecentricRays, f64)>,
}

/// An exit pupil that is not at the lens.
#[derive(Debug, Clone, Copy)]
struct Pupil {
    shares: LensShares,
    /// Newton's step for a miss of 1.
    fall: f64,
}

/// A ray on the array.
#[derive(Debug, Clone, Copy)]
pub(super) struct ArrayHit {
    /// Where it meets the array, mm.
    pub(super) array: DVec2,
    /// Spread on the array per length of the aperture, along x and y.
    pub(super) alpha: DVec2,
}

impl SliceRays {
    /// The rays from depth `z_mm`, for points within `field_mm` of the axis.
    pub(super) fn new(optics: &Optics, z_mm: f64, field_mm: f64) -> Self {
        let stop = std::f64::consts::SQRT_2 * optics.half_aperture_mm;
        let shares = optics.lens_shares();
        let beyond_mm = stop + optics.seen_mm().length();
        let lens = shares.map_or(stop, |shares| shares.stop * stop + (1.0 - shares.array).abs() * beyond_mm);
        let farthest = (lens + field_mm).powi(2);
        let angle = |n: usize| (n as f64 + 0.5) * std::f64::consts::PI / TERMS as f64;
        let nodes = std::array::from_fn(|n| 0.5 * farthest * (1.0 + angle(n).cos()));
        let g = |square: f64| {
            let offset = square.sqrt();
            optics.slope(DVec2::ZERO, z_mm, DVec2::new(offset, 0.0)).x / offset
        };
        let mut terms = nodes.map(g);
        for order in 1..TERMS {
            for n in (order..TERMS).rev() {
                terms[n] = (terms[n] - terms[n - 1]) / (nodes[n] - nodes[n - order]);
            }
        }
        let (by_lens, by_slope) = optics.lens_gains();
        let telecentric = optics.telecentric().map(|rays| (rays, z_mm));
        let mut this = Self { nodes, terms, by_lens, by_slope, pupil: None, telecentric };
        let axial = this.through_lens(DVec2::ZERO, DVec2::ZERO).alpha.x;
        this.pupil = shares.map(|shares| Pupil { shares, fall: 1.0 / (1.0 - (1.0 - shares.array) * axial) });
        this
    }

    /// The ray of a point at `object` (along the sensor's axes, mm) through a place in the aperture, mm, without
    /// distortion.
    #[inline(always)]
    pub(super) fn through(&self, object: DVec2, aperture: DVec2) -> ArrayHit {
        if let Some((rays, z_mm)) = &self.telecentric {
            let [array, alpha] = rays.spread(*z_mm, aperture);
            return ArrayHit { array: array + rays.chief_mm(object), alpha };
        }
        let Some(Pupil { shares, fall }) = self.pupil else { return self.through_lens(object, aperture) };
        let mut lens = aperture;
        for _ in 0..PUPIL_STEPS {
            let hit = self.through_lens(object, lens).array;
            lens += fall * (shares.stop * aperture + (1.0 - shares.array) * hit - lens);
        }
        let ArrayHit { array, alpha } = self.through_lens(object, lens);
        ArrayHit { array, alpha: shares.stop * alpha / (DVec2::ONE - (1.0 - shares.array) * alpha) }
    }

    /// The ray of a point through a place on the lens.
    #[inline(always)]
    fn through_lens(&self, object: DVec2, lens: DVec2) -> ArrayHit {
        let offset = lens - object;
        let square = offset.length_squared();
        let (mut g, mut growth) = (self.terms[TERMS - 1], 0.0);
        for (node, term) in self.nodes.iter().zip(&self.terms).rev().skip(1) {
            growth = growth * (square - node) + g;
            g = g * (square - node) + term;
        }
        ArrayHit {
            array: self.by_lens * lens + self.by_slope * g * offset,
            alpha: DVec2::splat(self.by_lens + self.by_slope * g) + 2.0 * self.by_slope * growth * (offset * offset),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Aperture, Medium, Telecentric, tests::seed};
    use crate::{Camera, frame::sensor_axes, lattice::Layout};

    fn check(change: impl Fn(&mut Camera)) {
        let mut camera = seed(20, Aperture::Circle, Layout::Square, 0.0);
        change(&mut camera);
        let optics = Optics::new(&camera);
        let half = optics.half_aperture_mm;
        for z_mm in [-4.0, 0.0, 3.0] {
            let rays = SliceRays::new(&optics, z_mm, 6.0);
            for place in [DVec2::ZERO, DVec2::new(4.0, -3.0)] {
                for aperture in [DVec2::ZERO, DVec2::new(0.9 * half, 0.3 * half), DVec2::new(-0.5, -0.7) * half] {
                    let exact = |by: DVec2| optics.array_from_object(place, z_mm, aperture + by);
                    let hit = rays.through(sensor_axes(place), aperture);
                    let distance = hit.array.distance(exact(DVec2::ZERO));
                    assert!(distance < 1e-7, "{z_mm} {place} {aperture}: {distance} mm");
                    let alpha = DVec2::new(
                        (exact(DVec2::X * 0.01) - exact(DVec2::X * -0.01)).x,
                        (exact(DVec2::Y * 0.01) - exact(DVec2::Y * -0.01)).y,
                    ) / 0.02;
                    assert!(alpha.distance(hit.alpha) < 1e-4, "{z_mm} {place} {aperture}: {alpha} {}", hit.alpha);
                }
            }
        }
    }

    fn tank(camera: &mut Camera) {
        camera.medium = Some(Medium { index: 1.333, window_z_mm: 60.0, window_thickness_mm: 20.0, window_index: 1.49 });
    }

    #[test]
    fn rays_are_those_of_the_camera() {
        check(|_| ());
        check(tank);
        check(|camera| camera.main_lens.pupil_distance_mm = Some(250.0));
        check(|camera| {
            tank(camera);
            camera.main_lens.pupil_distance_mm = Some(250.0);
        });
        check(|camera| {
            tank(camera);
            camera.main_lens.pupil_vergence_per_mm = Some(-0.002);
        });
        check(|camera| {
            camera.main_lens.working_f_number = 2.0;
            camera.main_lens.telecentric = Some(Telecentric { index: 1.0 });
        });
    }
}
