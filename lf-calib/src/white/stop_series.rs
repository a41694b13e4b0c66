//! The image of a stop under a lenslet as a Fourier integral.

use glam::DVec2;
use lf_core::camera::{Aperture, Blades};
use lf_core::halo::sinc;
use std::f64::consts::PI;

/// Chords of a bent blade.
const PARTS: u32 = 3;
/// Frequencies, over 1 / half width, between which second derivatives are differences.
const STEP: f64 = 3e-3;

/// The Fourier transform of a stop's image: of even light, and of light that falls from 1 in the middle to 0 at the rim
/// with the square of the distance; for a square, along x plus along y. Complex numbers.
pub(super) enum StopSeries {
    Disc(f64),
    Square(f64),
    /// Its half width, and its rim over that.
    Polygon(f64, Vec<DVec2>),
}

impl StopSeries {
    pub(super) fn new(aperture: Aperture, half_px: f64, blades: Option<Blades>) -> Self {
        match (aperture, blades) {
            (Aperture::Square, _) => Self::Square(half_px),
            (Aperture::Circle, None) => Self::Disc(half_px),
            (Aperture::Circle, Some(blades)) => {
                // Chords lie inside their arcs: the polygon of chords gets the area of the arcs.
                let mut rim = blades.rim(PARTS);
                let wider = (blades.area() / area(&rim) * PI).sqrt();
                rim.iter_mut().for_each(|corner| *corner *= wider);
                Self::Polygon(half_px, rim)
            }
        }
    }

    pub(super) fn at(&self, frequency: DVec2) -> [DVec2; 2] {
        match self {
            Self::Disc(half) => {
                let area = PI * half * half;
                let k = 2.0 * PI * half * frequency.length();
                if k < 1e-3 {
                    return [area, 0.5 * area].map(real);
                }
                let (j0, j1) = (libm::j0(k), libm::j1(k));
                [area * 2.0 * j1 / k, area * 4.0 * (2.0 * j1 / k - j0) / (k * k)].map(real)
            }
            Self::Square(half) => {
                let [x, y] = [frequency.x, frequency.y].map(|f| line(*half, 2.0 * PI * half * f));
                [x[0] * y[0], 0.5 * (x[1] * y[0] + x[0] * y[1])].map(real)
            }
            Self::Polygon(half, rim) => {
                let (area, f) = (half * half, *half * frequency);
                let even = polygon(rim, f);
                let around: DVec2 = [DVec2::X, DVec2::Y, -DVec2::X, -DVec2::Y]
                    .into_iter()
                    .map(|axis| polygon(rim, f + STEP * axis) - even)
                    .sum();
                // The square of the distance is minus the Laplacian over (2 pi)^2.
                [area * even, area * (even + around / (STEP * STEP * 4.0 * PI * PI))]
            }
        }
    }
}

fn real(number: f64) -> DVec2 {
    DVec2::new(number, 0.0)
}

/// Area of a polygon, counter-clockwise.
fn area(corners: &[DVec2]) -> f64 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    0.5 * sides.map(|(from, to)| from.perp_dot(*to)).sum::<f64>()
}

/// The integral of exp(-2 pi i f x) over a polygon, counter-clockwise, by Gauss's theorem along its sides.
fn polygon(corners: &[DVec2], frequency: DVec2) -> DVec2 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let square = frequency.length_squared();
    if square < 1e-8 {
        return real(area(corners));
    }
    let side = |(from, to): (&DVec2, &DVec2)| {
        let along = *to - *from;
        let outward = DVec2::new(along.y, -along.x);
        let phase = -PI * frequency.dot(*from + *to);
        frequency.dot(outward) * sinc(frequency.dot(along)) * DVec2::from_angle(phase)
    };
    // Times i.
    sides.map(side).sum::<DVec2>().perp() / (2.0 * PI * square)
}

/// Integrals over -half to half of cos(k t / half), and of that times 1 - (t / half)^2.
fn line(half: f64, k: f64) -> [f64; 2] {
    if k.abs() < 1e-2 {
        return [2.0 * half, 4.0 / 3.0 * half];
    }
    [2.0 * half * k.sin() / k, 4.0 * half * (k.sin() - k * k.cos()) / (k * k * k)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polygon of many blades is a disc; one of four is a square, turned.
    #[test]
    fn polygons_are_discs_and_squares() {
        let many = Blades { count: 40, turn_rad: 0.1, apothem: 1.0 };
        let disc = StopSeries::new(Aperture::Circle, 7.0, None);
        let polygon = StopSeries::new(Aperture::Circle, 7.0, Some(many));
        let four = Blades { count: 4, turn_rad: PI / 4.0, apothem: Blades::straight(4) };
        let square = StopSeries::new(Aperture::Square, 7.0, None);
        let tilted = StopSeries::new(Aperture::Circle, 7.0 * 2.0f64.sqrt(), Some(four));
        for f in [(0.0, 0.0), (0.03, 0.01), (0.1, -0.07), (-0.31, 0.2)].map(DVec2::from) {
            for n in 0..2 {
                let (wanted, found) = (disc.at(f)[n], polygon.at(f)[n]);
                assert!(wanted.distance(found) < 0.15, "{f} {n}: {found} for {wanted}");
            }
            assert!(square.at(f)[0].distance(tilted.at(f)[0]) < 1e-2, "{f}: {}", tilted.at(f)[0]);
        }
    }

    /// A triangle has no centre of symmetry, so its transform is complex: that of many points.
    #[test]
    fn a_triangle_is_that_of_points() {
        let blades = Blades { count: 3, turn_rad: 0.2, apothem: 0.6 };
        let series = StopSeries::new(Aperture::Circle, 5.0, Some(blades));
        let discs: Vec<_> = blades.discs(5.0).collect();
        let points: Vec<DVec2> = (0..400 * 400)
            .map(|n| (DVec2::new(f64::from(n % 400), f64::from(n / 400)) - 199.5) * 0.026)
            .filter(|point| discs.iter().all(|disc| point.distance(disc.middle_px) < disc.radius_px))
            .collect();
        for f in [(0.0, 0.0), (0.05, 0.02), (-0.1, 0.16)].map(DVec2::from) {
            let wave = |point: &DVec2| DVec2::from_angle(-2.0 * PI * f.dot(*point)) * 0.026 * 0.026;
            let even: DVec2 = points.iter().map(wave).sum();
            let falling: DVec2 = points.iter().map(|p| wave(p) * (1.0 - p.length_squared() / 25.0)).sum();
            let found = series.at(f);
            assert!(found[0].distance(even) < 0.3, "{f}: {} for {even}", found[0]);
            assert!(found[1].distance(falling) < 0.3, "{f}: {} for {falling}", found[1]);
            assert!(f.y < 0.1 || even.y.abs() > 1.0, "{even} is nearly real");
        }
    }
}
