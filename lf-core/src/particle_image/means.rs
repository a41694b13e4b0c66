//! Means of a cell's share of light over pixels, with their derivatives by the place on the array.

use super::cell_surface::Tables;
use super::cross::{Cross, LineJet};
use super::lenslet_image::Scratch;
use super::mean::Mean;
use super::spline::{Jet, Spline};

impl Tables<Spline> {
    /// For a cell of any shape. The mean is the second difference of the integral at the pixel's corners, or the share
    /// at its middle.
    #[inline(always)]
    pub(super) fn fill_means<const N: usize>(&self, more_mm: f64, has_pixel: bool, scratch: &mut Scratch) {
        let Tables { share, integral, .. } = self;
        let Scratch { edges, points, means, stencils, corners, .. } = scratch;
        means.clear();
        stencils.clear();
        if has_pixel {
            stencils.extend(points[0].iter().map(|point| share.stencil(0, point.x)));
            for y in points[1].iter().map(|point| share.stencil(1, point.x)) {
                means.extend(stencils.iter().map(|x| mean(share.jet::<N>(x, &y, more_mm))));
            }
            return;
        }
        stencils.extend(edges[0].iter().map(|edge| integral.stencil(0, edge.x)));
        let [above, below] = corners;
        for (row, edge) in edges[1].iter().enumerate() {
            std::mem::swap(above, below);
            let y = integral.stencil(1, edge.x);
            below.clear();
            below.extend(stencils.iter().map(|x| integral.jet::<N>(x, &y, more_mm)));
            if row == 0 {
                continue;
            }
            let height = edge.x - edges[1][row - 1].x;
            for column in 1..stencils.len() {
                let per_area = 1.0 / (height * (edges[0][column].x - edges[0][column - 1].x));
                let (a, b, c, d) = (&above[column - 1], &above[column], &below[column - 1], &below[column]);
                means.push(mean(std::array::from_fn(|k| per_area * ((a[k] - b[k]) - (c[k] - d[k])))));
            }
        }
    }
}

#[inline(always)]
fn mean([level, x, y, xx, xy, yy, by_size, x_by, y_by, xx_by, xy_by, yy_by]: Jet) -> Mean {
    let (slope_by_size, curve_by_size) = ([x_by, y_by], [xx_by, xy_by, yy_by]);
    Mean { level, slope: [x, y], curve: [xx, xy, yy], by_size, slope_by_size, curve_by_size }
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
        means.clear();
        for y in &jets[1] {
            means.extend(jets[0].iter().map(|x| product(x, y)));
        }
    }
}

#[inline(always)]
fn product(x: &LineJet, y: &LineJet) -> Mean {
    Mean {
        level: x[0] * y[0],
        slope: [x[1] * y[0], x[0] * y[1]],
        curve: [x[2] * y[0], x[1] * y[1], x[0] * y[2]],
        by_size: x[3] * y[0] + x[0] * y[3],
        slope_by_size: [x[4] * y[0] + x[1] * y[3], x[3] * y[1] + x[0] * y[4]],
        curve_by_size: [x[5] * y[0] + x[2] * y[3], x[4] * y[1] + x[1] * y[4], x[3] * y[2] + x[0] * y[5]],
    }
}

impl Spline {
    /// For a cell of any shape, at the hits of bent rays.
    #[inline(always)]
    pub(super) fn fill_means_at<const N: usize>(&self, more_mm: f64, scratch: &mut Scratch) {
        let Scratch { hits, means, .. } = scratch;
        means.clear();
        means.extend(
            hits.iter().map(|hit| mean(self.jet::<N>(&self.stencil(0, hit.x), &self.stencil(1, hit.y), more_mm))),
        );
    }
}

impl Cross {
    /// For a rectangle along the axes, at the hits of bent rays.
    #[inline(always)]
    pub(super) fn fill_means_at(&self, more_mm: f64, scratch: &mut Scratch) {
        let Scratch { hits, means, .. } = scratch;
        means.clear();
        let [x, y] = [self.line(0), self.line(1)];
        means.extend(hits.iter().map(|hit| product(&x.jet(hit.x, more_mm), &y.jet(hit.y, more_mm))));
    }
}
