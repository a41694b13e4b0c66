//! Light pixel by pixel, for patches that are too wide for a table and for rays that bend too much for one.
//!
//! The corners of a pixel show places of the stop, and rays from there meet the array near the lenslet: this quadrangle
//! is the pixel's footprint. A cell is the intersection of two or three strips. So a pixel's share is the product of
//! the shares of its footprint in each strip.

use super::bend::{Node, cubic_at};
use super::stop::Stop;
use crate::weights::{blur::Blur, geometry::Geometry};
use glam::DVec2;
use std::ops::Range;

/// Pixels added on each side of those whose middles can have light: their footprints reach farther, and more where rays
/// bend.
const BESIDE_PX: f32 = 1.0;
/// Minimum width of a footprint as a fraction of a cell.
const MIN_WIDTH: f64 = 1e-4;
/// Minimum width as a fraction of its length; below it f32 rounding dominates.
const MIN_ASPECT: f32 = 2e-3;

/// The points within `half` of a line through the middle of the cell with the normal (x, y), mm.
#[derive(Debug, Clone, Copy)]
struct CellStrip {
    x: f32,
    y: f32,
    half: f32,
}

/// How a voxel blurs, as seen on the array, mm.
#[derive(Debug, Clone, Copy)]
enum WideBlur {
    None,
    /// The width.
    Box(f32),
    /// The standard deviation.
    Gauss(f32),
}

/// The light of a slice, pixel by pixel.
#[derive(Debug, Clone)]
pub(super) struct Wide {
    strips: Vec<CellStrip>,
    spread: WideBlur,
    stop: Stop,
    alpha: f32,
    /// Light of a straight ray reaches at most this far from a lenslet's centre, mm.
    reach: f32,
    least_width: f32,
    /// Whether moments matter.
    has_moments: bool,
}

/// A lenslet as a voxel sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LensletView {
    /// The middle of the stop's image, px from the micro-image's first corner.
    pub(super) middle: [f32; 2],
    /// The chief ray's place from the lenslet's centre, mm.
    pub(super) offset: [f32; 2],
    /// See [`super::array::LensletArray`].
    pub(super) per_mm: f32,
    pub(super) refocus: f32,
}

/// Pixels that are processed at once.
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// A row of a micro-image: the light of each pixel, and its moments along x and y.
#[derive(Debug, Default)]
pub(super) struct WideRow {
    /// Pixels that may have light.
    columns: Range<usize>,
    /// With room for [`LANES`] beyond the last pixel.
    parts: [Vec<f32>; 3],
    /// Approximately the sum of the weights times the stop's area in pixels.
    pub(super) weight: f32,
}

impl WideRow {
    pub(super) fn new(side: usize) -> Self {
        Self { columns: 0..0, parts: std::array::from_fn(|_| vec![0.0; side + LANES]), weight: 0.0 }
    }

    /// The first pixel that may have light, and the light or the moments from there on.
    #[inline(always)]
    pub(super) fn parts(&self, count: usize) -> (usize, impl Iterator<Item = &[f32]>) {
        let columns = self.columns.clone();
        (columns.start, self.parts.iter().take(count).map(move |part| &part[columns.clone()]))
    }
}

/// A height on a micro-image: the places on the array that it shows, x and y in mm from the lenslet's centre, as cubics
/// in the place along x in the stop, mm.
#[derive(Clone, Copy)]
struct Height([[f32; 4]; 2]);

impl Height {
    /// The places along a strip's normal.
    #[inline(always)]
    fn along(&self, x: f32, y: f32) -> [f32; 4] {
        let [by_x, by_y] = &self.0;
        let at = |n: usize| x * by_x[n] + y * by_y[n];
        [at(0), at(1), at(2), at(3)]
    }
}

/// Eight values. `array::from_fn` would not be compiled for the widest vectors.
#[inline(always)]
fn lanes(value: impl Fn(usize) -> f32) -> Lanes {
    let mut all = [0.0; LANES];
    for (n, out) in all.iter_mut().enumerate() {
        *out = value(n);
    }
    all
}

/// The values of a cubic.
#[inline(always)]
fn cubic([a, b, c, d]: [f32; 4], places: &Lanes) -> Lanes {
    lanes(
        #[inline(always)]
        |n| a + places[n] * (b + places[n] * (c + places[n] * d)),
    )
}

/// The strips of a cell: one for each pair of opposite sides.
fn strips(geometry: &Geometry) -> Vec<CellStrip> {
    let corners = geometry.optics.lattice().cell_mm();
    let side = |n: usize| {
        let (from, to) = (corners[n], corners[(n + 1) % corners.len()]);
        let normal = (to - from).perp().normalize();
        CellStrip { x: normal.x as f32, y: normal.y as f32, half: normal.dot(from).abs() as f32 }
    };
    (0..corners.len() / 2).map(side).collect()
}

impl Wide {
    pub(super) fn new(
        geometry: &Geometry,
        stop: Stop,
        blur: Blur,
        alpha: f64,
        greatest_bend: f64,
        has_moments: bool,
    ) -> Self {
        let spread = match blur {
            Blur::None => WideBlur::None,
            Blur::Box { half } => WideBlur::Box(2.0 * half as f32),
            Blur::Gauss { sigma } => WideBlur::Gauss(sigma as f32),
        };
        let reach = (geometry.corner().max_element() + blur.reach() + greatest_bend) as f32;
        let least_width = (MIN_WIDTH * geometry.pitch_mm) as f32;
        Self { strips: strips(geometry), spread, stop, alpha: alpha as f32, reach, least_width, has_moments }
    }

    /// Number of parts of a pixel's light: the light alone, or moments too.
    pub(super) fn parts(&self) -> usize {
        if self.has_moments { 3 } else { 1 }
    }

    /// Whether a row of a micro-image can have light.
    #[inline(always)]
    pub(super) fn may_light(&self, view: &LensletView, row: usize) -> bool {
        let slope = view.per_mm - view.refocus * self.alpha;
        let [_, y0] = view.offset;
        // Rays from the middle of the row; those from its edges lie half a step to either side.
        let v = view.middle[1] - (row as f32 + 0.5) + view.refocus * y0;
        let place = y0 * slope.abs() + (self.alpha * v).copysign(self.alpha * v * slope);
        place.abs() < self.reach * slope.abs() + 0.5 * self.alpha.abs()
    }

    /// Sets the light of a row of a micro-image; false if the row is dark. Moments are those of light that lies in the
    /// middle of its pixel.
    #[inline(always)]
    pub(super) fn row<const WEIGHS: bool>(
        &self,
        view: &LensletView,
        node: Option<&Node>,
        row: usize,
        out: &mut WideRow,
    ) -> bool {
        let slope = view.per_mm - view.refocus * self.alpha;
        let per_slope = if slope.abs() < 1e-12 { 0.0 } else { 1.0 / slope };
        // Find the pixels that can have light.
        let WideRow { columns, parts, weight } = out;
        *columns = self.columns(view, slope, parts[0].len() - LANES);
        // Find the places on the array that the row's upper edge, middle and lower edge show.
        let height = row as f32;
        let heights = [
            self.height(view, node, height, per_slope),
            self.height(view, node, height + 0.5, per_slope),
            self.height(view, node, height + 1.0, per_slope),
        ];
        // Compute the light of eight pixels at a time, from the places in the stop of their edges and middles.
        let first = (view.middle[0] + view.refocus * view.offset[0]) * per_slope;
        let density = (view.per_mm * per_slope) * (view.per_mm * per_slope);
        let edge = |at: f32| {
            lanes(
                #[inline(always)]
                |n| first - (at + n as f32) * per_slope,
            )
        };
        let mut brightest = 0f32;
        for from in columns.clone().step_by(LANES) {
            let at = from as f32;
            let edges = [edge(at), edge(at + 0.5), edge(at + 1.0)];
            let eight = self.eight(&heights, &edges, density, view.refocus);
            for (part, values) in parts.iter_mut().zip(&eight) {
                part[from..from + LANES].copy_from_slice(values);
            }
            brightest = eight[0].iter().fold(brightest, |most, light| most.max(*light));
        }
        if WEIGHS {
            *weight = self.weight(view, row, columns.start, &parts[0][columns.clone()]);
        }
        brightest > 0.0
    }

    /// The light of eight pixels, and its moments. The heights are those of the pixels' upper edge, middle and lower
    /// edge, the lanes the places along x in the stop of their left edges, middles and right edges.
    #[inline(always)]
    fn eight(
        &self,
        [upper, middle, lower]: &[Height; 3],
        [left, centre, right]: &[Lanes; 3],
        density: f32,
        refocus: f32,
    ) -> [Lanes; 3] {
        let mut light = [density; LANES];
        // Start with the shift of the light from a pixel's middle to its place on the stop's image.
        let [mut by_x, mut by_y] = [cubic(middle.0[0], centre), cubic(middle.0[1], centre)];
        for n in 0..LANES {
            by_x[n] *= -refocus;
            by_y[n] *= -refocus;
        }
        for strip in &self.strips {
            // Measure the footprint across the strip: its place, and its two sides.
            let (above, below) = (upper.along(strip.x, strip.y), lower.along(strip.x, strip.y));
            let (a, b) = (cubic(above, left), cubic(above, right));
            let (c, d) = (cubic(below, left), cubic(below, right));
            let (mut place, mut across, mut down) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for n in 0..LANES {
                place[n] = 0.25 * (a[n] + b[n] + c[n] + d[n]);
                across[n] = 0.5 * (b[n] - a[n] + d[n] - c[n]);
                down[n] = 0.5 * (c[n] - a[n] + d[n] - b[n]);
            }
            // Multiply the light by the footprint's share in the strip.
            let share = self.shares(strip.half, &place, &across, &down);
            for n in 0..LANES {
                light[n] *= share[n];
            }
            // Move the middle of the light: an edge that leaves a share s of a pixel moves it by (1 - s) / 2.
            if self.has_moments {
                for n in 0..LANES {
                    let length2 = greater(across[n] * across[n] + down[n] * down[n], 1e-30);
                    let moved = 0.5f32.copysign(-place[n]) * (1.0 - share[n]) / length2.sqrt();
                    by_x[n] += moved * across[n];
                    by_y[n] += moved * down[n];
                }
            }
        }
        // Turn the middles into moments.
        for n in 0..LANES {
            by_x[n] *= light[n];
            by_y[n] *= light[n];
        }
        [light, by_x, by_y]
    }

    /// The pixels of a row that can have light.
    #[inline(always)]
    fn columns(&self, view: &LensletView, slope: f32, count: usize) -> Range<usize> {
        let [x0, _] = view.offset;
        let ahead = view.middle[0] + view.refocus * x0 - 0.5;
        // A pixel's place in the stop changes by 1 / slope, and on the array by alpha as much.
        let pixels_per_mm = slope / self.alpha;
        let ends = [-self.reach - x0, self.reach - x0].map(|place| ahead - place * pixels_per_mm);
        let [low, high] = [ends[0].min(ends[1]) - BESIDE_PX, ends[0].max(ends[1]) + BESIDE_PX];
        if !(high - low).is_finite() {
            return 0..count;
        }
        (low.ceil().max(0.0) as usize).min(count)..((high.floor() + 1.0).max(0.0) as usize).min(count)
    }

    /// The light of a row that passes the stop, by the stop's chord at the middle of the row; `light` begins at column
    /// `from`.
    #[inline(always)]
    fn weight(&self, view: &LensletView, row: usize, from: usize, light: &[f32]) -> f32 {
        let half = view.per_mm * self.stop.half_mm;
        let away = row as f32 + 0.5 - view.middle[1];
        let chord = match self.stop.is_round {
            true => (half * half - away * away).max(0.0).sqrt(),
            false => half * (half + 0.5 - away.abs()).clamp(0.0, 1.0),
        };
        let inside = |n: usize| (chord + 0.5 - ((from + n) as f32 + 0.5 - view.middle[0]).abs()).clamp(0.0, 1.0);
        light.iter().enumerate().map(|(n, light)| light * inside(n)).sum()
    }

    /// The places on the array that a height of a micro-image shows.
    #[inline(always)]
    fn height(&self, view: &LensletView, node: Option<&Node>, height: f32, per_slope: f32) -> Height {
        let [x0, y0] = view.offset;
        let v = (view.middle[1] - height + view.refocus * y0) * per_slope;
        let straight = [[x0, self.alpha, 0.0, 0.0], [y0 + self.alpha * v, 0.0, 0.0, 0.0]];
        let Some(node) = node else { return Height(straight) };
        let add = |axis: usize| {
            let ([a, b, c, d], [e, f, g, h]) = (straight[axis], cubic_at(&node.departure[axis], v));
            [a + e, b + f, c + g, d + h]
        };
        Height([add(0), add(1)])
    }

    /// The shares of footprints within `half` of 0, for footprints at `place` with the sides `across` and `down`.
    #[inline(always)]
    fn shares(&self, half: f32, place: &Lanes, across: &Lanes, down: &Lanes) -> Lanes {
        let both = |n: usize| (across[n] * across[n] + down[n] * down[n]).sqrt();
        match self.spread {
            WideBlur::None => lanes(
                #[inline(always)]
                |n| inside(place[n], half, self.widths(across[n].abs(), down[n].abs())),
            ),
            WideBlur::Box(width) => lanes(
                #[inline(always)]
                |n| inside(place[n], half, self.widths(both(n), width)),
            ),
            WideBlur::Gauss(sigma) => lanes(
                #[inline(always)]
                |n| {
                    let width = 2.0 * (both(n) * both(n) / 12.0 + sigma * sigma).sqrt();
                    smooth((half - place[n]) / width) + smooth((half + place[n]) / width) - 1.0
                },
            ),
        }
    }

    #[inline(always)]
    fn widths(&self, a: f32, b: f32) -> [f32; 2] {
        let most = greater(greater(a, b), self.least_width);
        [most, greater(lesser(a, b), MIN_ASPECT * most)]
    }
}

/// The greater of two numbers, in one instruction because NaN is not handled.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The lesser of two numbers, see [`greater`].
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The share within `half` of 0 of the sum of two even distributions of these widths about `place`.
#[inline(always)]
fn inside(place: f32, half: f32, [a, b]: [f32; 2]) -> f32 {
    let (outer, inner) = (0.5 * (a + b), 0.5 * (a - b));
    let square = |value: f32| greater(value, 0.0) * greater(value, 0.0);
    let below = |place: f32| {
        let place = lesser(greater(place, -outer), outer);
        square(place + outer) - square(place + inner) - square(place - inner)
    };
    (below(half - place) + below(half + place)) / (2.0 * a * b) - 1.0
}

/// The share below `place` of the sum of three even distributions of width 1 about 0: nearly a Gaussian.
#[inline(always)]
fn smooth(place: f32) -> f32 {
    let place = lesser(greater(place, -1.5), 1.5);
    let cube = |value: f32| greater(value, 0.0) * greater(value, 0.0) * greater(value, 0.0);
    (cube(place + 1.5) - 3.0 * cube(place + 0.5) + 3.0 * cube(place - 0.5)) / 6.0
}

/// The blur of a voxel if it is the same along both axes, and otherwise their mean.
pub(super) fn round_blur([a, b]: [Blur; 2]) -> Blur {
    let mean = |a: f64, b: f64| DVec2::new(a, b).length() * std::f64::consts::FRAC_1_SQRT_2;
    match (a, b) {
        (Blur::Box { half: a }, Blur::Box { half: b }) => Blur::Box { half: mean(a, b) },
        (Blur::Gauss { sigma: a }, Blur::Gauss { sigma: b }) => Blur::Gauss { sigma: mean(a, b) },
        _ => a,
    }
}
