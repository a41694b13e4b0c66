//! The pattern of a lenslet's cell in a particle's light, which converges behind the array: Fresnel diffraction.
//!
//! A particle's shadow of the cell grows by `g` px a mm on the array. The wave on the cell is curved by as much, so the
//! sensor sees the far field of the cell and of that curvature together. At a frequency f, 1/px, the pattern's transfer
//! is an integral over the overlap of the cell with the cell moved by `d = unit pitch f`, about the overlap's middle:
//!
//! ```text
//! S(f) = 1/A int_overlap cos(2 pi g f x) dx
//! ```
//!
//! For g = 0 it is the transfer of the far field, and without waves that of the cell's shadow.

use super::cell_nodes::CellNodes;
use super::stop_wave::StopWaves;
use crate::camera::Diffraction;
use crate::halo::sinc;
use glam::DVec2;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// A cell in waves.
#[derive(Debug, Clone)]
pub(super) struct WaveCell {
    /// Corners about the middle, mm, against the clock.
    corners: Vec<DVec2>,
    /// Normals of the sides, and the sides' distances from the middle, mm.
    sides: Vec<(DVec2, f64)>,
    area_mm2: f64,
    /// lambda g / p, px, and how far a frequency moves the cell, mm px.
    pub(super) unit_px: f64,
    spread_mm: f64,
    /// Standard deviation of the Gaussian that other images take for the middle of the far field, px.
    middle_px: f64,
    /// The stop before it.
    pub(super) stop: StopWaves,
    /// The corners in pitches, and nodes on the cell by [`NODES`] more along its width.
    shape: Vec<DVec2>,
    nodes: Vec<OnceLock<CellNodes>>,
}

/// The rim of the stop is followed this far on both sides, in the width of a wave's edge.
const RIM: f64 = 3.0;

/// Numbers of nodes along a cell differ by this.
const NODES: usize = 2;
/// The largest number of nodes along a cell, in this unit.
const MOST_NODES: usize = 90;

/// Fringes are followed this far beside the shadow, in lambda g / p.
const FRINGES: f64 = 3.0;

/// Largest difference of lambda g / p of cameras that share pictures.
const ALIKE: f64 = 0.01;

impl WaveCell {
    /// A cell of a lattice behind a round or a square stop, which has this half width on the sensor.
    pub(super) fn new(
        corners: &[DVec2],
        pitch_mm: f64,
        pattern: Diffraction,
        (half_px, is_round): (f64, bool),
    ) -> Self {
        let (unit_px, middle_px) = (pattern.unit_px, pattern.core_px());
        let spread_mm = unit_px * pitch_mm;
        let side = |n: usize| {
            let out = (corners[n] - corners[(n + 1) % corners.len()]).perp().normalize();
            (out, out.dot(corners[n]))
        };
        let sides = (0..corners.len()).map(side).collect();
        Self {
            corners: corners.to_vec(),
            sides,
            area_mm2: area(corners),
            unit_px,
            spread_mm,
            middle_px,
            stop: StopWaves::new(half_px / unit_px, is_round),
            shape: corners.iter().map(|corner| *corner / pitch_mm).collect(),
            nodes: (0..=MOST_NODES).map(|_| OnceLock::new()).collect(),
        }
    }

    /// Nodes on the cell, at least this number along its width.
    pub(super) fn nodes(&self, least: usize) -> &CellNodes {
        let n = least.div_ceil(NODES).clamp(1, MOST_NODES);
        self.nodes[n].get_or_init(|| CellNodes::new(&self.shape, n * NODES))
    }

    /// How far beside the shadow fringes are followed, px.
    pub(super) fn fringes_px(&self) -> f64 {
        FRINGES * self.unit_px
    }

    /// How far from the rim of the stop waves are followed where a cell's shadow is this wide, px.
    pub(super) fn rim_px(&self, shadow_px: f64) -> f64 {
        self.unit_px * RIM * (0.5 * shadow_px / self.unit_px).sqrt().max(1.0)
    }

    /// Whether the cells of another camera, of the same size, show what these show.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let alike = |own: f64, other: f64| (other / own - 1.0).abs() < ALIKE;
        alike(self.unit_px, other.unit_px)
            && alike(self.stop.half, other.stop.half)
            && self.stop.is_round == other.stop.is_round
    }

    /// The transfer at a frequency, 1/px, for a shadow that grows by `growth` px a mm.
    fn transfer(&self, frequency: DVec2, growth: f64) -> f64 {
        let moved = self.spread_mm * frequency;
        // Each side of the overlap is nearer to the middle by half of the motion across it.
        let overlap = self
            .sides
            .iter()
            .fold(self.corners.clone(), |kept, (out, far)| clip(&kept, *out, far - 0.5 * out.dot(moved).abs()));
        integral_of_wave(&overlap, 2.0 * PI * growth * frequency) / self.area_mm2
    }

    /// The means of the pattern, blurred by a Gaussian, over pixels whose middles are `1 / per_px` px apart: row by
    /// row, `half` pixels on each side of its middle.
    pub(super) fn means(&self, growth: f64, blur_px: f64, half: [usize; 2], per_px: usize) -> Vec<f64> {
        let nodes = half.map(|half| 2 * half * per_px);
        let most = (FARTHEST / self.unit_px).min(0.5 * per_px as f64);
        let step = half.map(|half| 1.0 / (2 * half) as f64);
        let count = step.map(|step| (most / step) as i64);
        let frequency = |n: i64, axis: usize| n as f64 * step[axis];
        let wave = |n: i64, axis: usize| -> Vec<DVec2> {
            let at = |node: usize| (node as f64 - 0.5 * nodes[axis] as f64) / per_px as f64;
            (0..nodes[axis]).map(|node| DVec2::from_angle(2.0 * PI * frequency(n, axis) * at(node))).collect()
        };
        let across: Vec<Vec<DVec2>> = (-count[0]..=count[0]).map(|n| wave(n, 0)).collect();
        let blur_px2 = (blur_px * blur_px - self.middle_px * self.middle_px).max(0.0);
        let whole = self.area_mm2 * growth * growth * step[0] * step[1];
        let mut means = vec![0.0; nodes[0] * nodes[1]];
        // Frequencies come in pairs of opposite sign: half of the plane is enough.
        for m in 0..=count[1] {
            let mut row = vec![DVec2::ZERO; nodes[0]];
            for (n, wave) in (-count[0]..=count[0]).zip(&across) {
                let f = DVec2::new(frequency(n, 0), frequency(m, 1));
                let damped = sinc(f.x) * sinc(f.y) * (-2.0 * PI * PI * blur_px2 * f.length_squared()).exp();
                let level = damped * self.transfer(f, growth);
                row.iter_mut().zip(wave).for_each(|(sum, wave)| *sum += level * *wave);
            }
            let pair = if m == 0 { whole } else { 2.0 * whole };
            for (line, wave) in means.chunks_mut(nodes[0]).zip(wave(m, 1)) {
                line.iter_mut().zip(&row).for_each(|(sum, row)| *sum += pair * (row.x * wave.x - row.y * wave.y));
            }
        }
        means
    }
}

/// Beyond this frequency, over lambda g / p, no cell overlaps itself.
const FARTHEST: f64 = 1.2;

/// The integral of cos(wave x) over a polygon about the middle, by the flux through its sides.
fn integral_of_wave(corners: &[DVec2], wave: DVec2) -> f64 {
    let longest = corners.iter().map(|corner| corner.dot(wave).abs()).fold(0.0, f64::max);
    if longest < SHORT {
        return area(corners);
    }
    let flux = |n: usize| {
        let (a, b) = (corners[n], corners[(n + 1) % corners.len()]);
        (b - a).perp_dot(wave) * (0.5 * (a + b)).dot(wave).sin() * sinc(0.5 * (b - a).dot(wave) / PI)
    };
    let sum: f64 = (0..corners.len()).map(flux).sum();
    -sum / wave.length_squared()
}

/// A wave that turns by less than this, rad, is taken as flat. Its mean errs by the square.
const SHORT: f64 = 1e-4;

/// The part of a convex polygon no farther than `far` from the middle along `out`.
fn clip(corners: &[DVec2], out: DVec2, far: f64) -> Vec<DVec2> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (n, from) in corners.iter().enumerate() {
        let to = corners[(n + 1) % corners.len()];
        let [before, after] = [*from, to].map(|corner| far - out.dot(corner));
        if before >= 0.0 {
            kept.push(*from);
        }
        if before * after < 0.0 {
            kept.push(*from + (to - *from) * (before / (before - after)));
        }
    }
    kept
}

/// Area of a polygon with its corners against the clock.
fn area(corners: &[DVec2]) -> f64 {
    0.5 * (0..corners.len()).map(|n| corners[n].perp_dot(corners[(n + 1) % corners.len()])).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Layout;

    fn pattern(unit_px: f64) -> Diffraction {
        Diffraction { layout: Layout::Square, unit_px }
    }

    fn cells() -> [Vec<DVec2>; 2] {
        let ring = |count: usize, radius: f64, turn: f64| {
            (0..count).map(|n| radius * DVec2::from_angle(turn + n as f64 * 2.0 * PI / count as f64)).collect()
        };
        [ring(4, 0.5f64.sqrt(), PI / 4.0), ring(6, 3f64.sqrt() / 3.0, PI / 6.0)]
    }

    /// By counting points of the overlap.
    #[test]
    fn means_are_those_of_points_in_both_cells() {
        for corners in cells() {
            let cell = WaveCell::new(&corners, 1.0, pattern(1.0), (9.0, true));
            let inside = |at: DVec2| {
                (0..corners.len()).all(|n| {
                    let (a, b) = (corners[n], corners[(n + 1) % corners.len()]);
                    (b - a).perp_dot(at - a) >= 0.0
                })
            };
            for (f, growth) in [((0.3, 0.1), 4.0), ((0.0, 0.7), 9.0), ((-0.5, 0.45), 2.0), ((0.02, 0.0), 30.0)] {
                let f = DVec2::from(f);
                let (mut sum, mut count) = (0.0, 0.0);
                for n in 0..1_000_000 {
                    let at = DVec2::new(f64::from(n % 1000) + 0.5, f64::from(n / 1000) + 0.5) * 1.2e-3 - 0.6;
                    if inside(at + 0.5 * f) && inside(at - 0.5 * f) {
                        sum += (2.0 * PI * growth * f.dot(at)).cos();
                    }
                    if inside(at) {
                        count += 1.0;
                    }
                }
                let found = cell.transfer(f, growth);
                assert!((found - sum / count).abs() < 3e-3, "{f} {growth}: {found} for {}", sum / count);
            }
        }
    }

    /// Without waves the means are those of the cell's shadow: in its middle 1, and their sum its area.
    #[test]
    fn without_waves_it_is_the_shadow() {
        for corners in cells() {
            let cell = WaveCell::new(&corners, 1.0, pattern(1e-9), (9.0, true));
            let means = cell.means(6.0, 0.5, [8, 8], 4);
            let sum = means.iter().sum::<f64>() / 16.0;
            assert!((sum / (36.0 * cell.area_mm2) - 1.0).abs() < 1e-3, "{sum}");
            assert!((means[32 * 64 + 32] - 1.0).abs() < 0.02, "{}", means[32 * 64 + 32]);
        }
    }
}
