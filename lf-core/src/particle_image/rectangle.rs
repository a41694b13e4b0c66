//! The image of a cell that is a rectangle along the axes: light is a factor along x times one along y.

use super::axis::Axis;
use super::blurred_factors::Span;
use super::cross::Cross;
use super::edge_sums::EdgeSums;
use super::factor::Factor;
use super::lenslet_image::{BY_POINTS, Cut, LensletImage, NODES, Patch, Scratch};
use super::lenslet_lines::LensletLine;
use super::place::{Place, width};
use super::quantities::{LIGHT, PLACES, QUANTITIES};
use super::rim::Side;
use super::share::{Share, Shared};
use super::table::Table;
use crate::simd::fastest;

impl Share {
    /// Finds the share of a lenslet along axis `n`, unless it is the same as before. Gives whether it was not.
    #[inline(never)]
    fn find(
        &mut self,
        image: &LensletImage<'_, Cross>,
        (n, axis): (usize, &Axis),
        (alpha, by_shift): (f64, f64),
        by_points: bool,
        sums: &mut EdgeSums,
    ) -> bool {
        if self.axis.as_ref() == Some(axis) && self.by_points == by_points {
            return false;
        }
        (self.axis, self.by_points) = (Some(*axis), by_points);
        fastest(
            #[inline(always)]
            || self.fill(image, (n, axis), (alpha, by_shift), sums),
        );
        true
    }

    #[inline(always)]
    fn fill(
        &mut self,
        image: &LensletImage<'_, Cross>,
        (n, axis): (usize, &Axis),
        (alpha, by_shift): (f64, f64),
        sums: &mut EdgeSums,
    ) {
        let half = image.view.optics.half_aperture_mm;
        let blur = image.view.blur.as_ref();
        (self.first, self.end) = image.lit(n, axis, alpha).unwrap_or((0, 0));
        self.edges.clear();
        self.factors.clear();
        if self.first == self.end {
            return;
        }
        for edge in self.first..=self.end {
            // Light of the stop's rim reaches pixels beyond on a blurred sensor.
            let most = if blur.is_some() { f64::INFINITY } else { half };
            self.edges.push(axis.place(edge as f64, alpha, by_shift, most));
        }
        if let Some(blur) = blur {
            let span = Span { axis, alpha, corner: image.view.corner[n], first: self.first, edges: &self.edges };
            image.blurred_factors(blur, &span, sums, &mut self.factors);
        } else if self.by_points {
            image.means(n, &self.edges, &mut self.factors);
        } else {
            image.differences(n, alpha, &self.edges, &mut self.factors);
        }
    }
}

impl LensletImage<'_, Cross> {
    /// From the factors of a row and a column of lenslets, for straight rays and a square stop.
    #[inline(always)]
    pub(super) fn by_shared_factors<const N: usize>(
        &self,
        line: &LensletLine,
        by_shift: f64,
        scratch: &mut Scratch,
    ) -> Option<Patch> {
        let (axes, alpha) = self.axes(line);
        let width_mm = 1.0 / axes[0].slope.abs().min(axes[1].slope.abs());
        let by_points = alpha.abs().max_element() * width_mm < BY_POINTS * self.spot_mm;
        let Scratch { shared: Shared { row, columns, next }, edge_sums, pixels, .. } = scratch;
        if row.find(self, (1, &axes[1]), (alpha.y, by_shift), by_points, edge_sums) {
            *next = 0;
        }
        if *next == columns.len() {
            columns.push(Share::default());
        }
        let column = &mut columns[*next];
        *next += 1;
        column.find(self, (0, &axes[0]), (alpha.x, by_shift), by_points, edge_sums);
        if row.first == row.end || column.first == column.end {
            return None;
        }
        pixels.clear();
        let per_stop = self.view.blur.as_ref().map_or(1.0, |blur| blur.share) / self.view.stop_mm2;
        for b in &row.factors {
            let b = b.mix(per_stop, b, 0.0);
            for a in &column.factors {
                pixels.push(product::<N>(a, &b));
            }
        }
        let [columns, rows] = [column.end - column.first, row.end - row.first].map(|count| count as u32);
        Some(Patch { column: column.first as u32, row: row.first as u32, columns, rows })
    }

    /// From the factors along both axes; pixels that the rim crosses from the tables.
    #[inline(always)]
    pub(super) fn by_factors<const N: usize>(&self, scratch: &mut Scratch, cut: Cut) {
        let Scratch { edges, factors, pixels, .. } = scratch;
        for axis in 0..2 {
            if cut.by_points {
                self.means(axis, &edges[axis], &mut factors[axis]);
            } else {
                self.differences(axis, cut.alpha[axis], &edges[axis], &mut factors[axis]);
            }
        }
        let radius = self.view.optics.half_aperture_mm;
        let per_stop = 1.0 / self.view.stop_mm2;
        for (row, b) in factors[1].iter().enumerate() {
            let b = b.mix(per_stop, b, 0.0);
            for (column, a) in factors[0].iter().enumerate() {
                let (x, y) = (&edges[0][column..column + 2], &edges[1][row..row + 2]);
                let light = match cut.side(radius, x, y) {
                    Side::Outside => continue,
                    Side::Across => self.at_rim::<N>(x, y, cut),
                    Side::Inside => product::<N>(a, &b),
                };
                cut.add::<N>(light, [column, row], pixels);
            }
        }
    }

    /// A table's value at a place.
    #[inline(always)]
    fn at(&self, table: &Cross, axis: usize, place: &Place) -> Factor {
        let read = table.taps(axis, place.x, self.more_mm);
        let [m, alpha, shift] = place.x_by;
        Factor {
            light: read.value,
            by_m: read.slope * m,
            by_alpha: read.slope * alpha,
            by_size: read.by_size,
            by_shift: read.slope * shift,
            by_blur: 0.0,
        }
    }

    /// Widths in the stop times means of the cell's share at two points.
    #[inline(always)]
    fn means(&self, axis: usize, edges: &[Place], factors: &mut Vec<Factor>) {
        factors.clear();
        for pair in edges.windows(2) {
            let [first, second] =
                [Place::between(&pair[0], &pair[1], NODES[0]), Place::between(&pair[0], &pair[1], NODES[1])];
            let (width, width_by) = width(pair);
            let table = &self.tables.share;
            let mean = self.at(table, axis, &first).mix(0.5, &self.at(table, axis, &second), 0.5);
            let mut factor = mean.mix(width, &mean, 0.0);
            factor.by_m += mean.light * width_by[0];
            factor.by_alpha += mean.light * width_by[1];
            factor.by_shift += mean.light * width_by[2];
            factors.push(factor);
        }
    }

    /// Differences of the integral over alpha.
    #[inline(always)]
    fn differences(&self, axis: usize, alpha: f64, edges: &[Place], factors: &mut Vec<Factor>) {
        factors.clear();
        let per_alpha = 1.0 / alpha;
        let scale = per_alpha.copysign(alpha * (edges[0].u - edges[1].u));
        let mut before = self.at(&self.tables.integral, axis, &edges[0]);
        for edge in &edges[1..] {
            let after = self.at(&self.tables.integral, axis, edge);
            let mut factor = before.mix(scale, &after, -scale);
            factor.by_alpha -= factor.light * per_alpha;
            factors.push(factor);
            before = after;
        }
    }
}

/// The light of a pixel.
#[inline(always)]
fn product<const N: usize>(a: &Factor, b: &Factor) -> [f64; QUANTITIES] {
    let mut light = [0.0; QUANTITIES];
    light[0] = a.light * b.light;
    if N <= LIGHT {
        return light;
    }
    [light[1], light[2]] = [a.by_m * b.light, a.light * b.by_m];
    light[3] = a.by_alpha * b.light + a.light * b.by_alpha;
    if N > PLACES {
        light[4] = a.by_size * b.light + a.light * b.by_size;
        [light[5], light[6]] = [a.by_shift * b.light, a.light * b.by_shift];
        light[7] = a.by_blur * b.light + a.light * b.by_blur;
    }
    light
}
