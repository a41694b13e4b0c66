//! A particle's rays on the array: `m + alpha U`, with derivatives by its place, and what bends beyond that.

use crate::{Camera, Optics, frame::sensor_axes};
use glam::{DMat2, DVec2};

/// The rays of a particle.
#[derive(Debug, Clone)]
pub(super) struct Beam {
    /// m, where the chief ray meets the array, mm, and its derivatives by x, y, z.
    pub(super) chief: DVec2,
    pub(super) chief_by: [DVec2; 3],
    /// Spread on the array per length of the stop, and its derivatives by x, y, z.
    pub(super) alpha: f64,
    pub(super) alpha_by: [f64; 3],
    /// Size of the spot on the array over its size at the particle, and its derivative by z.
    pub(super) beta: f64,
    pub(super) beta_by_z: f64,
    /// Coefficients of the bend, mm, see [`terms`]; None for straight rays.
    bend: Option<[DVec2; TERMS]>,
    /// Largest bend, mm.
    pub(super) most_bend_mm: f64,
}

/// How beams of a camera are traced.
#[derive(Debug, Clone)]
pub(super) struct Tracer {
    /// Places of the stop and the least-squares rows that turn hits there into a bend; None for straight rays.
    bend: Option<(Vec<DVec2>, Vec<[f64; TERMS]>)>,
}

/// Step of the derivatives, mm. They err by its square over the squared distance of the lens: 1e-11.
const STEP_MM: f64 = 1e-3;
/// Terms of a bend: all powers of U up to the third, and U times its length to the fourth power.
pub(super) const TERMS: usize = 12;
/// Fixed-point steps to the place of the stop whose light meets a lenslet.
const BEND_STEPS: usize = 3;
/// Place of the four rays that stand for a bent beam, half apertures.
const STANDS: f64 = 0.7;

/// The powers of a place in the stop, in half apertures.
fn terms(place: DVec2) -> [f64; TERMS] {
    let ((u, v), fourth) = ((place.x, place.y), place.length_squared().powi(2));
    [1.0, u, v, u * u, u * v, v * v, u * u * u, u * u * v, u * v * v, v * v * v, u * fourth, v * fourth]
}

/// The sum of [`terms`] at (u, v) with coefficients, in single precision, and its derivatives by u and v.
#[inline(always)]
pub(super) fn sum_of_terms(t: &[f32; TERMS], u: f32, v: f32) -> (f32, [f32; 2]) {
    let (square, radial) = (u * u + v * v, u * t[10] + v * t[11]);
    let along = t[1] + u * (t[3] + u * t[6] + v * t[7]) + v * t[4];
    let across = t[2] + v * (t[5] + v * t[9] + u * t[8]);
    let by_u = t[1] + u * (2.0 * t[3] + 3.0 * u * t[6] + 2.0 * v * t[7]) + v * (t[4] + v * t[8]);
    let by_v = t[2] + v * (2.0 * t[5] + 3.0 * v * t[9] + 2.0 * u * t[8]) + u * (t[4] + u * t[7]);
    let (fourth, both) = (square * square, 4.0 * square * radial);
    let sum = t[0] + u * along + v * across + fourth * radial;
    (sum, [by_u + u * both + fourth * t[10], by_v + v * both + fourth * t[11]])
}

/// The second derivatives of [`sum_of_terms`] by u and by v.
#[inline(always)]
pub(super) fn curvature_of_terms(t: &[f32; TERMS], u: f32, v: f32) -> [f32; 2] {
    let (u2, v2, radial) = (u * u, v * v, u * t[10] + v * t[11]);
    [
        2.0 * t[3] + 6.0 * u * t[6] + 2.0 * v * t[7] + (12.0 * u2 + 4.0 * v2) * radial + 8.0 * (u2 + v2) * u * t[10],
        2.0 * t[5] + 6.0 * v * t[9] + 2.0 * u * t[8] + (12.0 * v2 + 4.0 * u2) * radial + 8.0 * (u2 + v2) * v * t[11],
    ]
}

impl Tracer {
    pub(super) fn new(camera: &Camera) -> Self {
        Self { bend: camera.has_bent_rays().then(least_squares) }
    }

    /// The rays of a particle at `place_mm`.
    pub(super) fn beam(&self, optics: &Optics, place_mm: [f64; 3]) -> Beam {
        let rays = |place: [f64; 3]| self.rays(optics, place);
        let (chief, alpha) = rays(place_mm);
        let (mut chief_by, mut alpha_by) = ([DVec2::ZERO; 3], [0.0; 3]);
        for axis in 0..3 {
            let moved = |by: f64| {
                let mut place = place_mm;
                place[axis] += by;
                rays(place)
            };
            let (before, after) = (moved(-STEP_MM), moved(STEP_MM));
            chief_by[axis] = (after.0 - before.0) / (2.0 * STEP_MM);
            alpha_by[axis] = (after.1 - before.1) / (2.0 * STEP_MM);
        }
        let beta = DMat2::from_cols(chief_by[0], chief_by[1]).determinant().abs().sqrt();
        let z = place_mm[2];
        let growth = (optics.beta(z + STEP_MM) - optics.beta(z - STEP_MM)) / (2.0 * STEP_MM * optics.beta(z));
        let mut most_bend_mm = 0f64;
        let bend = self.bend.as_ref().map(|(places, rows)| {
            let half = optics.half_aperture_mm;
            let point = DVec2::new(place_mm[0], place_mm[1]);
            let mut bend = [DVec2::ZERO; TERMS];
            for (place, row) in places.iter().zip(rows) {
                let aperture = half * *place;
                let rest = optics.array_from_object(point, z, aperture) - chief - alpha * aperture;
                most_bend_mm = most_bend_mm.max(rest.length());
                bend.iter_mut().zip(row).for_each(|(term, share)| *term += *share * rest);
            }
            bend
        });
        Beam { chief, chief_by, alpha, alpha_by, beta, beta_by_z: beta * growth, bend, most_bend_mm }
    }

    /// m and alpha.
    fn rays(&self, optics: &Optics, [x, y, z]: [f64; 3]) -> (DVec2, f64) {
        let point = DVec2::new(x, y);
        if self.bend.is_none() {
            let chief = -optics.beta(z) * sensor_axes(point) + optics.distortion_mm(point, z);
            return (chief, optics.alpha(z));
        }
        let aside = STANDS * optics.half_aperture_mm;
        let hit = |aperture: DVec2| optics.array_from_object(point, z, aside * aperture);
        let [right, left, down, up] = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(hit);
        (0.25 * (right + left + down + up), ((right - left).x + (down - up).y) / (4.0 * aside))
    }
}

impl Beam {
    /// Whether rays depart from `m + alpha U`.
    #[inline(always)]
    pub(super) fn is_bent(&self) -> bool {
        self.bend.is_some()
    }

    /// Where the ray through a place of the stop meets the array, mm.
    #[inline(always)]
    pub(super) fn hit(&self, aperture: DVec2, half_aperture_mm: f64) -> DVec2 {
        self.chief + self.alpha * aperture + self.bend(aperture / half_aperture_mm)
    }

    /// Derivatives of a hit by the place in the stop along x and along y.
    #[inline(always)]
    pub(super) fn slopes(&self, aperture: DVec2, half_aperture_mm: f64) -> [DVec2; 2] {
        let straight = [DVec2::new(self.alpha, 0.0), DVec2::new(0.0, self.alpha)];
        let Some(bend) = &self.bend else { return straight };
        let (u, v) = (aperture / half_aperture_mm).into();
        let [_, by_u, by_v, uu, uv, vv, uuu, uuv, uvv, vvv, u_fourth, v_fourth] = *bend;
        let square = u * u + v * v;
        let both = 4.0 * square * (u * u_fourth + v * v_fourth);
        let fourth = square * square;
        let along = by_u + 2.0 * u * uu + v * uv + 3.0 * u * u * uuu + 2.0 * u * v * uuv + v * v * uvv;
        let across = by_v + 2.0 * v * vv + u * uv + u * u * uuv + 2.0 * u * v * uvv + 3.0 * v * v * vvv;
        let bent = [along + u * both + fourth * u_fourth, across + v * both + fourth * v_fourth];
        [0, 1].map(|n| straight[n] + bent[n] / half_aperture_mm)
    }

    /// Coefficients of what is left of hits by `chief + alpha U`, mm, see [`terms`]; None for straight rays.
    #[inline(always)]
    pub(super) fn rest(&self, chief: DVec2, alpha: DVec2, half_aperture_mm: f64) -> Option<[DVec2; TERMS]> {
        let mut rest = self.bend?;
        rest[0] += self.chief - chief;
        rest[1].x += (self.alpha - alpha.x) * half_aperture_mm;
        rest[2].y += (self.alpha - alpha.y) * half_aperture_mm;
        Some(rest)
    }

    #[inline(always)]
    fn bend(&self, place: DVec2) -> DVec2 {
        let Some(bend) = &self.bend else { return DVec2::ZERO };
        terms(place).iter().zip(bend).map(|(term, factor)| *term * *factor).sum()
    }

    /// m and alpha along both axes for the rays that meet the array about `centre`.
    #[inline(always)]
    pub(super) fn towards(&self, centre: DVec2, spot_mm: f64, half_aperture_mm: f64) -> (DVec2, DVec2) {
        if self.bend.is_none() {
            return (self.chief, DVec2::splat(self.alpha));
        }
        // The place of the stop from which light comes to the lenslet; the middle near focus, where all of it does.
        let spread = spot_mm / half_aperture_mm;
        let per_mm = self.alpha / (self.alpha * self.alpha + spread * spread) / half_aperture_mm;
        let mut place = DVec2::ZERO;
        for _ in 0..BEND_STEPS {
            place = ((centre - self.chief - self.bend(place)) * per_mm).clamp_length_max(1.0);
        }
        let [by_u, by_v] = self.slopes(place * half_aperture_mm, half_aperture_mm);
        let alpha = DVec2::new(by_u.x, by_v.y);
        (self.hit(place * half_aperture_mm, half_aperture_mm) - alpha * place * half_aperture_mm, alpha)
    }
}

/// Twenty-five places of the stop, in half apertures, and the rows of the pseudo-inverse of their terms.
fn least_squares() -> (Vec<DVec2>, Vec<[f64; TERMS]>) {
    let ring = |radius: f64, turn: f64| {
        (0..8).map(move |n| radius * DVec2::from_angle((n as f64 + turn) * std::f64::consts::FRAC_PI_4))
    };
    let places: Vec<DVec2> =
        std::iter::once(DVec2::ZERO).chain(ring(0.45, 0.0)).chain(ring(0.75, 0.5)).chain(ring(0.97, 0.0)).collect();
    // Normal equations, solved by Gauss-Jordan elimination beside the identity.
    let mut system = [[0.0; 2 * TERMS]; TERMS];
    for terms in places.iter().map(|place| terms(*place)) {
        for (row, factor) in system.iter_mut().zip(terms) {
            row.iter_mut().zip(terms).for_each(|(sum, term)| *sum += factor * term);
        }
    }
    for (n, row) in system.iter_mut().enumerate() {
        row[TERMS + n] = 1.0;
    }
    for n in 0..TERMS {
        let pivot = system[n][n];
        system[n].iter_mut().for_each(|value| *value /= pivot);
        let row = system[n];
        for (_, other) in system.iter_mut().enumerate().filter(|(m, _)| *m != n) {
            let factor = other[n];
            other.iter_mut().zip(row).for_each(|(value, pivot)| *value -= factor * pivot);
        }
    }
    let inverse =
        |terms: [f64; TERMS]| std::array::from_fn(|n| (0..TERMS).map(|m| system[n][TERMS + m] * terms[m]).sum::<f64>());
    let rows = places.iter().map(|place| inverse(terms(*place))).collect();
    (places, rows)
}
