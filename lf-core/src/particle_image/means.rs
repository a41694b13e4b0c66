//! Means of a cell's share of light over pixels, with their derivatives by the place on the array.

use super::cell_surface::Tables;
use super::cross::{Cross, LineJet};
use super::lenslet_image::{PLACES, Scratch};
use super::mean::{LANES, Mean, NUMBERS, PLAIN};
use super::spline::Spline;

/// How many numbers of a mean N quantities need.
#[inline(always)]
fn needed<const N: usize>() -> usize {
    if N > PLACES { NUMBERS } else { PLAIN + 1 }
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
        let (columns, count) = (points[0].len(), needed::<N>());
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
                    let mean = &mut means[column / LANES];
                    for n in 0..count {
                        mean[n][column % LANES] = jet[n];
                    }
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
                let mean = &mut means[column / LANES];
                for n in 0..count {
                    mean[n][column % LANES] = per_area * ((upper[0][n] - upper[1][n]) - (lower[0][n] - lower[1][n]));
                }
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
            let (jets, share, integral) = (&mut jets[axis], self.share.line(axis), self.integral.line(axis));
            jets.clear();
            if has_pixel {
                jets.extend(points[axis].iter().map(|point| share.jet(point.x, more_mm)));
                continue;
            }
            let at = |x: f64| (integral.jet(x, more_mm), share.jet(x, more_mm));
            let mut before = edges[axis].first().map(|edge| at(edge.x)).unwrap_or_default();
            for pair in edges[axis].windows(2) {
                let after = at(pair[1].x);
                let per_length = 1.0 / (pair[1].x - pair[0].x);
                let ((integral, share), (integral_before, share_before)) = (&after, &before);
                // The share is the slope of the integral, and smoother than its table's.
                jets.push([
                    per_length * (integral[0] - integral_before[0]),
                    per_length * (share[0] - share_before[0]),
                    per_length * (share[1] - share_before[1]),
                    per_length * (integral[3] - integral_before[3]),
                    per_length * (share[3] - share_before[3]),
                    per_length * (share[4] - share_before[4]),
                ]);
                before = after;
            }
        }
        let columns = jets[0].len();
        fit(means, columns, jets[1].len());
        for (y, means) in jets[1].iter().zip(means.chunks_mut(columns.div_ceil(LANES).max(1))) {
            for (column, x) in jets[0].iter().enumerate() {
                product(x, y, &mut means[column / LANES], column % LANES);
            }
        }
    }
}

/// Sets the mean of one of four pixels.
#[inline(always)]
fn product(x: &LineJet, y: &LineJet, mean: &mut Mean, lane: usize) {
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
    for (mean, number) in mean.iter_mut().zip(numbers) {
        mean[lane] = number;
    }
}

impl Spline {
    /// For a cell of any shape, at the hits of bent rays.
    #[inline(always)]
    pub(super) fn fill_means_at<const N: usize>(&self, more_mm: f64, scratch: &mut Scratch) {
        let Scratch { hits, points, means, .. } = scratch;
        let columns = points[0].len();
        fit(means, columns, points[1].len());
        for (hits, means) in hits.chunks(columns).zip(means.chunks_mut(columns.div_ceil(LANES))) {
            for (column, hit) in hits.iter().enumerate() {
                let jet = self.jet::<N>(&self.stencil(0, hit.x), &self.stencil(1, hit.y), more_mm);
                let mean = &mut means[column / LANES];
                for n in 0..needed::<N>() {
                    mean[n][column % LANES] = jet[n];
                }
            }
        }
    }
}

impl Cross {
    /// For a rectangle along the axes, at the hits of bent rays.
    #[inline(always)]
    pub(super) fn fill_means_at(&self, more_mm: f64, scratch: &mut Scratch) {
        let Scratch { hits, points, means, .. } = scratch;
        let columns = points[0].len();
        fit(means, columns, points[1].len());
        let [x, y] = [self.line(0), self.line(1)];
        for (hits, means) in hits.chunks(columns).zip(means.chunks_mut(columns.div_ceil(LANES))) {
            for (column, hit) in hits.iter().enumerate() {
                let (x, y) = (x.jet(hit.x, more_mm), y.jet(hit.y, more_mm));
                product(&x, &y, &mut means[column / LANES], column % LANES);
            }
        }
    }
}
