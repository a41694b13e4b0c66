//! The image of a rectangular cell behind a square stop on a blurred sensor: light is a factor along x times one along
//! y, and each factor is an integral over the stop along its axis.
//!
//! ```text
//! factor = int_stop H(m + alpha U - c) K(U) dU
//! ```
//!
//! Here H is the cell blurred by the spot, and K the pixel blurred by the sensor. K is a difference of two normal
//! distributions, one for each edge of the pixel, so the integral is taken once for each edge. Panels of
//! Gauss-Legendre follow the width of both blurs, with ends where H rises and falls.

use super::axis::Axis;
use super::cross::Cross;
use super::factor::Factor;
use super::lenslet_image::LensletImage;
use super::place::Place;
use super::sensor_blur::SensorBlur;

/// Gauss-Legendre with four nodes on (-1, 1).
const NODES: [f64; 4] =
    [-0.861_136_311_594_052_6, -0.339_981_043_584_856_3, 0.339_981_043_584_856_3, 0.861_136_311_594_052_6];
const WEIGHTS: [f64; 4] =
    [0.347_854_845_137_453_85, 0.652_145_154_862_546_1, 0.652_145_154_862_546_1, 0.347_854_845_137_453_85];
/// Largest panel in standard deviations of the sensor's blur, and of the spot where H rises or falls.
const PANEL_OF_BLUR: f64 = 2.5;
const PANEL_OF_SPOT: f64 = 4.0;
/// A normal distribution is 0 or 1 beyond this many standard deviations.
const REACH: f64 = 4.0;

/// A pixel's edge along one axis: the integral of H times the normal distribution up to the edge, and its derivatives.
#[derive(Debug, Clone, Copy, Default)]
struct Edge {
    /// The integral; its derivatives by the place on the array, plain and times the place in the stop, and by the size.
    by_cell: [f64; 4],
    /// Its derivatives by the place of the edge in the stop, and by the blur.
    by_kernel: [f64; 2],
}

impl Edge {
    #[inline(always)]
    fn add(&mut self, cell: &[f64; 4], share: f64) {
        self.by_cell.iter_mut().zip(cell).for_each(|(sum, value)| *sum += share * value);
    }
}

/// A lenslet along one axis, and the pixels that it lights.
pub(super) struct Span<'a> {
    pub(super) axis: &'a Axis,
    pub(super) alpha: f64,
    /// Half the cell, mm.
    pub(super) corner: f64,
    /// The first pixel, and the places of all edges in the stop.
    pub(super) first: i64,
    pub(super) edges: &'a [Place],
}

/// Buffers of a thread.
#[derive(Debug, Default)]
pub(super) struct EdgeSums {
    ends: Vec<f64>,
    edges: Vec<Edge>,
    /// What all edges beyond one have, by the first of them.
    beyond: Vec<[f64; 4]>,
}

impl LensletImage<'_, Cross> {
    /// Fills the factors of a lenslet's pixels.
    #[inline(always)]
    pub(super) fn blurred_factors(
        &self,
        blur: &SensorBlur,
        span: &Span,
        sums: &mut EdgeSums,
        factors: &mut Vec<Factor>,
    ) {
        let Span { axis, alpha, corner, edges, .. } = *span;
        let spot = self.spot_mm;
        let sigma = blur.sigma_px * axis.per_slope.abs();
        sums.edges.clear();
        sums.edges.resize(edges.len(), Edge::default());
        sums.beyond.clear();
        sums.beyond.resize(edges.len() + 1, [0.0; 4]);
        self.cut_panels(&mut sums.ends, span);
        let EdgeSums { ends, edges: by_edge, beyond } = sums;

        for ends in ends.windows(2) {
            let middle = axis.chief + alpha * (0.5 * (ends[0] + ends[1]));
            let [low, high] = [(middle + corner) / spot, (middle - corner) / spot];
            if low < -REACH || high > REACH {
                continue;
            }
            let is_flat = low > REACH && high < -REACH;
            let rise = if is_flat { f64::INFINITY } else { PANEL_OF_SPOT * spot / alpha.abs() };
            let most = rise.min(PANEL_OF_BLUR * sigma);
            let count = ((ends[1] - ends[0]) / most).ceil().max(1.0);
            let half = 0.5 * (ends[1] - ends[0]) / count;
            for panel in 0..count as usize {
                let centre = ends[0] + half * (2 * panel + 1) as f64;
                for (node, weight) in NODES.iter().zip(WEIGHTS) {
                    self.add_node(blur, span, (centre + half * node, half * weight), by_edge, beyond);
                }
            }
        }

        // Add what lies beyond, and take differences.
        let from_first = axis.per_slope < 0.0;
        let mut sum = Edge::default();
        for k in 0..edges.len() {
            let n = if from_first { k } else { edges.len() - 1 - k };
            sum.add(&beyond[if from_first { n } else { n + 1 }], 1.0);
            by_edge[n].add(&sum.by_cell, 1.0);
        }
        let sign = if from_first { 1.0 } else { -1.0 };
        let at = |n: usize| {
            let Edge { by_cell: [light, by_x, by_x_u, by_size], by_kernel: [by_edge, by_blur] } = by_edge[n];
            let [m, alpha, shift] = edges[n].u_by;
            Factor {
                light,
                by_m: by_x + m * by_edge,
                by_alpha: by_x_u + alpha * by_edge,
                by_size,
                by_shift: shift * by_edge - by_x,
                by_blur: by_blur * axis.per_slope.abs(),
            }
        };
        factors.clear();
        let mut before = at(0);
        for n in 1..edges.len() {
            let after = at(n);
            factors.push(after.mix(sign, &before, -sign));
            before = after;
        }
    }

    /// Ends of the panels in the stop: its own edges, and where H begins, is halfway and ends to rise and fall.
    fn cut_panels(&self, ends: &mut Vec<f64>, &Span { axis, alpha, corner, .. }: &Span) {
        let half = self.view.optics.half_aperture_mm;
        ends.clear();
        ends.extend([-half, half]);
        for side in [-corner, corner] {
            for beside in [-REACH, 0.0, REACH] {
                let end = (side + beside * self.spot_mm - axis.chief) / alpha;
                if end.abs() < half {
                    ends.push(end);
                }
            }
        }
        ends.sort_by(f64::total_cmp);
    }

    /// Adds a node of the integral, a place in the stop with its weight, to the edges that it concerns.
    #[inline(always)]
    fn add_node(
        &self,
        blur: &SensorBlur,
        &Span { axis, alpha, corner, first, edges }: &Span,
        (u, weight): (f64, f64),
        by_edge: &mut [Edge],
        beyond: &mut [[f64; 4]],
    ) {
        // The cell at this place, with its derivatives by the place on the array and by the size.
        let per_spot = 1.0 / self.spot_mm;
        let x = axis.chief + alpha * u;
        let (low, high) = ((x + corner) * per_spot, (x - corner) * per_spot);
        let ((a, a_by), (b, b_by)) = (blur.bell.at(low).unwrap_or_default(), blur.bell.at(high).unwrap_or_default());
        let (weight_by, light) = (weight * per_spot, weight * (a - b));
        let by_x = weight_by * (a_by - b_by);
        let cell = [light, by_x, u * by_x, weight_by * (high * b_by - low * a_by)];

        // The edges nearby see a part of it, those farther along the stop all.
        let place = axis.zero - axis.slope * u - first as f64;
        let reach = REACH * blur.sigma_px;
        let low = ((place - reach).max(-1.0) as i64 + 1).clamp(0, edges.len() as i64) as usize;
        let high = ((place + reach).max(-1.0) as i64 + 1).clamp(low as i64, edges.len() as i64) as usize;
        let all = &mut beyond[if axis.per_slope < 0.0 { high } else { low }];
        all.iter_mut().zip(&cell).for_each(|(sum, value)| *sum += value);
        let per_sigma = axis.slope.abs() / blur.sigma_px;
        for (edge, sum) in edges[low..high].iter().zip(&mut by_edge[low..high]) {
            let z = (edge.u - u) * per_sigma;
            let (share, density) = blur.bell.at(z).unwrap_or_default();
            sum.add(&cell, share);
            let by_edge = density * per_sigma * light;
            sum.by_kernel[0] += by_edge;
            sum.by_kernel[1] -= z * by_edge;
        }
    }
}
