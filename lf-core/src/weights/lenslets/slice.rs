//! The optics of one slice, as a lenslet's image of a voxel needs them.

use super::stop::ApertureBehind;
use crate::weights::{axis::Axis, blur::Blur, geometry::Geometry};
use glam::DVec2;

/// Smallest step, as a fraction of the voxel's footprint on the array; nearer focus counts as focus.
const LEAST_STEP: f64 = 1.0 / 1536.0;
/// Largest step in the same unit: a voxel's image is then a point.
const LARGEST_STEP: f64 = 1e6;

#[derive(Debug, Clone, Copy)]
pub(super) struct SliceOptics {
    pub(super) z: usize,
    pub(super) axis: Axis,
    /// Change of the place on the array from one pixel's edge to the next, mm; never 0.
    pub(super) step_mm: f64,
    /// px per mm of aperture, with the sign of [`Axis::sensor_line`].
    slope: f64,
    pub(super) per_slope: f64,
    per_alpha: f64,
    /// Half the stop, mm.
    pub(super) half: f32,
    /// Half the beam of the stop on the array, mm.
    pub(super) spread: f64,
    /// 1 / (width of a pixel), 1/mm.
    pub(super) per_pixel: f64,
    /// The middle of a patch, px per mm of the chief ray's place and of the lenslet's centre.
    pub(super) by_chief: f64,
    pub(super) by_centre: f64,
    /// Half sides of the cell and of the blurred cell, mm.
    pub(super) corner: DVec2,
    pub(super) reach: DVec2,
    /// From mm^2 of the array to the share of the light.
    pub(super) scale: f32,
}

impl SliceOptics {
    pub(super) fn new(geometry: &Geometry, z: usize) -> Self {
        let axis = geometry.axis(z, 0);
        let (_, slope) = axis.sensor_line(0.0, 0.0);
        let corner = geometry.corner();
        let reach = corner + DVec2::from(geometry.blurs(&axis).map(Blur::reach));
        let size_mm = 2.0 * reach.max_element();
        let step_mm = (axis.alpha / slope).abs().clamp(LEAST_STEP * size_mm, LARGEST_STEP * size_mm);
        // The alpha that belongs to this step: not 0 even in focus, with the sign of the true one.
        let alpha = (step_mm * slope.abs()).copysign(axis.alpha);
        let axis = Axis { alpha, ..axis };
        let per_pixel = 1.0 / axis.pixel_pitch;
        let whole = 2.0 * axis.half_aperture * alpha;
        Self {
            z,
            step_mm,
            slope,
            per_slope: 1.0 / slope,
            per_alpha: 1.0 / alpha,
            half: axis.half_aperture as f32,
            per_pixel,
            spread: alpha.abs() * axis.half_aperture,
            by_chief: axis.array_gain * per_pixel + slope / alpha,
            by_centre: axis.lenslet_gain * per_pixel - slope / alpha,
            corner,
            reach,
            scale: geometry.scale / (whole * whole) as f32,
            axis,
        }
    }

    /// The aperture behind pixels along one axis, for a cell `[low, high]`. `zero` is the pixel edge that U = 0 meets
    /// and `beyond` the chief ray's place from the lenslet's centre.
    #[inline(always)]
    pub(super) fn aperture_behind(&self, zero: f64, beyond: f64, cell: [f64; 2], per_slope: f64) -> ApertureBehind {
        let [a, b] = cell.map(|edge| (edge - beyond) * self.per_alpha);
        ApertureBehind { zero: zero as f32, per_slope: per_slope as f32, low: a.min(b) as f32, high: a.max(b) as f32 }
    }

    /// First and end pixel of the stop's image, for pixels cut into `per_px` parts.
    #[inline(always)]
    pub(super) fn stop_pixels(&self, zero: f64, per_px: f64) -> (i32, i32) {
        let half = per_px * self.slope.abs() * self.axis.half_aperture;
        ((zero - half).floor() as i32, (zero + half).floor() as i32 + 1)
    }
}
