//! The sub-images of a point: read from an image under every lenslet that the point lights as a whole.

use super::{
    spot, spot::SpotFit, spot_profile::SpotProfile, view::LitLenslet, view::PointView, view::cell_variance_mm2,
};
use glam::{DVec2, DVec3};
use lf_core::Optics;
use ndarray::ArrayView2;

/// Lenslets are read if they are lit from within this share of the stop. At the rim f-numbers err and lenses shade.
pub(crate) const SHARE: f64 = 0.92;
/// A spot is kept if its profile explains at least this share of the pixels' variance.
const LEAST_EXPLAINED: f64 = 0.5;
/// A spot is kept if its position has a smaller uncertainty, px.
const LEAST_KNOWN_PX: f64 = 0.3;

/// Blur of a point: standard deviations along an axis.
#[derive(Clone, Copy)]
pub(crate) struct PointBlur {
    /// Size of the light source in the object, mm.
    pub object_mm: f64,
    /// Blur of the sub-images on the sensor, px.
    pub sensor_px: f64,
}

#[derive(Clone, Copy)]
pub(crate) struct SubImage {
    pub lenslet: (i64, i64),
    pub place_px: DVec2,
    /// Standard uncertainty of each coordinate, from the pixels and from sampling, px.
    pub uncertainty_px: f64,
    pub sampling_px: f64,
}

pub(crate) fn spot_profile(optics: &Optics, view: &PointView, blur: PointBlur) -> SpotProfile {
    let px_per_mm = 1.0 / optics.pixel_pitch_mm;
    let (i, j) = optics.lattice().lenslet_at(view.chief_mm);
    let width_px = (12.0 * cell_variance_mm2(optics)).sqrt() * view.widening((i, j)).abs() * px_per_mm;
    SpotProfile { width_px, disc_px: blur.object_mm * view.px_per_mm(), sigma_px: blur.sensor_px }
}

/// Reads the sub-images of a point within `farthest_px` of their expected positions, if asked after a `search`.
pub(crate) fn measure(
    image: ArrayView2<f32>,
    optics: &Optics,
    place_mm: DVec3,
    blur: PointBlur,
    farthest_px: f64,
    search: bool,
) -> Vec<SubImage> {
    let view = PointView::new(optics, place_mm);
    let profile = spot_profile(optics, &view, blur);
    let sampling_px = profile.sampling_px();
    let read = |lit: &LitLenslet| {
        let from = if search { spot::find(image, profile, lit.place_px, farthest_px)? } else { lit.place_px };
        let fit = spot::fit(image, profile, from, farthest_px)?;
        let is_good = fit.explained > LEAST_EXPLAINED
            && fit.uncertainty_px < LEAST_KNOWN_PX
            && fit.place_px.distance(lit.place_px) <= farthest_px;
        is_good.then_some((lit.lenslet, fit))
    };
    let fits: Vec<_> = view.lit_lenslets(SHARE, 2.0 * blur.object_mm).iter().filter_map(read).collect();
    // All sub-images of a point are about as bright, so that photons add as much noise to each.
    let sum = |of: fn(&SpotFit) -> f64| fits.iter().map(|(_, fit)| of(fit).powi(2)).sum::<f64>();
    let times = (sum(|fit| fit.by_pixel_px) / sum(|fit| fit.uncertainty_px).max(f64::MIN_POSITIVE)).sqrt();
    let sub_image = |(lenslet, fit): &((i64, i64), SpotFit)| SubImage {
        lenslet: *lenslet,
        place_px: fit.place_px,
        uncertainty_px: (times * fit.uncertainty_px).hypot(sampling_px * std::f64::consts::FRAC_1_SQRT_2),
        sampling_px,
    };
    fits.iter().map(sub_image).collect()
}
