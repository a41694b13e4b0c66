//! A lenslet's image of a particle: the integral of the light on each pixel, and its derivatives.

use super::axis::Axis;
use super::beam::Beam;
use super::cell_surface::{Ladder, REACH_SIGMA, Tables, half_sides};
use super::cross::{Cross, Read};
use super::edge_sums::EdgeSums;
use super::factor::Factor;
use super::fine_light::FineLight;
use super::lenslet_lines::LensletLine;
use super::picture_means::{ORDERS, PictureMeans};
use super::pictures::LANES;
use super::place::{Place, width};
use super::quantities::{LIGHT, PLACES, QUANTITIES};
use super::rim::{self, Side, Strip, Way};
use super::share::Shared;
use super::spline::{Spline, Taps};
use super::spots::Spots;
use super::table::Table;
use super::view::View;
use super::wave_buffers::WaveBuffers;
use crate::normal::quick_distribution;
use crate::simd::fastest;
use glam::DVec2;

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patch {
    /// First column.
    pub column: u32,
    /// First row.
    pub row: u32,
    /// Columns.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
}

/// Taps of places along both axes, with the derivatives of the places by m, alpha and the lattice's shift.
type Lists<T> = [Vec<(T, [f64; 3])>; 2];

/// A table with lists of its own among the buffers, and the way from it to the pixels.
pub(super) trait Listed: Table {
    /// Fills the means of spots of standard deviation `sigma_mm` on the array.
    fn fill_means(ladder: &Ladder<Self>, sigma_mm: f64, spots: &mut Spots)
    where
        Self: Sized;

    fn lists(scratch: &mut Scratch) -> &mut Lists<Self::Taps>;

    /// Fills the scratch's pixels from what the lenslets of a row and of a column share. None if they share nothing.
    #[inline(always)]
    fn by_axes<const N: usize>(
        _: &LensletImage<'_, Self>,
        _: &LensletLine,
        _: f64,
        _: &mut Scratch,
    ) -> Option<Option<Patch>>
    where
        Self: Sized,
    {
        None
    }

    /// Adds the light up, pixel by pixel.
    fn integrate<const N: usize>(image: &LensletImage<'_, Self>, scratch: &mut Scratch, cut: Cut)
    where
        Self: Sized;
}

impl Listed for Spline {
    #[inline(always)]
    fn fill_means(ladder: &Ladder<Self>, sigma_mm: f64, spots: &mut Spots) {
        let count = spots.room();
        let Spots { hit, means, .. } = spots;
        let tables = ladder.nearest(sigma_mm);
        tables.share.fill((hit, (sigma_mm - tables.sigma_mm) as f32), count, means);
    }

    #[inline(always)]
    fn lists(scratch: &mut Scratch) -> &mut Lists<Taps> {
        &mut scratch.taps
    }

    #[inline(always)]
    fn integrate<const N: usize>(image: &LensletImage<'_, Self>, scratch: &mut Scratch, cut: Cut) {
        image.by_table::<N>(scratch, cut);
    }
}

impl Listed for Cross {
    #[inline(always)]
    fn fill_means(ladder: &Ladder<Self>, sigma_mm: f64, spots: &mut Spots) {
        let count = spots.room();
        let Spots { hit, means, .. } = spots;
        let corner = half_sides(&ladder.corners);
        let per_sigma = (1.0 / sigma_mm) as f32;
        for first in (0..count).step_by(LANES) {
            let mut jets = [[[0f32; LANES]; 3]; 2];
            for n in 0..2 {
                let half = corner[n] as f32;
                let hit: [f32; LANES] = hit[n][first..first + LANES].try_into().expect("eight spots");
                for k in 0..LANES {
                    let (low, high) = ((hit[k] + half) * per_sigma, (hit[k] - half) * per_sigma);
                    let ((a, a_by), (b, b_by)) = (quick_distribution(low), quick_distribution(high));
                    jets[n][0][k] = a - b;
                    jets[n][1][k] = (a_by - b_by) * per_sigma;
                    jets[n][2][k] = (high * b_by - low * a_by) * per_sigma * per_sigma;
                }
            }
            for (list, [x, y]) in means.iter_mut().zip(ORDERS) {
                let list: &mut [f32; LANES] = (&mut list[first..first + LANES]).try_into().expect("eight spots");
                for k in 0..LANES {
                    list[k] = jets[0][x][k] * jets[1][y][k];
                }
            }
        }
    }

    #[inline(always)]
    fn lists(scratch: &mut Scratch) -> &mut Lists<Read> {
        &mut scratch.reads
    }

    #[inline(always)]
    fn by_axes<const N: usize>(
        image: &LensletImage<'_, Self>,
        line: &LensletLine,
        by_shift: f64,
        scratch: &mut Scratch,
    ) -> Option<Option<Patch>> {
        let is_product = !image.view.has_round_stop && !image.beam.is_bent();
        is_product.then(|| image.by_shared_factors::<N>(line, by_shift, scratch))
    }

    #[inline(always)]
    fn integrate<const N: usize>(image: &LensletImage<'_, Self>, scratch: &mut Scratch, cut: Cut) {
        if image.beam.is_bent() {
            image.by_table::<N>(scratch, cut);
        } else {
            image.by_factors::<N>(scratch, cut);
        }
    }
}

/// Buffers of a thread.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(super) edges: [Vec<Place>; 2],
    pub(super) points: [Vec<Place>; 2],
    pub(super) factors: [Vec<Factor>; 2],
    pub(super) shared: Shared,
    pub(super) edge_sums: EdgeSums,
    pub(super) even: PictureMeans,
    pub(super) fine: FineLight,
    pub(super) spots: Spots,
    pub(super) waves: WaveBuffers,
    taps: Lists<Taps>,
    reads: Lists<Read>,
    lines: [Vec<[f64; QUANTITIES]>; 2],
    pub(super) pixels: Vec<[f64; QUANTITIES]>,
    /// The first quantities of the pixels.
    pub(super) places: Vec<[f32; PLACES]>,
}

/// Pixels whose width on the array is below this many standard deviations of the spot are integrated by points.
pub(super) const BY_POINTS: f64 = 0.5;
/// [`BY_POINTS`] for rays that bend.
const BY_POINTS_BENT: f64 = 0.75;
/// Gauss-Legendre with two nodes: their places in the interval.
pub(super) const NODES: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
/// Where the mean over a pixel is taken, pixels at the rim are cut until they are no wider than this share of the
/// stop's half side.
const FINE_IN_STOP: f64 = 0.16;
/// Largest number of parts of a pixel a side.
const FINEST: f64 = 4.0;

/// A particle, as lenslets see it.
pub(super) struct LensletImage<'a, T> {
    pub(super) view: &'a View,
    pub(super) beam: &'a Beam,
    pub(super) tables: &'a Tables<T>,
    /// Size of the spot, and what it is beyond the tables', mm.
    pub(super) spot_mm: f64,
    pub(super) more_mm: f64,
}

impl<T: Listed> LensletImage<'_, T> {
    /// A lenslet along both axes, and the spread of the rays that meet it.
    #[inline(always)]
    pub(super) fn axes(&self, line: &LensletLine) -> ([Axis; 2], DVec2) {
        let Self { view, beam, spot_mm: spot, .. } = *self;
        let (chief, alpha) = beam.towards(line.centre, spot, view.optics.half_aperture_mm);
        let chief = chief - line.centre;
        let zero = line.zero + line.gamma * chief;
        let slope = line.kappa - line.gamma * alpha;
        let slope = slope.map(|slope| if slope.abs() < 1e-9 { 1e-9 } else { slope });
        let axes = [0, 1].map(|n| Axis {
            zero: zero[n],
            slope: slope[n],
            per_slope: 1.0 / slope[n],
            kappa: line.kappa[n],
            gamma: line.gamma[n],
            chief: chief[n],
            centre: line.centre[n],
            pixels: view.optics.sensor_px[n],
        });
        (axes, alpha)
    }

    /// First and end pixel along axis `n` that can be lit.
    #[inline(always)]
    pub(super) fn lit(&self, n: usize, axis: &Axis, alpha: f64) -> Option<(i64, i64)> {
        self.lit_around(n, axis, alpha, self.view.blur.as_ref().map(|blur| (blur.sigma_px, 0)))
    }

    /// Like [`Self::lit`], for a blur of this standard deviation, px, and pixels beyond the sensor's edges.
    #[inline(always)]
    pub(super) fn lit_around(
        &self,
        n: usize,
        axis: &Axis,
        alpha: f64,
        blur: Option<(f64, usize)>,
    ) -> Option<(i64, i64)> {
        let Self { view, beam, spot_mm: spot, .. } = *self;
        // The largest bend is that from the straight rays of the whole stop.
        let whole = Axis { chief: beam.chief[n] - axis.centre, ..*axis };
        let (axis, alpha) = if beam.is_bent() { (&whole, beam.alpha) } else { (axis, alpha) };
        let fringes_mm = view.fringes_px() * (alpha * axis.per_slope).abs();
        let (half, corner) = (view.optics.half_aperture_mm, view.corner[n] + beam.most_bend_mm + fringes_mm);
        match blur {
            Some((blur_px, beyond)) => axis.lit_blurred(alpha, half, corner, (spot, blur_px), beyond as f64),
            None => axis.lit(alpha, half, corner + REACH_SIGMA * spot, (0.0, 0.0)),
        }
    }

    /// Fills the scratch's pixels with light and derivatives by m, alpha, the spot's size and the lattice's shift.
    #[inline(always)]
    pub(super) fn integrate<const N: usize>(
        &self,
        line: &LensletLine,
        by_shift: f64,
        scratch: &mut Scratch,
    ) -> Option<Patch> {
        let Self { view, beam, spot_mm: spot, .. } = *self;
        let half = view.optics.half_aperture_mm;
        let (axes, alpha) = self.axes(line);
        let (left, right) = self.lit(0, &axes[0], alpha.x)?;
        let (top, bottom) = self.lit(1, &axes[1], alpha.y)?;
        let width_mm = 1.0 / axes[0].slope.abs().min(axes[1].slope.abs());
        let on_array = alpha.abs().max_element() * width_mm;
        let mut parts = 1;
        let mut is_cut = false;
        if view.has_round_stop {
            let edge = |axis: usize, pixel: i64| (axes[axis].zero - pixel as f64) / axes[axis].slope;
            let (a, b) = (DVec2::new(edge(0, left), edge(1, top)), DVec2::new(edge(0, right), edge(1, bottom)));
            match rim::side(half, a.min(b), a.max(b)) {
                Side::Outside => return None,
                Side::Inside => {}
                Side::Across => {
                    is_cut = true;
                    parts = (width_mm / (FINE_IN_STOP * half)).ceil().clamp(1.0, FINEST) as usize;
                }
            }
        }
        // Bent rays are followed point by point as long as that takes few points.
        let bent_parts = on_array / (BY_POINTS_BENT * spot);
        let is_bent = beam.is_bent() && bent_parts <= FINEST;
        if is_bent {
            parts = parts.max(bent_parts.ceil() as usize);
        }
        let by_points = is_bent || on_array < BY_POINTS * spot * parts as f64;
        let most = if view.has_round_stop { f64::INFINITY } else { half };
        for (axis, (first, end)) in [(left, right), (top, bottom)].into_iter().enumerate() {
            let edges = &mut scratch.edges[axis];
            edges.clear();
            let count = (end - first) as usize * parts;
            let edge = |n: usize| first as f64 + n as f64 / parts as f64;
            for n in 0..=count {
                edges.push(axes[axis].place(edge(n), alpha[axis], by_shift, most));
            }
        }
        scratch.pixels.clear();
        scratch.pixels.resize(((right - left) * (bottom - top)) as usize, [0.0; QUANTITIES]);
        let columns = (right - left) as usize;
        T::integrate::<N>(self, scratch, Cut { parts, columns, is_cut, by_points, alpha, centre: line.centre });
        let [column, row] = [left, top].map(|first| first as u32);
        Some(Patch { column, row, columns: (right - left) as u32, rows: (bottom - top) as u32 })
    }

    /// From the tables.
    #[inline(always)]
    fn by_table<const N: usize>(&self, scratch: &mut Scratch, cut: Cut) {
        if cut.by_points {
            self.by_points::<N>(scratch, cut);
        } else {
            self.by_corners::<N>(scratch, cut);
        }
    }

    /// Where a table is read for a place.
    #[inline(always)]
    fn taps(&self, table: &T, axis: usize, place: &Place) -> (T::Taps, [f64; 3]) {
        (table.taps(axis, place.x, self.more_mm), place.x_by)
    }

    /// The light of a pixel that the rim of a round stop crosses.
    #[inline(never)]
    pub(super) fn at_rim<const N: usize>(&self, x: &[Place], y: &[Place], cut: Cut) -> [f64; QUANTITIES] {
        let mut light = [0.0; QUANTITIES];
        fastest(
            #[inline(always)]
            || self.add_rim::<N>(&mut light, x, y, cut),
        );
        light
    }

    #[inline(always)]
    fn add_rim<const N: usize>(&self, light: &mut [f64; QUANTITIES], x: &[Place], y: &[Place], cut: Cut) {
        if cut.by_points {
            self.by_strip_points::<N>(light, x, y, cut);
            light.iter_mut().for_each(|value| *value /= self.view.stop_mm2);
        } else {
            self.by_strips::<N>(light, x, y, cut.alpha);
            let scale = cut.scale(x, y, self.view.stop_mm2);
            light.iter_mut().for_each(|value| *value *= scale);
            light[3] -= light[0] * (1.0 / cut.alpha.x + 1.0 / cut.alpha.y);
        }
    }

    /// The tables' value and derivatives by m, alpha, size and shift, for one place along each axis. Gives the slopes
    /// along both.
    #[inline(always)]
    fn read<const N: usize>(
        &self,
        table: &T,
        x: &(T::Taps, [f64; 3]),
        y: &(T::Taps, [f64; 3]),
        read: &mut [f64; QUANTITIES],
    ) -> [f64; 2] {
        let [value, by_x, by_y, by_size] = table.at::<N>(&x.0, &y.0, self.more_mm);
        if N <= LIGHT {
            read[0] = value;
            return [0.0; 2];
        }
        let (x, y) = (x.1, y.1);
        [read[0], read[1], read[2], read[3]] = [value, by_x * x[0], by_y * y[0], by_x * x[1] + by_y * y[1]];
        if N > PLACES {
            [read[4], read[5], read[6]] = [by_size, by_x * x[2], by_y * y[2]];
        }
        [by_x, by_y]
    }

    /// From the integral at the pixels' corners.
    #[inline(always)]
    fn by_corners<const N: usize>(&self, scratch: &mut Scratch, cut: Cut) {
        let alpha = cut.alpha;
        let mut taps = std::mem::take(T::lists(scratch));
        let Scratch { edges, lines, pixels, .. } = scratch;
        let table = &self.tables.integral;
        for axis in 0..2 {
            taps[axis].clear();
            for edge in &edges[axis] {
                taps[axis].push((table.taps(axis, edge.x, self.more_mm), edge.x_by));
            }
        }
        let scale = cut.scale(&edges[0], &edges[1], self.view.stop_mm2);
        let shrink = 1.0 / alpha.x + 1.0 / alpha.y;
        let count = edges[0].len();
        let radius = self.view.optics.half_aperture_mm;
        let [above, below] = lines;
        above.resize(above.len().max(count), [0.0; QUANTITIES]);
        below.resize(below.len().max(count), [0.0; QUANTITIES]);
        for row in 0..edges[1].len() {
            std::mem::swap(above, below);
            let y = &taps[1][row];
            for (x, corner) in taps[0].iter().zip(below.iter_mut()) {
                // The integral is 0 up to the lower left of the cell.
                if T::is_below(&x.0) || T::is_below(&y.0) {
                    *corner = [0.0; QUANTITIES];
                } else {
                    self.read::<N>(table, x, y, corner);
                }
            }
            if row == 0 {
                continue;
            }
            for column in 1..count {
                let (a, b, c, d) = (&above[column - 1], &above[column], &below[column - 1], &below[column]);
                let mut light = [0.0; QUANTITIES];
                let (x, y) = (&edges[0][column - 1..=column], &edges[1][row - 1..=row]);
                match cut.side(radius, x, y) {
                    Side::Outside => continue,
                    Side::Across => light = self.at_rim::<N>(x, y, cut),
                    Side::Inside => {
                        for n in 0..N {
                            light[n] = scale * ((a[n] - b[n]) - (c[n] - d[n]));
                        }
                        light[3] -= light[0] * shrink;
                    }
                }
                cut.add::<N>(light, [column - 1, row - 1], pixels);
            }
        }
        *T::lists(scratch) = taps;
    }

    /// Adds up a pixel that the rim of a round stop crosses, strip by strip in both ways. `each(light, strip, way)`
    /// adds a strip's part to the light, and returns the whole light of the strip.
    #[inline(always)]
    fn add_strips(
        &self,
        light: &mut [f64; QUANTITIES],
        x: &[Place],
        y: &[Place],
        alpha: DVec2,
        each: impl Fn(&mut [f64; QUANTITIES], &Strip, &Way) -> f64,
    ) {
        for way in rim::ways(x, y).into_iter().filter(|way| way.share > 0.0) {
            let mut whole = 0.0;
            rim::strips(
                self.view.optics.half_aperture_mm,
                x,
                y,
                way.across,
                alpha[way.across],
                #[inline(always)]
                |strip| whole += each(light, strip, &way),
            );
            // The share of the way changes too.
            for (axis, [by_m, by_alpha, by_shift]) in way.share_by.into_iter().enumerate() {
                light[1 + axis] += whole * by_m;
                light[3] += whole * by_alpha;
                light[5 + axis] += whole * by_shift;
            }
        }
    }

    /// The integral over a pixel that the rim of a round stop crosses.
    #[inline(always)]
    fn by_strips<const N: usize>(&self, light: &mut [f64; QUANTITIES], x: &[Place], y: &[Place], alpha: DVec2) {
        let table = &self.tables.integral;
        self.add_strips(
            light,
            x,
            y,
            alpha,
            #[inline(always)]
            |light, strip, Way { across, share, .. }| {
                let (across, other, mut whole) = (*across, 1 - across, 0.0);
                let along = [self.taps(table, other, &strip.along[0]), self.taps(table, other, &strip.along[1])];
                let ends = [self.taps(table, across, &strip.ends[0]), self.taps(table, across, &strip.ends[1])];
                for (along, sign) in along.iter().zip([1.0, -1.0]) {
                    for ((end, turn), side) in ends.iter().zip(&strip.turn).zip([1.0, -1.0]) {
                        if T::is_below(&along.0) || T::is_below(&end.0) {
                            continue;
                        }
                        let (x, y) = if across == 0 { (end, along) } else { (along, end) };
                        let mut corner = [0.0; QUANTITIES];
                        let slope = self.read::<N>(table, x, y, &mut corner)[across] * alpha[across];
                        // The end of the strip moves as the strip does along the rim.
                        corner[1 + other] += slope * turn[0];
                        corner[3] += slope * turn[1];
                        if N > PLACES {
                            corner[5 + other] += slope * turn[2];
                        }
                        for k in 0..N {
                            light[k] += share * sign * side * corner[k];
                        }
                        whole += sign * side * corner[0];
                    }
                }
                whole
            },
        );
    }

    /// Like `by_strips`, but with two by two points of each strip instead of the integral.
    #[inline(always)]
    fn by_strip_points<const N: usize>(&self, light: &mut [f64; QUANTITIES], x: &[Place], y: &[Place], cut: Cut) {
        let Cut { alpha, centre, .. } = cut;
        self.add_strips(
            light,
            x,
            y,
            alpha,
            #[inline(always)]
            |light, strip, Way { across, share, .. }| {
                let (across, other) = (*across, 1 - across);
                let (wide, wide_by) = width(&strip.ends);
                let (own_high, high_by) = width(&strip.along);
                let (high, high_by) = (share * own_high, high_by.map(|by| share * by));
                let sign = 1f64.copysign(strip.ends[0].u - strip.ends[1].u);
                let mut mean = [0.0; QUANTITIES];
                // The spot is wider than a pixel here, so the middle stands for the strip's width.
                for along in [0.5] {
                    let place = Place::between(&strip.along[0], &strip.along[1], along);
                    for part in NODES {
                        let end = Place::between(&strip.ends[0], &strip.ends[1], part);
                        let (x, y) = if across == 0 { (&end, &place) } else { (&place, &end) };
                        let mut point = [0.0; QUANTITIES];
                        let slope = self.read_ray::<N>(x, y, alpha, centre, &mut point)[across];
                        let turn = |k: usize| slope * (strip.turn[0][k] + part * (strip.turn[1][k] - strip.turn[0][k]));
                        point[1 + other] += turn(0);
                        point[3] += turn(1);
                        if N > PLACES {
                            point[5 + other] += turn(2);
                        }
                        for k in 0..N {
                            mean[k] += 0.5 * point[k];
                        }
                    }
                }
                let turn: [f64; 3] = std::array::from_fn(|k| sign * (strip.turn[0][k] - strip.turn[1][k]));
                for k in 0..N {
                    light[k] += wide * high * mean[k];
                }
                light[1 + across] += high * wide_by[0] * mean[0];
                light[1 + other] += (wide * high_by[0] + high * turn[0]) * mean[0];
                light[3] += (high * (wide_by[1] + turn[1]) + wide * high_by[1]) * mean[0];
                light[5 + across] += high * wide_by[2] * mean[0];
                light[5 + other] += (wide * high_by[2] + high * turn[2]) * mean[0];
                wide * own_high * mean[0]
            },
        );
    }

    /// From the mean over the pixel at two by two points.
    #[inline(always)]
    fn by_points<const N: usize>(&self, scratch: &mut Scratch, cut: Cut) {
        let mut taps = std::mem::take(T::lists(scratch));
        let Scratch { edges, points, lines, pixels, .. } = scratch;
        let table = &self.tables.share;
        for axis in 0..2 {
            points[axis].clear();
            taps[axis].clear();
            for pair in edges[axis].windows(2) {
                for part in NODES {
                    let point = Place::between(&pair[0], &pair[1], part);
                    points[axis].push(point);
                    taps[axis].push((table.taps(axis, point.x, self.more_mm), point.x_by));
                }
            }
        }
        let radius = self.view.optics.half_aperture_mm;
        let [above, below] = lines;
        let count = points[0].len();
        above.resize(above.len().max(count), [0.0; QUANTITIES]);
        below.resize(below.len().max(count), [0.0; QUANTITIES]);
        for row in 0..edges[1].len() - 1 {
            for (line, n) in [(&mut *above, 2 * row), (&mut *below, 2 * row + 1)] {
                for ((point, x), read) in points[0].iter().zip(&taps[0]).zip(line.iter_mut()) {
                    if self.beam.is_bent() {
                        self.read_ray::<N>(point, &points[1][n], cut.alpha, cut.centre, read);
                    } else {
                        self.read::<N>(table, x, &taps[1][n], read);
                    }
                }
            }
            let (height, height_by) = width(&edges[1][row..row + 2]);
            for column in 0..edges[0].len() - 1 {
                let mut light = [0.0; QUANTITIES];
                let (x, y) = (&edges[0][column..column + 2], &edges[1][row..row + 2]);
                match cut.side(radius, x, y) {
                    Side::Outside => continue,
                    Side::Across => {
                        cut.add::<N>(self.at_rim::<N>(x, y, cut), [column, row], pixels);
                        continue;
                    }
                    Side::Inside => {}
                }
                let (width, width_by) = width(x);
                let scale = 0.25 / self.view.stop_mm2;
                let at = 2 * column;
                let (a, b, c, d) = (&above[at], &above[at + 1], &below[at], &below[at + 1]);
                for n in 0..N {
                    light[n] = scale * width * height * ((a[n] + b[n]) + (c[n] + d[n]));
                }
                let (wide, high) = (light[0] / width, light[0] / height);
                light[1] += wide * width_by[0];
                light[2] += high * height_by[0];
                light[3] += wide * width_by[1] + high * height_by[1];
                light[5] += wide * width_by[2];
                light[6] += high * height_by[2];
                cut.add::<N>(light, [column, row], pixels);
            }
        }
        *T::lists(scratch) = taps;
    }

    /// The cell's share along a ray, bent or straight, with derivatives by m, alpha, size and shift. Gives the growth
    /// of the share with the place of the ray in the stop, the array's hit moving along.
    #[inline(always)]
    fn read_ray<const N: usize>(
        &self,
        x: &Place,
        y: &Place,
        alpha: DVec2,
        centre: DVec2,
        read: &mut [f64; QUANTITIES],
    ) -> [f64; 2] {
        let table = &self.tables.share;
        let half = self.view.optics.half_aperture_mm;
        let (mut hit, mut bend) = (DVec2::new(x.x, y.x), DVec2::ZERO);
        let mut growth = alpha;
        if self.beam.is_bent() {
            let aperture = DVec2::new(x.u, y.u);
            hit = self.beam.hit(aperture, half) - centre;
            let [by_u, by_v] = self.beam.slopes(aperture, half);
            growth = DVec2::new(by_u.x, by_v.y);
            bend = growth - self.beam.alpha;
        }
        let x = (table.taps(0, hit.x, self.more_mm), x.x_by_of_ray(bend.x));
        let y = (table.taps(1, hit.y, self.more_mm), y.x_by_of_ray(bend.y));
        let [by_x, by_y] = self.read::<N>(table, &x, &y, read);
        [by_x * growth.x, by_y * growth.y]
    }
}

/// How the pixels of a lenslet are cut and integrated.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    /// Parts of a pixel a side.
    parts: usize,
    /// Pixels in a row of the patch.
    columns: usize,
    /// Whether the rim of a round stop crosses the patch.
    is_cut: bool,
    /// Whether the mean over a pixel is taken at points, and not from the integral at its corners.
    pub(super) by_points: bool,
    /// Spread along both axes of the rays that meet the lenslet.
    pub(super) alpha: DVec2,
    /// The lenslet's centre, mm.
    centre: DVec2,
}

impl Cut {
    /// Whole pixels, from the integral, and no rim.
    pub(super) fn none(columns: u32, alpha: DVec2, centre: DVec2) -> Self {
        Self { parts: 1, columns: columns as usize, is_cut: false, by_points: false, alpha, centre }
    }

    /// The side of the rim of a round stop on which a pixel between these edges lies.
    #[inline(always)]
    pub(super) fn side(&self, radius: f64, x: &[Place], y: &[Place]) -> Side {
        if !self.is_cut {
            return Side::Inside;
        }
        let (a, b) = (DVec2::new(x[0].u, y[0].u), DVec2::new(x[1].u, y[1].u));
        rim::side(radius, a.min(b), a.max(b))
    }

    /// The factor from differences of the integral to a share of light.
    #[inline(always)]
    fn scale(&self, x: &[Place], y: &[Place], stop_mm2: f64) -> f64 {
        let is_turned = (x[0].u < x[1].u) != (y[0].u < y[1].u);
        let scale = 1.0 / (stop_mm2 * self.alpha.x * self.alpha.y);
        if is_turned { -scale } else { scale }
    }

    /// Adds the light of a part of a pixel.
    #[inline(always)]
    pub(super) fn add<const N: usize>(
        &self,
        light: [f64; QUANTITIES],
        [column, row]: [usize; 2],
        pixels: &mut [[f64; QUANTITIES]],
    ) {
        // Nearly all lenslets have whole pixels, and divisions take long.
        let [column, row] = if self.parts == 1 { [column, row] } else { [column / self.parts, row / self.parts] };
        let pixel = &mut pixels[row * self.columns + column];
        for n in 0..N {
            pixel[n] += light[n];
        }
    }
}
