//! The image of a rectangular cell behind a square stop on a blurred sensor: light is a factor along x times one along
//! y, and each factor is an integral over the stop along its axis.
//!
//! ```text
//! factor = int_stop H(m + alpha U - c) K(U) dU
//! ```
//!
//! Here H is the cell blurred by the spot, and K the pixel blurred by the sensor. K is a difference of two normal
//! distributions, one for each edge of the pixel, so the integral is taken once for each edge.
//!
//! Where the stop's rim does not cut the rise or the fall of H, both blurs add up to one and the integral is known:
//!
//! ```text
//! int_r^inf Phi((u - U) / b) dU = b psi((u - r) / b),   psi(z) = z Phi(z) + phi(z)
//! ```
//!
//! with the sensor's blur b for a limit r of the stop, and both blurs for a limit of the cell. Elsewhere panels of
//! Gauss-Legendre follow the width of both blurs, with ends where H rises and falls.

use super::axis::Axis;
use super::cross::Cross;
use super::edge_sums::{Edge, EdgeSums};
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

/// An end of H along the stop, of the cell or of the stop itself.
#[derive(Debug, Clone, Copy)]
struct Limit {
    place: f64,
    /// Standard deviation of all blur there, of the spot's part, and the derivative of the first by the sensor's part.
    width: f64,
    rise: f64,
    by_width: f64,
    /// 1 for the lower end, -1 for the upper one.
    sign: f64,
}

impl Limit {
    /// Adds the integral beyond this limit to the edge at `u`.
    #[inline(always)]
    fn add_to(&self, blur: &SensorBlur, alpha: f64, u: f64, sum: &mut Edge) {
        let Self { place, width, rise, by_width, sign } = *self;
        let z = (u - place) / width;
        let Some((share, density)) = blur.bell.at(z) else { return };
        let (share, density) = (sign * share, sign * density);
        sum.by_cell[0] += width * (z * share + density);
        if rise > 0.0 {
            let by_rise = density * rise / width;
            sum.by_cell[1] += share / alpha;
            sum.by_cell[2] += (share * place - by_rise * rise) / alpha;
            sum.by_cell[3] += by_rise / alpha.abs();
        }
        sum.by_kernel[0] += share;
        sum.by_kernel[1] += density * by_width;
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
        let Span { axis, alpha, edges, .. } = *span;
        let sigma = blur.sigma_px * axis.per_slope.abs();
        sums.edges.clear();
        sums.edges.resize(edges.len(), Edge::default());
        sums.beyond.clear();
        sums.beyond.resize(edges.len() + 1, [0.0; 4]);
        let EdgeSums { ends, edges: by_edge, beyond } = sums;
        match self.limits(sigma, span) {
            Some(limits) => {
                for (edge, sum) in edges.iter().zip(by_edge.iter_mut()) {
                    limits.iter().for_each(|limit| limit.add_to(blur, alpha, edge.u, sum));
                }
            }
            None => self.add_panels(blur, sigma, span, ends, by_edge, beyond),
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

    /// Where H ends below and above, unless the rim of the stop cuts its rise or its fall.
    #[inline(always)]
    fn limits(&self, sigma: f64, &Span { axis, alpha, corner, .. }: &Span) -> Option<[Limit; 2]> {
        let half = self.view.optics.half_aperture_mm;
        let rise = self.spot_mm / alpha.abs();
        let ends = [-corner, corner].map(|side| (side - axis.chief) / alpha);
        let is_cut = |end: f64| (end.abs() - half).abs() < REACH * rise;
        if !rise.is_finite() || ends.iter().any(|end| is_cut(*end)) {
            return None;
        }
        let width = (sigma * sigma + rise * rise).sqrt();
        let limit = |end: f64, sign: f64| {
            let rim = Limit { place: half.copysign(end), width: sigma, rise: 0.0, by_width: 1.0, sign };
            if end.abs() > half { rim } else { Limit { place: end, width, rise, by_width: sigma / width, sign } }
        };
        Some([limit(ends[0].min(ends[1]), 1.0), limit(ends[0].max(ends[1]), -1.0)])
    }

    /// Adds the integral panel by panel.
    #[inline(always)]
    fn add_panels(
        &self,
        blur: &SensorBlur,
        sigma: f64,
        span: &Span,
        ends: &mut Vec<f64>,
        by_edge: &mut [Edge],
        beyond: &mut [[f64; 4]],
    ) {
        let Span { axis, alpha, corner, .. } = *span;
        let spot = self.spot_mm;
        self.cut_panels(ends, span);
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
