//! A lenslet's cell blurred by a particle's spot, and its double integral, as tables.

use super::cross::{Cross, Line};
use super::spline::Spline;
use super::table::Table;
use crate::lattice::chord;
use crate::normal::{density, distribution, integrals};
use glam::DVec2;
use ndarray::Array2;
use std::cmp::Ordering;
use std::sync::{Arc, OnceLock};

/// Tables of a cell for spots of all sizes: of a cell of any shape, or of a rectangle along the axes, whose light is a
/// product.
#[derive(Debug, Clone)]
pub(super) enum Surfaces {
    Any(Arc<Ladder<Spline>>),
    Rectangle(Arc<Ladder<Cross>>),
}

/// Tables of a cell, the smallest spot first. A table is made when it is first read.
#[derive(Debug)]
pub(super) struct Ladder<T> {
    /// Corners of the cell about the lenslet's centre, mm.
    pub(super) corners: Vec<DVec2>,
    /// Standard deviations of the spots on the array, mm, and their tables.
    rungs: Vec<(f64, OnceLock<Tables<T>>)>,
    make: fn(&[DVec2], f64) -> Tables<T>,
}

/// Both functions of a cell.
#[derive(Debug, Clone)]
pub(super) struct Tables<T> {
    /// Standard deviation of the spot on the array, mm.
    pub(super) sigma_mm: f64,
    /// H: share of the spot's light that the cell takes, by the place of the spot's middle from the lenslet's centre.
    pub(super) share: T,
    /// G: the integral of H from the lower left up to a place, mm^2.
    pub(super) integral: T,
}

/// Reach of the blur, in standard deviations; the light left out is 3e-5 on a side.
pub(super) const REACH_SIGMA: f64 = 4.0;
/// Nodes of the tables for each standard deviation. The tables err by 1e-6 of the light.
const NODES_PER_SIGMA: f64 = 4.0;
/// [`NODES_PER_SIGMA`] along a line.
const NODES_PER_SIGMA_OF_LINES: f64 = 8.0;
/// Nodes beyond the reach, so that the ends of the spline do not matter.
const MARGIN: f64 = 8.0;
/// Steps of the integral over the cell's height for each standard deviation, of five Gauss-Legendre nodes each.
const STEPS_PER_SIGMA: f64 = 1.0;
const GAUSS: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// A strip of the cell at one height.
struct Strip {
    y: f64,
    weight: f64,
    left: f64,
    right: f64,
}

impl Surfaces {
    /// For the convex cell with these corners about the lenslet's centre, mm, and spots of these standard deviations.
    pub(super) fn new(corners: &[DVec2], sigmas_mm: &[f64]) -> Self {
        let half = half_sides(corners);
        match corners.len() == 4 && corners.iter().all(|corner| (corner.abs() - half).length() < 1e-9 * half.x) {
            true => Self::Rectangle(Arc::new(Ladder::new(corners, sigmas_mm, Tables::of_rectangle))),
            false => Self::Any(Arc::new(Ladder::new(corners, sigmas_mm, Tables::of_cell))),
        }
    }

    /// Whether these are the tables for spots of these sizes and a cell whose corners lie within `off_mm` of these.
    pub(super) fn are_for(&self, corners: &[DVec2], sigmas_mm: &[f64], off_mm: f64) -> bool {
        match self {
            Self::Any(ladder) => ladder.is_for(corners, sigmas_mm, off_mm),
            Self::Rectangle(ladder) => ladder.is_for(corners, sigmas_mm, off_mm),
        }
    }

    /// Bytes of the tables that have been made.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Any(ladder) => ladder.bytes(),
            Self::Rectangle(ladder) => ladder.bytes(),
        }
    }
}

/// Half sides of the box around a cell, mm.
pub(super) fn half_sides(corners: &[DVec2]) -> DVec2 {
    corners.iter().fold(DVec2::ZERO, |half, corner| half.max(corner.abs()))
}

impl<T> Ladder<T> {
    fn new(corners: &[DVec2], sigmas_mm: &[f64], make: fn(&[DVec2], f64) -> Tables<T>) -> Self {
        let rungs = sigmas_mm.iter().map(|sigma_mm| (*sigma_mm, OnceLock::new())).collect();
        Self { corners: corners.to_vec(), rungs, make }
    }

    fn is_for(&self, corners: &[DVec2], sigmas_mm: &[f64], off_mm: f64) -> bool {
        self.corners.len() == corners.len()
            && self.corners.iter().zip(corners).all(|(own, other)| own.distance(*other) < off_mm)
            && self.rungs.iter().map(|(sigma_mm, _)| sigma_mm).eq(sigmas_mm)
    }

    /// The tables of the size that is nearest to a spot's, in the logarithm.
    #[inline(always)]
    pub(super) fn nearest(&self, spot_mm: f64) -> &Tables<T> {
        let above = self.rungs.partition_point(|(sigma_mm, _)| *sigma_mm < spot_mm).min(self.rungs.len() - 1);
        let below = above.saturating_sub(1);
        let is_below = spot_mm * spot_mm < self.rungs[below].0 * self.rungs[above].0;
        let (sigma_mm, tables) = &self.rungs[if is_below { below } else { above }];
        tables.get_or_init(|| (self.make)(&self.corners, *sigma_mm))
    }
}

impl<T: Table> Ladder<T> {
    fn bytes(&self) -> usize {
        let made = self.rungs.iter().filter_map(|(_, tables)| tables.get());
        made.map(|tables| tables.share.bytes() + tables.integral.bytes()).sum()
    }
}

impl Tables<Spline> {
    /// For a convex cell.
    fn of_cell(corners: &[DVec2], sigma_mm: f64) -> Self {
        let half = half_sides(corners);
        let step = sigma_mm / NODES_PER_SIGMA;
        let reach = half + REACH_SIGMA * sigma_mm + MARGIN * step;
        let nodes = [reach.x, reach.y].map(|reach| (2.0 * reach / step).ceil() as usize + 1);
        let low = [-reach.x, -reach.y];
        let strips = strips(corners, sigma_mm);
        let s = sigma_mm;
        // Along x: for each strip, at each node, the light of the strip left of the node, its density, and their
        // derivatives by s. Along y the same of a strip's height.
        let across = |strip: &Strip, x: f64| {
            let (a, b) = ((x - strip.left) / s, (x - strip.right) / s);
            let by_s = -(a * density(a) - b * density(b)) / s;
            let ([share_a, ramp_a], [share_b, ramp_b]) = (integrals(a), integrals(b));
            [s * (ramp_a - ramp_b), density(a) - density(b), share_a - share_b, by_s]
        };
        let down = |strip: &Strip, y: f64| {
            let z = (y - strip.y) / s;
            let (phi, w) = (density(z), strip.weight);
            [w * distribution(z), -w * z * phi / s, w * phi / s, w * (z * z - 1.0) * phi / (s * s)]
        };
        let at_nodes = |axis: usize, of: &dyn Fn(&Strip, f64) -> [f64; 4]| {
            let numbers = Array2::from_shape_fn((strips.len(), nodes[axis]), |(strip, node)| {
                of(&strips[strip], low[axis] + node as f64 * step)
            });
            [0, 1, 2, 3].map(|n| numbers.mapv(|numbers| numbers[n]))
        };
        let [sum, sum_by_s, level, level_by_s] = at_nodes(0, &across);
        let [up_to, up_to_by_s, here, here_by_s] = at_nodes(1, &down).map(Array2::reversed_axes);
        let row_by_row = |table: Array2<f64>| table.into_iter().collect();
        let integral_by_s = row_by_row(up_to_by_s.dot(&sum) + up_to.dot(&sum_by_s));
        let share_by_s = row_by_row(here_by_s.dot(&level) + here.dot(&level_by_s));
        let (integral, share) = (row_by_row(up_to.dot(&sum)), row_by_row(here.dot(&level)));
        let share = Spline::new(low, step, nodes, share, share_by_s).quick();
        let integral = Spline::new(low, step, nodes, integral, integral_by_s);
        Self { sigma_mm, share, integral }
    }
}

impl Tables<Cross> {
    /// For a rectangle along the axes.
    fn of_rectangle(corners: &[DVec2], sigma_mm: f64) -> Self {
        let half = half_sides(corners);
        let step = sigma_mm / NODES_PER_SIGMA_OF_LINES;
        let line = |half: f64, of: &dyn Fn(f64, f64) -> [f64; 2]| {
            let reach = half + REACH_SIGMA * sigma_mm + MARGIN * step;
            let count = (2.0 * reach / step).ceil() as usize + 1;
            let at = |n: usize| {
                let x = -reach + n as f64 * step;
                of((x + half) / sigma_mm, (x - half) / sigma_mm)
            };
            let (values, by_size) = (0..count).map(at).map(|[value, by_size]| (value, by_size)).unzip();
            Line::new(-reach, step, values, by_size)
        };
        let share = |a: f64, b: f64| [distribution(a) - distribution(b), -(a * density(a) - b * density(b)) / sigma_mm];
        let integral = |a: f64, b: f64| [sigma_mm * (integrals(a)[1] - integrals(b)[1]), density(a) - density(b)];
        Self {
            sigma_mm,
            share: Cross::new([line(half.x, &share), line(half.y, &share)]),
            integral: Cross::new([line(half.x, &integral), line(half.y, &integral)]),
        }
    }
}

/// Strips that add up to the integral over the cell's height.
fn strips(corners: &[DVec2], sigma_mm: f64) -> Vec<Strip> {
    let mut breaks: Vec<f64> = corners.iter().map(|corner| corner.y).collect();
    breaks.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    let mut strips = Vec::new();
    for pair in breaks.windows(2).filter(|pair| pair[1] - pair[0] > 1e-12 * sigma_mm) {
        let count = ((pair[1] - pair[0]) / sigma_mm * STEPS_PER_SIGMA).ceil().max(1.0);
        let half = 0.5 * (pair[1] - pair[0]) / count;
        for n in 0..count as usize {
            let middle = pair[0] + half * (2 * n + 1) as f64;
            strips.extend(GAUSS.map(|(node, weight)| {
                let y = middle + half * node;
                let [left, right] = chord(corners, y);
                Strip { y, weight: weight * half, left, right }
            }));
        }
    }
    strips
}

#[cfg(test)]
mod tests {
    use super::*;

    /// H and G at a place, each with slopes and derivative by the size.
    fn read(surface: &Surfaces, [x, y]: [f64; 2]) -> [[f64; 4]; 2] {
        fn both<T: Table>(tables: &Tables<T>, x: f64, y: f64) -> [[f64; 4]; 2] {
            [&tables.share, &tables.integral].map(|t| t.at::<8>(&t.taps(0, x, 0.0), &t.taps(1, y, 0.0), 0.0))
        }
        match surface {
            Surfaces::Any(ladder) => both(ladder.nearest(0.0), x, y),
            Surfaces::Rectangle(ladder) => both(ladder.nearest(0.0), x, y),
        }
    }

    /// By hand: a square of side 2 with a spot of 0.1, and the same with a corner cut off by next to nothing. In the
    /// middle it takes all; on an edge a half; at a corner a quarter. Its integral up to beyond the far corner is its
    /// area.
    #[test]
    fn a_square_cell_by_hand() {
        let corners = [DVec2::new(-1.0, -1.0), DVec2::new(1.0, -1.0), DVec2::new(1.0, 1.0), DVec2::new(-1.0, 1.0)];
        let five = [&corners[..3], &[DVec2::new(-0.999_999, 1.0), DVec2::new(-1.0, 0.999_999)]].concat();
        for surface in [Surfaces::new(&corners, &[0.1]), Surfaces::new(&five, &[0.1])] {
            for (x, y, share) in [(0.0, 0.0, 1.0), (1.0, 0.2, 0.5), (-1.0, 1.0, 0.25), (1.6, 0.0, 0.0)] {
                let got = read(&surface, [x, y])[0][0];
                assert!((got - share).abs() < 1e-4, "{x} {y}: {got}");
            }
            for (x, y, area) in [(3.0, 3.0, 4.0), (0.0, 3.0, 2.0), (0.5, -0.25, 1.5 * 0.75), (-2.0, 3.0, 0.0)] {
                assert!((read(&surface, [x, y])[1][0] - area).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn tables_grow_with_the_size_as_their_derivative_says() {
        let ring = |count: usize, turn: f64| -> Vec<DVec2> {
            let angle = |n: usize| turn + n as f64 * std::f64::consts::TAU / count as f64;
            (0..count).map(|n| DVec2::from_angle(angle(n)) * 0.045).collect()
        };
        for corners in [ring(6, 0.003), ring(4, std::f64::consts::FRAC_PI_4)] {
            let [less, mid, more] = [0.00398, 0.004, 0.00402].map(|sigma| Surfaces::new(&corners, &[sigma]));
            for place in [[0.0, 0.0], [0.04, 0.01], [0.03, -0.02], [-0.038, 0.0]] {
                for table in 0..2 {
                    let slope = (read(&more, place)[table][0] - read(&less, place)[table][0]) / 4e-5;
                    let [level, .., said] = read(&mid, place)[table];
                    assert!((slope - said).abs() < 2e-3 * (level / 0.004), "{place:?}: {slope} for {said}");
                }
            }
        }
    }
}
