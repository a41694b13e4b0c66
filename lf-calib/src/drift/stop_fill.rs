//! The part of the stop that the light of a point fills.
//!
//! The sub-images of a free point say nothing about the position of the lattice: if it is off by d, they still fit a
//! point, displaced by d m Z / g. The reconstructed volume is sheared, and only the stop shows it. The light of each
//! lenslet is assigned to the position U in the stop from which the point lights it. The mean of U over all light is
//! the middle of the stop, or d / k off. The spread of U is the stop's radius; it is too large if the array is too far
//! from the sensor.

use crate::{points::spot, points::sub_images::PointBlur, points::sub_images::spot_profile, points::view::PointView};
use glam::{DVec2, DVec3};
use lf_core::{Optics, statistics::ranked};
use ndarray::ArrayView2;

/// Radii of the stop that lenslets are read within. A drift of 3 of 14 px moves the stop by 0.43 radii.
const REACH: f64 = 1.55;
/// A lenslet with more than this many times the light of a fully lit one shows another object too.
const BRIGHTEST: f64 = 1.5;
/// Largest share of lenslets that show another object.
const MOST_FOREIGN: f64 = 0.12;
/// The light of a fully lit lenslet is this quantile over all lenslets within reach. A round stop lights 1 / 1.55^2 of
/// them, less the rim, so the quantile is well inside the lit ones.
const FULL_QUANTILE: f64 = 0.8;
const STEPS: usize = 8;

/// The stop as the light of a point fills it.
pub(crate) struct StopFill {
    /// Mean position of the light, mm.
    pub middle_mm: DVec2,
    /// Root mean square distance of the light from there, over that of the whole stop evenly lit.
    pub spread: f64,
    /// Image centre of the lenslet that the point's chief ray meets, mm from the sensor's middle.
    pub image_mm: DVec2,
}

/// How a point fills the stop. None if some of its sub-images are outside the image, if too many of its lenslets show
/// another object, or if the light does not fill a stop of about the right size.
pub(crate) fn stop_fill(image: ArrayView2<f32>, optics: &Optics, place_mm: DVec3, blur: PointBlur) -> Option<StopFill> {
    let view = PointView::new(optics, place_mm);
    let profile = spot_profile(optics, &view, blur);
    let lights: Vec<(DVec2, f64)> = view
        .lit_lenslets(REACH, None)
        .iter()
        .map(|lit| Some((lit.aperture_mm, spot::light(image, profile, lit.place_px)?)))
        .collect::<Option<_>>()?;
    let full = full_light(&lights)?;
    let (middle_mm, spread) = middle_and_spread(&lights, full, optics)?;
    let image_mm = optics.sensor_from_array(optics.lattice().nearest_centre_mm(view.chief_mm), DVec2::ZERO);
    (middle_mm.is_finite() && spread > 0.5 && spread < 1.5).then_some(StopFill { middle_mm, spread, image_mm })
}

/// Light of a fully lit lenslet. None if there is no light or if too many lenslets have more.
fn full_light(lights: &[(DVec2, f64)]) -> Option<f64> {
    let mut counts: Vec<f64> = lights.iter().map(|(_, light)| *light).collect();
    let rank = (counts.len() as f64 * FULL_QUANTILE) as usize;
    let full = ranked(&mut counts, rank).filter(|full| *full > 0.0)?;
    let foreign = counts.iter().filter(|light| **light > BRIGHTEST * full).count();
    (foreign as f64 <= MOST_FOREIGN * counts.len() as f64).then_some(full)
}

/// Mean position of the light in the stop, mm, and its spread relative to an even stop. Only light near it counts.
fn middle_and_spread(lights: &[(DVec2, f64)], full: f64, optics: &Optics) -> Option<(DVec2, f64)> {
    let radius = optics.half_aperture_mm;
    let is_square = optics.passes(DVec2::splat(0.99 * radius));
    // Mean square distance over the squared radius or half side: 1/2 for an even disc, 2/3 for an even square.
    let even = if is_square { 2.0 / 3.0 } else { 0.5 };
    let (mut middle, mut spread) = (DVec2::ZERO, 1.0);
    for _ in 0..STEPS {
        let is_near = |aperture: DVec2| {
            let away = (aperture - middle).abs();
            (if is_square { away.max_element() } else { away.length() }) <= 1.25 * radius
        };
        let (mut sum, mut light, mut squares) = (DVec2::ZERO, 0.0, 0.0);
        for (aperture, counts) in lights.iter().filter(|(aperture, _)| is_near(*aperture)) {
            let weight = (counts / full).clamp(-0.5, BRIGHTEST);
            sum += weight * *aperture;
            light += weight;
            squares += weight * aperture.distance_squared(middle);
        }
        if light <= 0.0 {
            return None;
        }
        let next = sum / light;
        spread = (squares / light / even).max(0.0).sqrt() / radius;
        let step = next.distance(middle);
        middle = next;
        if step < 1e-4 * radius {
            break;
        }
    }
    Some((middle, spread))
}
