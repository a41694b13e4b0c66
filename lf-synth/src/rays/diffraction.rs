//! Blur on the sensor: diffraction by a lenslet's rim, and a Gaussian. A sensor at the focal length sees the far field
//! of the lenslet's cell.

use glam::DVec2;
use lf_core::{Camera, camera::Layout};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Blur by diffraction at the lenslets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diffraction {
    /// Wavelength of the light, mm.
    pub wavelength_mm: f64,
}

/// A table of ray deflections that add up to the blur. Diffraction: sinc^2 along both axes of the lattice for a square
/// cell; the Airy pattern of the disc of equal area for a hexagonal one. Then a Gaussian.
#[derive(Debug)]
pub(super) struct Pattern {
    /// How far most of the light goes, mm.
    pub(super) reach_mm: f64,
    deflections_mm: [Vec<f32>; 2],
}

/// Reach of the pattern, in lambda g / p. The light beyond (0.04 % of a sinc^2 along an axis, 0.08 % of an Airy
/// pattern) is spread over the light within. With a reach of 16, frames are as sharp as with 0.01 px less of a blur of
/// 0.3 px.
const REACH: f64 = 256.0;

/// Steps of the integral for each lambda g / p. Twice as many move no quantile by 1e-4.
const FINENESS: usize = 128;

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
    /// The blur of a scene's diffraction and of its camera's blur; None if both are absent.
    pub(super) fn new(diffraction: Option<&Diffraction>, camera: &Camera) -> Option<Self> {
        let blur = camera.blur.unwrap_or_default();
        let wavelength_mm = diffraction.map(|d| d.wavelength_mm).or(blur.wavelength_nm.map(|nm| 1e-6 * nm));
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
        let per_aperture = wavelength_mm * camera.gap_mm();
        let turn = DVec2::from_angle(camera.microlenses.rotation_rad);
        // `place` maps the unit square to the pattern.
        let (unit_mm, place): (f64, Place) = match camera.microlenses.layout {
            Layout::Square => {
                let across = Quantiles::new(sinc2);
                let signed = move |share: f64| {
                    let t = across.at((2.0 * share - 1.0).abs());
                    if share < 0.5 { -t } else { t }
                };
                (
                    per_aperture / camera.microlenses.pitch_mm,
                    Box::new(move |unit| turn.rotate(unit.map(&signed).into())),
                )
            }
            Layout::Hexagonal => {
                let radius = Quantiles::new(|r| airy(r) * r);
                let diameter_mm = (camera.lattice().cell_area_mm2() * 4.0 / PI).sqrt();
                (per_aperture / diameter_mm, Box::new(move |[a, b]| radius.at(a) * DVec2::from_angle(2.0 * PI * b)))
            }
        };
        let deflection = |n: usize| {
            let deflection_mm = unit_mm * place(STEP.map(|step| (n as f64 * step).fract()));
            (deflection_mm.x as f32, deflection_mm.y as f32)
        };
        let (x, y) = (1..=LENGTH).map(deflection).unzip();
        Self { reach_mm: MOST_OF_DIFFRACTION * unit_mm, deflections_mm: [x, y] }
    }

    /// Random place in the table, for a particle's first ray.
    pub(super) fn start(&self, random: &mut Pcg64Mcg) -> usize {
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

/// (sin(pi t) / (pi t))^2.
fn sinc2(t: f64) -> f64 {
    if t == 0.0 { 1.0 } else { ((PI * t).sin() / (PI * t)).powi(2) }
}

/// (2 J1(pi r) / (pi r))^2.
fn airy(r: f64) -> f64 {
    let x = PI * r;
    if x == 0.0 { 1.0 } else { (2.0 * libm::j1(x) / x).powi(2) }
}

/// Quantiles of a density on 0 to [`REACH`], from a table of its integral.
struct Quantiles(Vec<f64>);

impl Quantiles {
    fn new(density: impl Fn(f64) -> f64) -> Self {
        let step = 1.0 / FINENESS as f64;
        let mut integral = vec![0.0];
        for n in 0..(REACH * FINENESS as f64) as usize {
            integral.push(integral[n] + density((n as f64 + 0.5) * step));
        }
        let whole = integral[integral.len() - 1];
        integral.iter_mut().for_each(|sum| *sum /= whole);
        Self(integral)
    }

    fn at(&self, share: f64) -> f64 {
        let n = self.0.partition_point(|reached| *reached <= share).clamp(1, self.0.len() - 1);
        let (low, high) = (self.0[n - 1], self.0[n]);
        let within = if high > low { (share - low) / (high - low) } else { 0.0 };
        (n as f64 - 1.0 + within) / FINENESS as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From tables: J1 has its first zero at 3.8317. For an aperture of width 1, half of a sinc^2 lies within 0.2214 of
    /// its middle, and half of the Airy light within a radius of 0.535 (encircled energy).
    #[test]
    fn patterns_match_the_textbooks() {
        assert!(airy(3.831_706 / PI) < 1e-13);
        assert!((airy(0.514_497) - 0.5).abs() < 1e-4);
        let half = Quantiles::new(sinc2).at(0.5);
        let cut = (0..4000).map(|n| sinc2((n as f64 + 0.5) * half / 4000.0)).sum::<f64>() * half / 4000.0;
        assert!((cut - 0.25).abs() < 2e-4, "{cut}");
        let median = Quantiles::new(|r| airy(r) * r).at(0.5);
        assert!((median - 0.535).abs() < 2e-3, "{median}");
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
