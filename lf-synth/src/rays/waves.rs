//! Fresnel's pattern of a lenslet in a particle's light, which converges behind the array.
//!
//! The wave on a cell is curved. Let b be the width of the cell's shadow on the sensor, in lambda g / p, and x a place
//! in the cell, in pitches. At s, in lambda g / p from the shadow's middle, the sensor sees
//!
//! ```text
//! |int_cell exp(-i pi (b x^2 + 2 x s)) dx|^2
//! ```
//!
//! Rays without waves are even on the shadow, s = b x. Each is moved so that together they are as dense as the pattern.
//! The stop cuts rays where they are then, and its rim is the edge of coherent light.

use super::diffraction::{HexagonPattern, Quantiles};
use glam::{DMat2, DVec2};
use lf_core::{Camera, Optics, camera::Layout};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// The waves of a camera's lenslets.
#[derive(Debug)]
pub(super) struct Waves {
    layout: Layout,
    turn: DMat2,
    pitch_mm: f64,
    /// lambda g / p, mm.
    unit_mm: f64,
    /// How far a place in the stop moves light on the sensor.
    demagnification: f64,
    /// Patterns by their b, made when first asked for.
    patterns: Vec<OnceLock<CellPattern>>,
    edge: Edge,
}

/// The widths b for which there are patterns, and their ratio.
const WIDTHS: [f64; 2] = [0.05, 64.0];
const RATIO: f64 = 1.03;

/// A particle, as lenslets show it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown<'a> {
    pub(super) waves: &'a Waves,
    /// None where the shadow is so large that its fringes do not matter.
    pattern: Option<&'a CellPattern>,
    /// The pattern's b, and whether the shadow is upside down.
    width: f64,
    sign: f64,
}

/// The pattern of a cell.
#[derive(Debug)]
enum CellPattern {
    /// Alike along both axes: quantiles on one side of the middle, in [`FINENESS`] steps.
    Square(Quantiles),
    Hexagon(HexagonPattern),
}

/// Reach beside the shadow, lambda g / p, steps of a pattern for each of these, and places in the cell for each wave
/// that the farthest light turns.
const REACH: f64 = 64.0;
const HEXAGON_REACH: f64 = 24.0;
const FINENESS: f64 = 32.0;
const HEXAGON_FINENESS: f64 = 8.0;
const PLACES_PER_TURN: f64 = 3.0;

impl Waves {
    /// The waves of a camera; None unless it follows them.
    pub(super) fn new(camera: &Camera, optics: &Optics) -> Option<Self> {
        let pattern = camera.fresnel()?;
        let count = ((WIDTHS[1] / WIDTHS[0]).ln() / RATIO.ln()) as usize + 1;
        Some(Self {
            layout: pattern.layout,
            turn: DMat2::from_angle(camera.microlenses.rotation_rad),
            pitch_mm: camera.microlenses.pitch_mm,
            unit_mm: pattern.unit_px * camera.sensor.pixel_pitch_mm,
            demagnification: optics.demagnification,
            patterns: (0..count).map(|_| OnceLock::new()).collect(),
            edge: Edge::new(),
        })
    }

    /// How far beyond the stop rays are drawn, mm: waves bring some of them in.
    pub(super) fn margin_mm(&self) -> f64 {
        MARGIN * self.unit_mm / self.demagnification
    }

    /// A particle whose shadow of a cell grows by `growth` on the way from the array to the sensor.
    pub(super) fn show(&self, growth: f64) -> Shown<'_> {
        let wanted = (growth * self.pitch_mm / self.unit_mm).abs();
        let rung = ((wanted / WIDTHS[0]).ln() / RATIO.ln()).round().max(0.0);
        let width = WIDTHS[0] * RATIO.powf(rung);
        let make = || match self.layout {
            Layout::Square => CellPattern::of_square(width),
            Layout::Hexagonal => CellPattern::of_hexagon(width),
        };
        let pattern = self.patterns.get(rung as usize).filter(|_| wanted.is_finite());
        let pattern = pattern.map(|pattern| pattern.get_or_init(make));
        Shown { waves: self, pattern, width, sign: growth.signum() }
    }

    /// Largest share of light that passes a stop, at its brightest fringes.
    pub(super) const MOST_PASSED: f64 = Edge::MOST * Edge::MOST;

    /// The share of light at a place in the stop, over [`Self::MOST_PASSED`], that passes a stop of this half size.
    pub(super) fn passed(&self, place_mm: DVec2, half_mm: f64, is_round: bool) -> f64 {
        let per_unit = self.demagnification / self.unit_mm;
        let edge = |inside_mm: f64| self.edge.at(inside_mm * per_unit) / Edge::MOST;
        if is_round {
            edge(half_mm - place_mm.length()) / Edge::MOST
        } else {
            edge(half_mm - place_mm.x.abs()) * edge(half_mm - place_mm.y.abs())
        }
    }
}

/// Rays are drawn this far beyond the stop, lambda g / p.
const MARGIN: f64 = 4.0;

impl Shown<'_> {
    /// How far waves move a ray on the sensor that meets the array at `hit_mm` from the middle of a cell, mm.
    #[inline(always)]
    pub(super) fn moves_mm(&self, hit_mm: DVec2) -> DVec2 {
        let Some(pattern) = self.pattern else { return DVec2::ZERO };
        let place = self.waves.turn.transpose() * hit_mm / self.waves.pitch_mm;
        let seen = match pattern {
            CellPattern::Square(quantiles) => {
                let along = |x: f64| (quantiles.at(2.0 * x.abs()) / FINENESS).copysign(x);
                DVec2::new(along(place.x), along(place.y))
            }
            CellPattern::Hexagon(pattern) => pattern.seen(place),
        };
        self.waves.turn * (self.sign * self.waves.unit_mm * (seen - self.width * place))
    }
}

impl CellPattern {
    fn of_square(width: f64) -> Self {
        let steps = ((0.5 * width + REACH) * FINENESS) as usize;
        let count = ((width + REACH) * PLACES_PER_TURN).ceil() as usize;
        let places: Vec<f64> = (0..count).map(|n| 0.5 * (n as f64 + 0.5) / count as f64).collect();
        let curved: Vec<DVec2> = places.iter().map(|x| DVec2::from_angle(PI * width * x * x)).collect();
        let intensity = |step: usize| {
            let s = (step as f64 + 0.5) / FINENESS;
            let waves = places.iter().zip(&curved).map(|(x, curved)| *curved * (2.0 * PI * x * s).cos());
            waves.sum::<DVec2>().length_squared()
        };
        let intensities: Vec<f64> = (0..steps).into_par_iter().map(intensity).collect();
        Self::Square(Quantiles::new(intensities.into_iter()))
    }

    /// A quarter of the cell is summed row by row for a lattice of places on the sensor.
    fn of_hexagon(width: f64) -> Self {
        let reach = 0.6 * width + HEXAGON_REACH;
        let count = ((reach + 0.6 * width) * PLACES_PER_TURN).ceil() as usize;
        let nodes = (reach * HEXAGON_FINENESS) as usize + 2;
        let cosines = |places: &[f64]| -> Vec<Vec<f64>> {
            let at = |node: usize| node as f64 / HEXAGON_FINENESS;
            (0..nodes).map(|node| places.iter().map(|x| (2.0 * PI * x * at(node)).cos()).collect()).collect()
        };
        let corner = 3f64.sqrt() / 3.0;
        let heights: Vec<f64> = (0..count).map(|n| corner * (n as f64 + 0.5) / count as f64).collect();
        // For each node along x, the waves of each row.
        let row = |y: &f64| -> Vec<DVec2> {
            let half = 0.5f64.min(3f64.sqrt() * (corner - y));
            let places: Vec<f64> = (0..count).map(|n| half * (n as f64 + 0.5) / count as f64).collect();
            let curved: Vec<DVec2> = places.iter().map(|x| DVec2::from_angle(PI * width * (x * x + y * y))).collect();
            let sum = |cosines: Vec<f64>| half * curved.iter().zip(cosines).map(|(w, c)| *w * c).sum::<DVec2>();
            cosines(&places).into_iter().map(sum).collect()
        };
        let rows: Vec<Vec<DVec2>> = heights.par_iter().map(row).collect();
        let down = cosines(&heights);
        let column = |node: usize| -> Vec<f64> {
            let waves: Vec<DVec2> = rows.iter().map(|row| row[node]).collect();
            let sum = |cosines: &Vec<f64>| waves.iter().zip(cosines).map(|(w, c)| *w * *c).sum::<DVec2>();
            down.iter().map(|cosines| sum(cosines).length_squared()).collect()
        };
        let columns: Vec<Vec<f64>> = (0..nodes).into_par_iter().map(column).collect();
        let intensity = |s: DVec2| {
            let at = s.abs() * HEXAGON_FINENESS;
            let (x, y) = ((at.x as usize).min(nodes - 2), (at.y as usize).min(nodes - 2));
            let part = at - DVec2::new(x as f64, y as f64);
            let along = |y: usize| columns[x][y] + part.x * (columns[x + 1][y] - columns[x][y]);
            along(y) + part.y * (along(y + 1) - along(y))
        };
        Self::Hexagon(HexagonPattern::new(reach as usize, intensity))
    }
}

/// The edge of coherent light: its intensity by the distance inside, lambda g / p. The wave is 1/2 + int sinc.
#[derive(Debug)]
struct Edge(Vec<f64>);

/// Steps of the edge, and how far it is followed.
const EDGE_STEPS: f64 = 32.0;
const EDGE_REACH: f64 = 16.0;

impl Edge {
    /// Above its brightest fringe.
    const MOST: f64 = 1.2;

    fn new() -> Self {
        let mut wave = 0.0;
        let steps = (2.0 * EDGE_REACH * EDGE_STEPS) as usize;
        let at = |n: usize| n as f64 / EDGE_STEPS - EDGE_REACH;
        let mut waves = vec![wave];
        for n in 0..steps {
            wave += lf_core::halo::sinc(0.5 * (at(n) + at(n + 1))) / EDGE_STEPS;
            waves.push(wave);
        }
        // Half of the wave lies on each side.
        let middle = 0.5 - waves[steps / 2];
        Self(waves.iter().map(|wave| (wave + middle).powi(2)).collect())
    }

    fn at(&self, inside: f64) -> f64 {
        let place = (inside + EDGE_REACH) * EDGE_STEPS;
        if place <= 0.0 {
            return 0.0;
        }
        let n = place as usize;
        let Some(pair) = self.0.get(n..n + 2) else { return 1.0 };
        pair[0] + place.fract() * (pair[1] - pair[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moved rays against the transfer of the pattern, by counting points of the overlap of the cell with itself.
    #[test]
    fn rays_have_the_transfer_of_the_pattern() {
        const SIDE: i32 = 300;
        let points = || (0..SIDE * SIDE).map(|n| DVec2::new(f64::from(n % SIDE) + 0.5, f64::from(n / SIDE) + 0.5));
        let points = || points().map(|at| 1.2 * (at / f64::from(SIDE) - 0.5));
        for layout in [Layout::Square, Layout::Hexagonal] {
            let inside = |at: DVec2| match layout {
                Layout::Square => at.abs().max_element() < 0.5,
                Layout::Hexagonal => (0..3).all(|k| at.dot(DVec2::from_angle(f64::from(k) * PI / 3.0)).abs() < 0.5),
            };
            let whole = points().filter(|at| inside(*at)).count() as f64;
            let waves = Waves {
                layout,
                turn: DMat2::IDENTITY,
                pitch_mm: 1.0,
                unit_mm: 1.0,
                demagnification: 1.0,
                patterns: (0..300).map(|_| OnceLock::new()).collect(),
                edge: Edge::new(),
            };
            for blind in [f64::NAN, f64::INFINITY, 1e9] {
                assert_eq!(waves.show(blind).moves_mm(DVec2::ONE), DVec2::ZERO);
            }
            for width in [0.05, 1.0, 4.0, 20.0] {
                let shown = waves.show(width);
                for f in [(0.1, 0.0), (0.2, 0.15), (-0.4, 0.1), (0.0, 0.6)].map(DVec2::from) {
                    let moved = |at: DVec2| width * at + shown.moves_mm(at);
                    let rays = points().filter(|at| inside(*at)).map(|at| (2.0 * PI * f.dot(moved(at))).cos());
                    let overlap = points().filter(|at| inside(*at + 0.5 * f) && inside(*at - 0.5 * f));
                    let wanted = overlap.map(|at| (2.0 * PI * width * f.dot(at)).cos()).sum::<f64>() / whole;
                    let found = rays.sum::<f64>() / whole;
                    assert!((found - wanted).abs() < 0.01, "{layout:?} {width} {f}: {found} for {wanted}");
                }
            }
        }
    }

    /// The edge has a quarter of the light, is dark outside and 1 far inside.
    #[test]
    fn the_edge_is_that_of_coherent_light() {
        let (edge, at) = (Edge::new(), |n: i32| f64::from(n) / 100.0);
        assert!((edge.at(0.0) - 0.25).abs() < 1e-3);
        assert!((0..1600).all(|n| edge.at(at(n) - 8.0) < Edge::MOST));
        assert!((edge.at(12.0) - 1.0).abs() < 0.05 && edge.at(-8.0) < 0.01);
    }
}
