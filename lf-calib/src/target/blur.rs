//! The blur of the sub-images of a target's dots.

use crate::points::sub_images::{PointBlur, measure};
use crate::points::view::PointView;
use glam::DVec3;
use lf_core::optics::Optics;
use lf_core::statistics::upper_median;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Largest distance of a sub-image from the prediction of a located point, px.
pub(crate) const NEXT_PX: f64 = 1.5;
/// Blur of the sub-images beside the size of the dots and of the pixels, px.
pub(crate) const SENSOR_PX: f64 = 0.05;
/// Sizes of dots (standard deviations) that are tried, px on the sensor, then factors about the best of them.
const BLURS_PX: [f64; 9] = [0.09, 0.13, 0.2, 0.3, 0.45, 0.65, 0.95, 1.4, 2.0];
const FACTORS: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.22];
/// Dots whose sub-images are read for it.
const BLUR_DOTS: usize = 24;

/// The blur that gives the sub-images of points at `places` the smallest uncertainties.
pub(crate) fn best_blur(image: ArrayView2<f32>, optics: &Optics, places: &[DVec3]) -> PointBlur {
    let middle = places.get(places.len() / 2).copied().unwrap_or(DVec3::Z);
    let px_per_mm = PointView::new(optics, middle).px_per_mm();
    let every = (places.len() / BLUR_DOTS).max(1);
    let some: Vec<DVec3> = places.iter().step_by(every).copied().collect();
    let blur = |blur_px: f64| PointBlur { object_mm: blur_px / px_per_mm, sensor_px: SENSOR_PX };
    let median_uncertainty = |blur_px: f64| {
        let read = |place: &DVec3| measure(image, optics, *place, blur(blur_px), NEXT_PX, false);
        let mut all: Vec<f64> = some.par_iter().flat_map_iter(read).map(|sub_image| sub_image.uncertainty_px).collect();
        upper_median(&mut all).unwrap_or(f64::INFINITY)
    };
    let best = |blurs_px: &[f64]| {
        let judged = blurs_px.iter().map(|blur_px| (median_uncertainty(*blur_px), *blur_px));
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(blurs_px[0], |judged| judged.1)
    };
    let coarse = best(&BLURS_PX);
    blur(best(&FACTORS.map(|factor| factor * coarse)))
}
