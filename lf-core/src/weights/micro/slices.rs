//! The light of one slice of voxels under a lenslet.

use super::array::LensletArray;
use super::bend::Bend;
use super::patches::{Patches, Shape};
use super::stop::Stop;
use super::wide::{Wide, round_blur};
use crate::weights::{blur::Blur, geometry::Geometry};
use glam::DVec2;
use std::sync::Arc;

/// Maximum width of a patch, px; a voxel nearer to focus counts as one at this width.
const WIDEST_PX: f64 = 2000.0;
/// Patches wider than this many images of the stop have no table, since an edge seldom crosses the image.
const WIDE: f64 = 2.0;
/// Patches of rays that bend by more than this part of the beam's half width have no table either, since they are
/// distorted. But a pixel must show a small part of a cell, so patches need at least `MIN_WIDE_PX`: of square cells,
/// and of others.
const BENT: f64 = 0.2;
/// Nor have those whose widths, from one point, differ by more than this factor through aberrations.
const UNLIKE: f64 = 1.25;
const MIN_WIDE_PX: [f64; 2] = [1.6, 2.6];
/// Moments matter for patches narrower than this part of the stop's image; for others they change less than half a per
/// cent of the light.
const MOMENTS: f64 = 0.45;
/// They also matter if the sensor stands so far from the lenslets' focus that light at a cell's rim lies farther than
/// this from its place on the stop's image, px.
const SHIFT_PX: f64 = 0.05;
/// Classes of patches differ by this width, px; and the maximum number of classes.
const CLASS_PX: f64 = 0.1;
const MAX_CLASSES: usize = 24;

#[derive(Debug, Clone)]
pub(super) struct SliceLight {
    /// None if rays run straight.
    pub(super) bend: Option<Arc<Bend>>,
    /// Spread on the array per length of the aperture; not 0.
    pub(super) alpha: f32,
    /// mm of the stop for a mm on the array.
    pub(super) per_alpha: f32,
    /// 1 over the usual slope; see [`LensletArray::usual_slope`].
    pub(super) per_slope: f32,
    /// Lenslets whose centres lie farther than this from the chief ray are dark, mm of the array.
    pub(super) reach_mm: f64,
    /// Largest distance in the stop between light through a lenslet and the ray through the lenslet's centre, mm.
    pub(super) reach_stop: f32,
    /// Upper bound of the distance between bent and straight rays through the lenslets of a row, px.
    pub(super) slack: f32,
    /// A pixel, mm of the stop.
    pub(super) margin: f32,
    pub(super) light: Light,
}

/// How the light of a pixel is found.
#[derive(Debug, Clone)]
pub(super) enum Light {
    Narrow(Patches),
    Wide(Wide),
}

/// The shape of a slice's patches, and what follows from it.
struct Outline<'a> {
    geometry: &'a Geometry,
    blurs: [Blur; 2],
    alpha: f64,
    /// px of the sensor for a mm of the stop, where the sensor is nearest to the array and where it is farthest: for
    /// rays through a lenslet's centre, and for this slice's rays through all of a lenslet.
    per_mm: [f64; 2],
    slope: [f64; 2],
    /// Range of the width of a patch over the usual width: by the bend of rays alone, and in all.
    by_bend: [f64; 2],
    widths: [f64; 2],
    /// Largest side, px.
    side_px: f64,
    is_wide: bool,
    has_moments: bool,
}

impl<'a> Outline<'a> {
    fn new(geometry: &'a Geometry, array: &LensletArray, z: usize, bend: Option<&Bend>) -> Self {
        let axis = geometry.axis(z, 0);
        let blurs = geometry.blurs(&axis);
        let half = axis.half_aperture;
        let corner = geometry.corner().max_element();
        let wide_mm = 2.0 * (corner + DVec2::from(blurs.map(Blur::reach)).max_element());
        let per_mm = array.extremes.map(|[per_mm, _]| per_mm);
        let alpha = bend.map_or(axis.alpha, |bend| bend.alpha);
        let usual = array.usual_slope(alpha);
        let alpha = alpha.abs().max(wide_mm / WIDEST_PX * usual.abs()).copysign(alpha);
        let slope = array.extremes.map(|[per_mm, refocus]| per_mm - refocus * alpha);
        let by_bend = bend.map_or([1.0; 2], |bend| bend.widths);
        let by_gap = slope.map(|slope| (slope / usual).abs());
        let [low, high] = [by_gap[0].min(by_gap[1]), by_gap[0].max(by_gap[1])];
        let widths = [low * by_bend[0], high * by_bend[1]];
        let side_px = wide_mm * (usual / alpha).abs();
        let stop_px = 2.0 * half * usual.abs();
        let least_px = MIN_WIDE_PX[usize::from(geometry.slabs.len() > 1)];
        let is_distorted = |bend: &Bend| bend.greatest > BENT * (bend.alpha * half).abs() || bend.unlike > UNLIKE;
        let is_bent = side_px > least_px && bend.is_some_and(is_distorted);
        let shift = (0..2).map(|n| (per_mm[n] / slope[n] - 1.0).abs()).fold(0.0, f64::max);
        let is_shifted = corner * (usual / alpha).abs() * shift > SHIFT_PX;
        Self {
            geometry,
            blurs,
            alpha,
            per_mm,
            slope,
            by_bend,
            widths,
            side_px: side_px * widths[1],
            is_wide: side_px > WIDE * stop_px || is_bent,
            has_moments: side_px < MOMENTS * stop_px || is_shifted,
        }
    }

    fn classes(&self) -> usize {
        let [least, most] = self.widths;
        let classes = ((most - least) * self.side_px / CLASS_PX).ceil() as usize + 1;
        if most - least < 1e-6 { 1 } else { classes.clamp(2, MAX_CLASSES) }
    }

    /// The shapes of all classes, and the change of the width from one to the next.
    fn shapes(&self, usual: f64) -> (Vec<Shape<'a>>, f64) {
        let [least, most] = self.widths;
        let classes = self.classes();
        let step = if classes > 1 { (most - least) / (classes - 1) as f64 } else { 1.0 };
        let shape = |class: usize| {
            let width = least + step * class as f64;
            // The light of a pixel does not depend on the bend. If rays bend and the sensor is tilted, take the bend.
            let is_bent = self.by_bend[0] < self.by_bend[1];
            let slope = if is_bent { usual } else { usual * width };
            let part = if is_bent || self.slope[0] == self.slope[1] {
                0.5
            } else {
                (slope.abs() - self.slope[0].abs()) / (self.slope[1].abs() - self.slope[0].abs())
            };
            let per_mm = self.per_mm[0] + part * (self.per_mm[1] - self.per_mm[0]);
            Shape {
                slabs: &self.geometry.slabs,
                blurs: self.blurs,
                step_mm: (self.alpha / (usual * width)).abs(),
                shift: per_mm / slope - 1.0,
                scale: (per_mm / slope) * (per_mm / slope),
            }
        };
        ((0..classes).map(shape).collect(), step)
    }
}

impl SliceLight {
    pub(super) fn new(
        geometry: &Geometry,
        array: &LensletArray,
        stop: Stop,
        z: usize,
        bend: Option<Arc<Bend>>,
    ) -> Self {
        let outline = Outline::new(geometry, array, z, bend.as_deref());
        let half = geometry.optics.half_aperture_mm;
        let corner = geometry.corner();
        let cell = if geometry.has_round_stop { corner.length() } else { corner.max_element() };
        let cell = cell + DVec2::from(outline.blurs.map(Blur::reach)).max_element();
        let alpha = outline.alpha;
        let usual = array.usual_slope(alpha);
        let light = if outline.is_wide {
            let greatest = bend.as_ref().map_or(0.0, |bend| bend.greatest);
            Light::Wide(Wide::new(geometry, stop, round_blur(outline.blurs), alpha, greatest, outline.has_moments))
        } else {
            let (shapes, step) = outline.shapes(usual);
            Light::Narrow(Patches::new(&shapes, outline.widths[0], step, outline.has_moments))
        };
        let departs = bend.as_ref().map_or(0.0, |bend| bend.greatest / alpha.abs());
        Self {
            alpha: alpha as f32,
            per_alpha: (1.0 / alpha) as f32,
            per_slope: (1.0 / array.usual_slope(f64::from(alpha as f32))) as f32,
            reach_mm: cell + bend.as_ref().map_or(alpha.abs() * half, |bend| bend.reach),
            reach_stop: (cell / alpha.abs() * outline.by_bend[1]) as f32,
            slack: (2.0 * departs * usual.abs()) as f32,
            margin: (geometry.optics.pixel_pitch_mm / geometry.optics.demagnification) as f32,
            bend,
            light,
        }
    }

    /// Predicts the bytes of a slice.
    pub(super) fn estimated_bytes(geometry: &Geometry, array: &LensletArray, z: usize, bend: Option<&Bend>) -> usize {
        let outline = Outline::new(geometry, array, z, bend);
        let nodes = bend.map_or(0, Bend::bytes);
        if outline.is_wide {
            return nodes;
        }
        nodes + Patches::estimated_bytes(outline.side_px, outline.classes(), outline.has_moments)
    }
}
