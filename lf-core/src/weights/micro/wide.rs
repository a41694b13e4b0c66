//! Light pixel by pixel: where a patch is wider than a table can hold, or where rays bend too much for one.
//!
//! The corners of a pixel show places of the stop, and rays from there meet the array near the lenslet. A cell is what
//! lies within two or three strips. So a pixel's share is the product of the shares of its footprint in each strip.

use super::bend::{Node, value};
use super::stop::Stop;
use crate::weights::{blur::Blur, geometry::Geometry};
use glam::DVec2;
use std::ops::Range;

/// Pixels beside those whose middles can have light: their footprints reach farther, and more so where rays bend.
const BESIDE_PX: f32 = 1.0;
/// A footprint is no narrower than this part of a cell.
const LEAST_WIDTH: f64 = 1e-4;
/// Neither is it narrower than this part of its own length, for the sake of rounding.
const LEAST_ASPECT: f32 = 2e-3;

/// The points no farther than `half` from a line through the middle of the cell, which has the normal (x, y), mm.
#[derive(Debug, Clone, Copy)]
struct Strip {
    x: f32,
    y: f32,
    half: f32,
}

/// How a voxel blurs, as seen on the array, mm.
#[derive(Debug, Clone, Copy)]
enum Spread {
    None,
    /// The width.
    Box(f32),
    /// The standard deviation.
    Gauss(f32),
}

/// The light of a slice, pixel by pixel.
#[derive(Debug, Clone)]
pub(super) struct Wide {
    strips: Vec<Strip>,
    spread: Spread,
    stop: Stop,
    alpha: f32,
    /// Light of a ray that would run straight reaches no farther from a lenslet's centre, mm.
    reach: f32,
    least_width: f32,
    /// Whether moments matter.
    has_moments: bool,
}

/// A lenslet as a voxel sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// The middle of the stop's image, px from the micro-image's first corner.
    pub(super) middle: [f32; 2],
    /// The chief ray's place from the lenslet's centre, mm.
    pub(super) offset: [f32; 2],
    /// See [`super::array::Array`].
    pub(super) per_mm: f32,
    pub(super) refocus: f32,
}

/// A row of a micro-image: the light of each pixel, and its moments along x and y.
#[derive(Debug, Default)]
pub(super) struct WideRow {
    /// Pixels that may have light.
    columns: Range<usize>,
    parts: [Vec<f32>; 3],
    /// Roughly the sum of the weights times the stop's area in pixels.
    pub(super) weight: f32,
    /// Places on the array of the upper and the lower corners of the pixels, x and y, mm from the lenslet's centre.
    corners: [[Vec<f32>; 2]; 2],
}

impl WideRow {
    pub(super) fn new(side: usize) -> Self {
        Self {
            columns: 0..0,
            parts: std::array::from_fn(|_| vec![0.0; side]),
            weight: 0.0,
            corners: std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; side + 1])),
        }
    }
}

impl WideRow {
    /// The first pixel that may have light, and the light or the moments from there on.
    #[inline(always)]
    pub(super) fn parts(&self, count: usize) -> (usize, impl Iterator<Item = &[f32]>) {
        let columns = self.columns.clone();
        (columns.start, self.parts.iter().take(count).map(move |part| &part[columns.clone()]))
    }
}

/// The strips of a cell: one for each pair of opposite sides.
fn strips(geometry: &Geometry) -> Vec<Strip> {
    let corners = geometry.optics.lattice().cell_mm();
    let side = |n: usize| {
        let (from, to) = (corners[n], corners[(n + 1) % corners.len()]);
        let normal = (to - from).perp().normalize();
        Strip { x: normal.x as f32, y: normal.y as f32, half: normal.dot(from).abs() as f32 }
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
            Blur::None => Spread::None,
            Blur::Box { half } => Spread::Box(2.0 * half as f32),
            Blur::Gauss { sigma } => Spread::Gauss(sigma as f32),
        };
        let reach = (geometry.corner().max_element() + blur.reach() + greatest_bend) as f32;
        let least_width = (LEAST_WIDTH * geometry.pitch_mm) as f32;
        Self { strips: strips(geometry), spread, stop, alpha: alpha as f32, reach, least_width, has_moments }
    }

    /// Parts of a pixel's light that matter: the light, or moments too.
    pub(super) fn parts(&self) -> usize {
        if self.has_moments { 3 } else { 1 }
    }

    /// Whether a row of a micro-image can have light.
    #[inline(always)]
    pub(super) fn may_light(&self, view: &View, row: usize) -> bool {
        let slope = view.per_mm - view.refocus * self.alpha;
        let [_, y0] = view.offset;
        // Rays from the middle of the row; those from its edges lie half a step to either side.
        let v = view.middle[1] - (row as f32 + 0.5) + view.refocus * y0;
        let place = y0 * slope.abs() + (self.alpha * v).copysign(self.alpha * v * slope);
        place.abs() < self.reach * slope.abs() + 0.5 * self.alpha.abs()
    }

    /// Sets the light of a row of a micro-image; false if there is none. Moments are those of light that lies in the
    /// middle of its pixel.
    #[inline(always)]
    pub(super) fn row<const WEIGHS: bool>(
        &self,
        view: &View,
        node: Option<&Node>,
        row: usize,
        out: &mut WideRow,
    ) -> bool {
        let slope = view.per_mm - view.refocus * self.alpha;
        let per_slope = if slope.abs() < 1e-12 { 0.0 } else { 1.0 / slope };
        let WideRow { columns, parts, corners, weight } = out;
        *columns = self.columns(view, slope, parts[0].len());
        if columns.start >= columns.end {
            return false;
        }
        let [upper, lower] =
            corners.each_mut().map(|[x, y]| [x, y].map(|places| &mut places[columns.start..=columns.end]));
        let mut parts = parts.each_mut().map(|part| &mut part[columns.clone()]);
        let [upper, lower] = [(row as f32, upper), ((row + 1) as f32, lower)].map(|(height, mut places)| {
            self.corners(view, node, [columns.start as f32, height], per_slope, &mut places);
            places.map(|places| &*places)
        });
        let density = (view.per_mm * per_slope) * (view.per_mm * per_slope);
        parts[0].fill(density);
        // First where the light of a pixel lies: from its middle, and from there to the place on the stop's image.
        let quarter = if self.has_moments { -0.25 * view.refocus } else { 0.0 };
        for axis in 0..2 {
            let (above, below) = (upper[axis], lower[axis]);
            let middle = |n: usize| above[n] + above[n + 1] + below[n] + below[n + 1];
            parts[axis + 1].iter_mut().enumerate().for_each(|(n, place)| *place = quarter * middle(n));
        }
        for strip in &self.strips {
            if !self.narrow_to(strip, upper, lower, &mut parts) {
                return false;
            }
        }
        let [light, by_x, by_y] = parts;
        if WEIGHS {
            *weight = self.weight(view, row, columns.start, light);
        }
        for places in [by_x, by_y] {
            places.iter_mut().zip(&*light).for_each(|(place, light)| *place *= light);
        }
        true
    }

    /// The pixels of a row that can have light.
    #[inline(always)]
    fn columns(&self, view: &View, slope: f32, count: usize) -> Range<usize> {
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

    /// The light of a row that passes the stop, by its chord through the middles of the pixels from column `from` on.
    #[inline(always)]
    fn weight(&self, view: &View, row: usize, from: usize, light: &[f32]) -> f32 {
        let half = view.per_mm * self.stop.half_mm;
        let away = row as f32 + 0.5 - view.middle[1];
        let chord = match self.stop.is_round {
            true => (half * half - away * away).max(0.0).sqrt(),
            false => half * (half + 0.5 - away.abs()).clamp(0.0, 1.0),
        };
        let inside = |n: usize| (chord + 0.5 - ((from + n) as f32 + 0.5 - view.middle[0]).abs()).clamp(0.0, 1.0);
        light.iter().enumerate().map(|(n, light)| light * inside(n)).sum()
    }

    /// Sets the places on the array that the pixels' corners show, from the corner at this column and height on.
    #[inline(always)]
    fn corners(
        &self,
        view: &View,
        node: Option<&Node>,
        [column, height]: [f32; 2],
        per_slope: f32,
        [along_x, along_y]: &mut [&mut [f32]; 2],
    ) {
        let [x0, y0] = view.offset;
        let v = (view.middle[1] - height + view.refocus * y0) * per_slope;
        let first = (view.middle[0] - column + view.refocus * x0) * per_slope;
        let count = along_x.len().min(along_y.len());
        match node {
            None => {
                along_y.fill(y0 + self.alpha * v);
                let (from, step) = (x0 + self.alpha * first, self.alpha * per_slope);
                along_x.iter_mut().enumerate().for_each(|(n, x)| *x = from - n as f32 * step);
            }
            Some(node) => {
                for n in 0..count {
                    let u = first - n as f32 * per_slope;
                    along_x[n] = x0 + self.alpha * u + value(&node.departure[0], u, v);
                    along_y[n] = y0 + self.alpha * v + value(&node.departure[1], u, v);
                }
            }
        }
    }

    /// Multiplies each pixel's light by its share in a strip, and moves its place to the middle of this share. False if
    /// the strip leaves nothing.
    #[inline(always)]
    fn narrow_to(&self, strip: &Strip, upper: [&[f32]; 2], lower: [&[f32]; 2], parts: &mut [&mut [f32]; 3]) -> bool {
        let [light, by_x, by_y] = parts.each_mut().map(|part| &mut **part);
        let count = light.len();
        let [upper_x, upper_y] = [&upper[0][..=count], &upper[1][..=count]];
        let [lower_x, lower_y] = [&lower[0][..=count], &lower[1][..=count]];
        let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
        for n in 0..=count {
            let (a, b) = (strip.x * upper_x[n] + strip.y * upper_y[n], strip.x * lower_x[n] + strip.y * lower_y[n]);
            (least, most) = (least.min(a).min(b), most.max(a).max(b));
        }
        let beside = match self.spread {
            Spread::None => self.least_width,
            Spread::Box(width) => width,
            Spread::Gauss(sigma) => 4.0 * sigma,
        };
        let beside = beside + 0.5 * (most - least) / count as f32;
        if least > -strip.half + beside && most < strip.half - beside {
            return true;
        }
        if least > strip.half + beside || most < -strip.half - beside {
            return false;
        }
        let (by_x, by_y) = (&mut by_x[..count], &mut by_y[..count]);
        for n in 0..count {
            let at = |x: &[f32], y: &[f32], n: usize| strip.x * x[n] + strip.y * y[n];
            let (a, b) = (at(upper_x, upper_y, n), at(upper_x, upper_y, n + 1));
            let (c, d) = (at(lower_x, lower_y, n), at(lower_x, lower_y, n + 1));
            let place = 0.25 * (a + b + c + d);
            let (across, down) = (0.5 * (b - a + d - c), 0.5 * (c - a + d - b));
            let share = self.share(place, strip.half, across.abs(), down.abs());
            light[n] *= share;
            // An edge that leaves a share s of a pixel moves the middle of its light by (1 - s) / 2.
            let moved = 0.5f32.copysign(-place) * (1.0 - share) / (across * across + down * down).sqrt().max(1e-20);
            by_x[n] += moved * across;
            by_y[n] += moved * down;
        }
        true
    }

    /// The share within `half` of 0 of a footprint with its middle at `place` and these widths along its two sides.
    #[inline(always)]
    fn share(&self, place: f32, half: f32, across: f32, down: f32) -> f32 {
        let both = || (across * across + down * down).sqrt();
        match self.spread {
            Spread::None => {
                let widths = self.widths(across, down);
                within(half - place, widths) + within(half + place, widths) - 1.0
            }
            Spread::Box(width) => {
                let widths = self.widths(both(), width);
                within(half - place, widths) + within(half + place, widths) - 1.0
            }
            Spread::Gauss(sigma) => {
                let width = 2.0 * (both() * both() / 12.0 + sigma * sigma).sqrt();
                smooth((half - place) / width) + smooth((half + place) / width) - 1.0
            }
        }
    }

    #[inline(always)]
    fn widths(&self, a: f32, b: f32) -> [f32; 2] {
        let most = a.max(b).max(self.least_width);
        [most, a.min(b).max(LEAST_ASPECT * most)]
    }
}

/// The share below `place` of the sum of two even distributions of these widths about 0.
#[inline(always)]
fn within(place: f32, [a, b]: [f32; 2]) -> f32 {
    let (outer, inner) = (0.5 * (a + b), 0.5 * (a - b));
    let place = place.clamp(-outer, outer);
    let square = |value: f32| value.max(0.0) * value.max(0.0);
    (square(place + outer) - square(place + inner) - square(place - inner)) / (2.0 * a * b)
}

/// The share below `place` of the sum of three even distributions of width 1 about 0: nearly a Gaussian.
#[inline(always)]
fn smooth(place: f32) -> f32 {
    let place = place.clamp(-1.5, 1.5);
    let cube = |value: f32| value.max(0.0) * value.max(0.0) * value.max(0.0);
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
