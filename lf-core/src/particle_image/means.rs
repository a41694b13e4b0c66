//! Means of a cell's share of light over pixels, with their derivatives by the place on the array.

use super::cell_surface::{Ladder, Tables};
use super::cross::{Cross, LineJet};
use super::lenslet_image::{Hit, PLACES, QUANTITIES, Scratch};
use super::mean::{LANES, Mean, NUMBERS, PLAIN};
use super::spline::{Jet, Spline};

/// Sets the numbers of one pixel's mean that N quantities need.
#[inline(always)]
fn put<const N: usize>(means: &mut [Mean], column: usize, number: impl Fn(usize) -> f64) {
    let mean = &mut means[column / LANES];
    for n in 0..if N > PLACES { NUMBERS } else { PLAIN } {
        mean[n][column % LANES] = number(n);
    }
}

/// The second difference of the integral between the corners of a pixel, over its area.
#[inline(always)]
fn difference([a, b, c, d]: [&Jet; 4], per_area: f64) -> impl Fn(usize) -> f64 {
    move |n| per_area * ((a[n] - b[n]) - (c[n] - d[n]))
}

/// Room for the means of rows of pixels.
#[inline(always)]
fn fit(means: &mut Vec<Mean>, columns: usize, rows: usize) {
    means.clear();
    means.resize(columns.div_ceil(LANES) * rows, [[0.0; LANES]; NUMBERS]);
}

impl Tables<Spline> {
    /// For a cell of any shape. The mean is the second difference of the integral at the pixel's corners, or the share
    /// at its middle.
    #[inline(always)]
    pub(super) fn fill_means<const N: usize>(&self, more_mm: f64, has_pixel: bool, scratch: &mut Scratch) {
        let Tables { share, integral, .. } = self;
        let Scratch { edges, points, means, stencils, corners: [above, below], .. } = scratch;
        let columns = points[0].len();
        fit(means, columns, points[1].len());
        stencils.clear();
        if has_pixel {
            for point in &points[0] {
                stencils.push(share.stencil(0, point.x));
            }
            for (point, means) in points[1].iter().zip(means.chunks_mut(columns.div_ceil(LANES))) {
                let y = share.stencil(1, point.x);
                for (column, x) in stencils.iter().enumerate() {
                    let jet = share.jet::<N>(x, &y, more_mm);
                    put::<N>(means, column, |n| jet[n]);
                }
            }
            return;
        }
        for edge in &edges[0] {
            stencils.push(integral.stencil(0, edge.x));
        }
        let y = integral.stencil(1, edges[1][0].x);
        below.clear();
        for x in stencils.iter() {
            below.push(integral.jet::<N>(x, &y, more_mm));
        }
        for (edges_y, means) in edges[1].windows(2).zip(means.chunks_mut(columns.div_ceil(LANES))) {
            std::mem::swap(above, below);
            let y = integral.stencil(1, edges_y[1].x);
            below.clear();
            for x in stencils.iter() {
                below.push(integral.jet::<N>(x, &y, more_mm));
            }
            let height = edges_y[1].x - edges_y[0].x;
            let rows = above.windows(2).zip(below.windows(2)).zip(edges[0].windows(2));
            for (column, ((upper, lower), edges_x)) in rows.enumerate() {
                let per_area = 1.0 / (height * (edges_x[1].x - edges_x[0].x));
                put::<N>(means, column, difference([&upper[0], &upper[1], &lower[0], &lower[1]], per_area));
            }
        }
    }
}

impl Tables<Cross> {
    /// For a rectangle along the axes: a factor along x times one along y.
    #[inline(always)]
    pub(super) fn fill_means(&self, more_mm: f64, has_pixel: bool, scratch: &mut Scratch) {
        let Scratch { edges, points, means, jets, .. } = scratch;
        for axis in 0..2 {
            let jets = &mut jets[axis];
            jets.clear();
            if has_pixel {
                jets.extend(points[axis].iter().map(|point| self.share.line(axis).jet(point.x, more_mm)));
                continue;
            }
            let mut before = edges[axis].first().map(|edge| self.end(axis, edge.x, more_mm)).unwrap_or_default();
            for pair in edges[axis].windows(2) {
                let after = self.end(axis, pair[1].x, more_mm);
                jets.push(between(&before, &after, pair[1].x - pair[0].x));
                before = after;
            }
        }
        let columns = jets[0].len();
        fit(means, columns, jets[1].len());
        for (y, means) in jets[1].iter().zip(means.chunks_mut(columns.div_ceil(LANES).max(1))) {
            for (column, x) in jets[0].iter().enumerate() {
                product(x, y, means, column);
            }
        }
    }
}

/// The integral and the share at the end of a pixel along one axis.
type End = (LineJet, LineJet);

impl Tables<Cross> {
    #[inline(always)]
    fn end(&self, axis: usize, x: f64, more_mm: f64) -> End {
        (self.integral.line(axis).jet(x, more_mm), self.share.line(axis).jet(x, more_mm))
    }
}

/// The mean between the ends of a pixel, which is `length` wide on the array.
#[inline(always)]
fn between((integral_before, share_before): &End, (integral, share): &End, length: f64) -> LineJet {
    let per_length = 1.0 / length;
    // The share is the slope of the integral, and smoother than its table's.
    [
        per_length * (integral[0] - integral_before[0]),
        per_length * (share[0] - share_before[0]),
        per_length * (share[1] - share_before[1]),
        per_length * (integral[3] - integral_before[3]),
        per_length * (share[3] - share_before[3]),
        per_length * (share[4] - share_before[4]),
    ]
}

/// Sets one pixel's mean.
#[inline(always)]
fn product(x: &LineJet, y: &LineJet, means: &mut [Mean], column: usize) {
    let numbers = [
        x[0] * y[0],
        x[1] * y[0],
        x[0] * y[1],
        x[2] * y[0],
        x[1] * y[1],
        x[0] * y[2],
        x[3] * y[0] + x[0] * y[3],
        x[4] * y[0] + x[1] * y[3],
        x[3] * y[1] + x[0] * y[4],
        x[5] * y[0] + x[2] * y[3],
        x[4] * y[1] + x[1] * y[4],
        x[3] * y[2] + x[0] * y[5],
    ];
    put::<QUANTITIES>(means, column, |n| numbers[n]);
}

impl Ladder<Spline> {
    /// For a cell of any shape, at the hits of bent rays.
    #[inline(always)]
    pub(super) fn fill_means_at<const N: usize>(&self, scratch: &mut Scratch) {
        let Scratch { hits, points, means, .. } = scratch;
        let columns = points[0].len();
        fit(means, columns, points[1].len());
        for (hits, means) in hits.chunks(columns).zip(means.chunks_mut(columns.div_ceil(LANES))) {
            for (column, Hit { place: hit, width, sigma_mm, has_pixel, .. }) in hits.iter().enumerate() {
                let tables = self.nearest(*sigma_mm);
                let (Tables { share, integral, .. }, more_mm) = (tables, sigma_mm - tables.sigma_mm);
                if *has_pixel {
                    let jet = share.jet::<N>(&share.stencil(0, hit.x), &share.stencil(1, hit.y), more_mm);
                    put::<N>(means, column, |n| jet[n]);
                    continue;
                }
                let (low, high) = (*hit - 0.5 * *width, *hit + 0.5 * *width);
                let [left, right] = [integral.stencil(0, low.x), integral.stencil(0, high.x)];
                let [lower, upper] = [integral.stencil(1, low.y), integral.stencil(1, high.y)];
                let (a, b) = (integral.jet::<N>(&left, &lower, more_mm), integral.jet::<N>(&right, &lower, more_mm));
                let (c, d) = (integral.jet::<N>(&left, &upper, more_mm), integral.jet::<N>(&right, &upper, more_mm));
                let per_area = 1.0 / (width.x * width.y);
                put::<N>(means, column, difference([&a, &b, &c, &d], per_area));
            }
        }
    }
}

impl Ladder<Cross> {
    /// For a rectangle along the axes, at the hits of bent rays.
    #[inline(always)]
    pub(super) fn fill_means_at(&self, scratch: &mut Scratch) {
        let Scratch { hits, points, means, .. } = scratch;
        let columns = points[0].len();
        fit(means, columns, points[1].len());
        for (hits, means) in hits.chunks(columns).zip(means.chunks_mut(columns.div_ceil(LANES))) {
            for (column, Hit { place: hit, width, sigma_mm, has_pixel, .. }) in hits.iter().enumerate() {
                let tables = self.nearest(*sigma_mm);
                let more_mm = sigma_mm - tables.sigma_mm;
                let mut jets = [LineJet::default(); 2];
                for (axis, jet) in jets.iter_mut().enumerate() {
                    let (hit, width) = (hit[axis], width[axis]);
                    *jet = match has_pixel {
                        true => tables.share.line(axis).jet(hit, more_mm),
                        false => between(
                            &tables.end(axis, hit - 0.5 * width, more_mm),
                            &tables.end(axis, hit + 0.5 * width, more_mm),
                            width,
                        ),
                    };
                }
                product(&jets[0], &jets[1], means, column);
            }
        }
    }
}
