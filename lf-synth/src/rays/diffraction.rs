//! Blur on the sensor: diffraction by a lenslet's rim, and a Gaussian. In collimated light a sensor at the focal length
//! sees the far field of the lenslet's cell. The light of a particle converges behind the array: `coherent.rs`.

use glam::DVec2;
use lf_core::camera::{Blur, Layout};
use lf_core::{Camera, halo::sinc};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Blur by diffraction at the lenslets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diffraction {
    /// Wavelength of the light, mm.
    pub wavelength_mm: f64,
}

impl Diffraction {
    /// The camera with this diffraction.
    pub(super) fn of(&self, camera: &Camera) -> Camera {
        let wavelength_nm = Some(1e6 * self.wavelength_mm);
        Camera { blur: Some(Blur { wavelength_nm, ..camera.blur.unwrap_or_default() }), ..camera.clone() }
    }
}

/// A table of ray deflections that add up to the blur. Diffraction: sinc^2 along both axes of the lattice for a square
/// cell; for a hexagonal one, quantiles of the angle, and of the radius at each angle. Then a Gaussian.
#[derive(Debug)]
pub(super) struct Pattern {
    /// How far most of the light goes, mm.
    pub(super) reach_mm: f64,
    deflections_mm: [Vec<f32>; 2],
}

/// Reach of the pattern, in lambda g / p. The light beyond (0.04 % of a sinc^2 along an axis) is spread over the light
/// within. With a reach of 16, frames are as sharp as with 0.01 px less of a blur of 0.3 px.
const REACH: usize = 256;

/// Steps of the integral along an axis for each lambda g / p. Twice as many move no quantile by 1e-4.
const FINENESS: usize = 128;

/// Steps along each radius of a hexagon's pattern for each lambda g / p, and radii from across a side to a corner.
const RADIAL_FINENESS: usize = 32;
const RADII: usize = 192;

const LENGTH: usize = 1 << 16;

/// Steps of a low-discrepancy sequence in the plane (Roberts 2018): powers of 1/g, where g^3 = g + 1.
const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// The reach of most of the light: times lambda g / p of diffraction, and times the standard deviation of the Gaussian.
const MOST_OF_DIFFRACTION: f64 = 4.0;
const MOST_OF_GAUSSIAN: f64 = 4.0;

/// Steps of another sequence, independent of the first: roots of 2 and 3, less their whole parts.
const GAUSSIAN_STEP: [f64; 2] = [0.414_213_562_373_095_1, 0.732_050_807_568_877_2];

/// Maps the unit square to the pattern.
type Place = Box<dyn Fn([f64; 2]) -> DVec2>;

impl Pattern {
    /// The blur of a camera; None without one.
    pub(super) fn new(camera: &Camera) -> Option<Self> {
        let blur = camera.blur.unwrap_or_default();
        let wavelength_mm = blur.wavelength_nm.map(|nm| 1e-6 * nm);
        let sigma_mm = blur.sigma_px * camera.sensor.pixel_pitch_mm;
        if wavelength_mm.is_none() && sigma_mm == 0.0 {
            return None;
        }
        let mut pattern = wavelength_mm.map_or_else(Self::none, |wavelength_mm| Self::of_cell(wavelength_mm, camera));
        if sigma_mm > 0.0 {
            pattern.add_gaussian(sigma_mm);
        }
        Some(pattern)
    }

    fn none() -> Self {
        Self { reach_mm: 0.0, deflections_mm: [vec![0.0; LENGTH], vec![0.0; LENGTH]] }
    }

    /// Moves every deflection by a sample of a Gaussian.
    fn add_gaussian(&mut self, sigma_mm: f64) {
        let [x, y] = &mut self.deflections_mm;
        for (n, (x, y)) in x.iter_mut().zip(y).enumerate() {
            let [a, b] = GAUSSIAN_STEP.map(|step| ((n + 1) as f64 * step).fract());
            let more = DVec2::from_angle(2.0 * PI * b) * sigma_mm * (-2.0 * (1.0 - a).ln()).sqrt();
            (*x, *y) = (*x + more.x as f32, *y + more.y as f32);
        }
        self.reach_mm += MOST_OF_GAUSSIAN * sigma_mm;
    }

    fn of_cell(wavelength_mm: f64, camera: &Camera) -> Self {
        let unit_mm = wavelength_mm * camera.gap_mm() / camera.microlenses.pitch_mm;
        let turn = DVec2::from_angle(camera.microlenses.rotation_rad);
        let place: Place = match camera.microlenses.layout {
            Layout::Square => of_square(),
            Layout::Hexagonal => of_hexagon(),
        };
        let deflection = |n: usize| {
            let deflection_mm = unit_mm * turn.rotate(place(STEP.map(|step| (n as f64 * step).fract())));
            (deflection_mm.x as f32, deflection_mm.y as f32)
        };
        let (x, y) = (1..=LENGTH).map(deflection).unzip();
        Self { reach_mm: MOST_OF_DIFFRACTION * unit_mm, deflections_mm: [x, y] }
    }

    /// Random place in the table, for a particle's first ray.
    pub(super) fn start(random: &mut Pcg64Mcg) -> usize {
        random.random_range(0..LENGTH)
    }

    /// Deflects rays. The first ray has the number `first`.
    #[inline(always)]
    pub(super) fn deflect(&self, first: usize, x: &mut [f64], y: &mut [f64]) {
        for i in 0..x.len() {
            let n = (first + i) % LENGTH;
            x[i] += f64::from(self.deflections_mm[0][n]);
            y[i] += f64::from(self.deflections_mm[1][n]);
        }
    }
}

/// Maps the unit square to the pattern of a square.
fn of_square() -> Place {
    let across = across_square();
    let signed = move |share: f64| {
        let t = across.at((2.0 * share - 1.0).abs()) / FINENESS as f64;
        if share < 0.5 { -t } else { t }
    };
    Box::new(move |unit| unit.map(&signed).into())
}

/// A sinc^2 on one side of its middle.
fn across_square() -> Quantiles {
    Quantiles::new((0..REACH * FINENESS).map(|n| sinc((n as f64 + 0.5) / FINENESS as f64).powi(2)))
}

/// Maps the unit square to the far field of a hexagon.
fn of_hexagon() -> Place {
    let pattern = HexagonPattern::new(REACH, |at| hexagon(at).powi(2));
    Box::new(move |[a, b]| {
        let twelfths = 12.0 * a;
        let (from_side, radius) = pattern.at(twelfths.fract(), b);
        let side = (twelfths / 2.0).floor() * PI / 3.0;
        radius * DVec2::from_angle(side + if twelfths % 2.0 < 1.0 { from_side } else { -from_side })
    })
}

/// A pattern with the symmetry of a hexagon whose sides are 1 apart, two across the x axis: the angle from the middle
/// of a side first, then the radius.
#[derive(Debug)]
struct HexagonPattern {
    angles: Quantiles,
    radii: Vec<Quantiles>,
}

impl HexagonPattern {
    /// From the intensity in lambda g / p, up to a reach.
    fn new(reach: usize, intensity: impl Fn(DVec2) -> f64 + Sync) -> Self {
        let along = |n: usize| {
            let way = DVec2::from_angle(Self::angle(n as f64 + 0.5));
            Quantiles::new((0..reach * RADIAL_FINENESS).map(|step| {
                let radius = (step as f64 + 0.5) / RADIAL_FINENESS as f64;
                radius * intensity(radius * way)
            }))
        };
        let radii: Vec<Quantiles> = (0..RADII).into_par_iter().map(along).collect();
        let angles = Quantiles::new(radii.iter().enumerate().map(|(n, radius)| radius.whole * (2 * n + 1) as f64));
        Self { angles, radii }
    }

    /// The angle of a number of radii. Far light lies along the ridges across the sides, where radii are the closest.
    fn angle(at: f64) -> f64 {
        PI / 6.0 * (at / RADII as f64).powi(2)
    }

    /// The angle from the middle of a side and the radius within which these shares of the light lie.
    fn at(&self, turned: f64, out: f64) -> (f64, f64) {
        let at = self.angles.at(turned);
        (Self::angle(at), self.radii[(at as usize).min(RADII - 1)].at(out) / RADIAL_FINENESS as f64)
    }
}

/// Fourier transform, 1 in the middle, of a hexagon whose sides are 1 apart, two across the x axis: the sum over its
/// sides of the flux that the divergence theorem gives.
pub(super) fn hexagon(frequency: DVec2) -> f64 {
    if frequency == DVec2::ZERO {
        return 1.0;
    }
    let of_sides = |across: DVec2| {
        let (off, along) = (across.dot(frequency), across.perp_dot(frequency));
        off * off * sinc(off) * sinc(along / 3f64.sqrt())
    };
    let sum: f64 = [0.0, 1.0, 2.0].map(|side| of_sides(DVec2::from_angle(side * PI / 3.0))).iter().sum();
    sum * 2.0 / (3.0 * frequency.length_squared())
}

/// Quantiles of a density, given in equal steps.
#[derive(Debug)]
struct Quantiles {
    /// The integral up to each step, as a share.
    reached: Vec<f64>,
    whole: f64,
}

impl Quantiles {
    fn new(density: impl Iterator<Item = f64>) -> Self {
        let mut whole = 0.0;
        let mut reached = vec![0.0];
        reached.extend(density.map(|step| {
            whole += step;
            whole
        }));
        reached.iter_mut().for_each(|sum| *sum /= whole);
        Self { reached, whole }
    }

    /// Where the integral reaches a share, in steps.
    fn at(&self, share: f64) -> f64 {
        let n = self.reached.partition_point(|reached| *reached <= share).clamp(1, self.reached.len() - 1);
        let (low, high) = (self.reached[n - 1], self.reached[n]);
        let within = if high > low { (share - low) / (high - low) } else { 0.0 };
        n as f64 - 1.0 + within
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The hexagon's transform against a sum over points of the hexagon.
    #[test]
    fn a_hexagon_has_its_transform() {
        let steps = 1000;
        let side = |k: f64| DVec2::from_angle(k * PI / 3.0);
        let points: Vec<DVec2> = (0..steps * steps)
            .map(|n| DVec2::new((n % steps) as f64 + 0.5, (n / steps) as f64 + 0.5) * (1.2 / steps as f64) - 0.6)
            .filter(|at| [0.0, 1.0, 2.0].iter().all(|k| at.dot(side(*k)).abs() <= 0.5))
            .collect();
        for frequency in [(0.3, 0.0), (0.0, 0.7), (0.8, -0.5), (2.3, 1.1), (0.001, 0.0)].map(DVec2::from) {
            let sum: f64 = points.iter().map(|at| (2.0 * PI * at.dot(frequency)).cos()).sum();
            let found = hexagon(frequency);
            assert!((found - sum / points.len() as f64).abs() < 1e-3, "{frequency}: {found}");
        }
    }

    /// The mean of a wave over the deflections is the overlap of the cell with itself when it is moved.
    #[test]
    fn deflections_have_the_transfer_of_the_cell() {
        for layout in [Layout::Square, Layout::Hexagonal] {
            let scene = crate::scene::ready::scene("core").unwrap();
            let mut camera = Camera::from_json(&scene["camera"].to_string()).unwrap();
            camera.microlenses.layout = layout;
            camera.microlenses.rotation_rad = 0.2;
            camera.blur = Some(Blur { wavelength_nm: Some(532.0), sigma_px: 0.0, ..Blur::default() });
            let pattern = Pattern::new(&camera).unwrap();
            let wanted = camera.diffraction().unwrap();
            let [x, y] = &pattern.deflections_mm;
            for (u, v) in [(0.1, 0.0), (0.3, 0.2), (-0.2, 0.5), (0.0, 0.8), (0.7, 0.7), (0.9, 0.02), (0.03, 0.98)] {
                let frequency = DVec2::new(u, v) / wanted.unit_px;
                let wave = DVec2::from_angle(0.2).rotate(frequency) * 2.0 * PI / camera.sensor.pixel_pitch_mm;
                let waves = x.iter().zip(y).map(|(x, y)| wave.dot(DVec2::new((*x).into(), (*y).into())).cos());
                let mean = waves.sum::<f64>() / LENGTH as f64;
                let transfer = wanted.transfer(frequency);
                assert!((mean - transfer).abs() < 2e-3, "{layout:?} {u} {v}: {mean} {transfer}");
            }
        }
    }

    /// Half of a sinc^2 lies within 0.2214 of its middle.
    #[test]
    fn quantiles_halve_a_sinc() {
        let half = across_square().at(0.5) / FINENESS as f64;
        let cut = (0..4000).map(|n| sinc((n as f64 + 0.5) * half / 4000.0).powi(2)).sum::<f64>() * half / 4000.0;
        assert!((cut - 0.25).abs() < 2e-4, "{cut}");
    }

    /// A Gaussian alone: its mean, its standard deviation along both axes, and no correlation of the two.
    #[test]
    fn a_gaussian_has_its_width() {
        let mut pattern = Pattern::none();
        pattern.add_gaussian(0.002);
        let [x, y] = &pattern.deflections_mm;
        let mean = |f: &dyn Fn(f64, f64) -> f64| {
            x.iter().zip(y).map(|(x, y)| f(f64::from(*x), f64::from(*y))).sum::<f64>() / LENGTH as f64
        };
        assert!(mean(&|x, _| x).abs() < 2e-6 && mean(&|_, y| y).abs() < 2e-6);
        for square in [mean(&|x, _| x * x), mean(&|_, y| y * y)] {
            assert!((square.sqrt() - 0.002).abs() < 2e-6, "{square}");
        }
        assert!(mean(&|x, y| x * y).abs() < 1e-8);
    }
}
