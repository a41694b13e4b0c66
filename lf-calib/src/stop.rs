//! Where in the stop the light of a point comes from.
//!
//! The sub-images of a free point tell nothing about where the lattice is: let it be off by d, and every fan still fits, of a
//! point that is elsewhere by d m Z / g. The volume is sheared and nothing shows it but the stop. A lenslet's light is told
//! by where the point lights it from, U, and the mean of U over all light is the middle of the stop; where the lattice is off
//! by d it is d / k. The spread of U is the stop's radius; where the array is too far from the sensor it is too large.

use crate::fan::{self, Glow};
use crate::sight::Sight;
use crate::spot;
use glam::{DVec2, DVec3};
use lf_core::optics::Optics;
use ndarray::ArrayView2;

/// Lenslets are looked at that are lit from within this many radii: a drift of 3 px of 14 moves the stop by 0.43 of them.
const REACH: f64 = 1.55;
/// A lenslet with more than this many times the light of those in the middle shows something else beside.
const BRIGHTEST: f64 = 1.5;
/// Most lenslets of a fan that show something else.
const MOST_FOREIGN: f64 = 0.12;

/// The stop as a point's light fills it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Filling {
    /// Mean place of the light, mm.
    pub middle_mm: DVec2,
    /// Root mean square distance from there over that of the whole stop evenly lit.
    pub spread: f64,
    /// Middle of the point's lenslets' images, mm from the sensor's.
    pub image_mm: DVec2,
}

/// How a point fills the stop; none where part of its fan leaves the image, or where too many of its lenslets show something
/// else.
pub(crate) fn filling(image: ArrayView2<f32>, optics: &Optics, place_mm: DVec3, glow: Glow) -> Option<Filling> {
    let sight = Sight::new(optics, place_mm);
    let shape = fan::shape(optics, &sight, glow);
    let radius = optics.half_aperture_mm();
    let fan = sight.fan(REACH, None);
    let lights: Vec<(DVec2, f64)> = fan
        .iter()
        .map(|seen| Some((seen.aperture_mm, spot::light(image, shape, seen.place_px)?)))
        .collect::<Option<_>>()?;
    let mut sorted: Vec<f64> = lights.iter().map(|(_, light)| *light).collect();
    sorted.sort_by(f64::total_cmp);
    // Half of the lenslets within reach and more are lit whole by a round stop: 1 / 1.55^2 of them, less the rim.
    let whole = *sorted.get((sorted.len() as f64 * 0.8) as usize)?;
    if whole <= 0.0 {
        return None;
    }
    let foreign = sorted.iter().filter(|light| **light > BRIGHTEST * whole).count();
    if foreign as f64 > MOST_FOREIGN * sorted.len() as f64 {
        return None;
    }
    let share = |light: f64| (light / whole).clamp(-0.5, BRIGHTEST);
    let mut middle = DVec2::ZERO;
    let mut spread = 1.0;
    // What lies beyond the stop about its middle is not the point's.
    for _ in 0..8 {
        let near = |aperture: DVec2| {
            let away = (aperture - middle).abs();
            let far = if optics.passes(DVec2::splat(0.99 * radius)) { away.max_element() } else { away.length() };
            far <= 1.25 * radius
        };
        let (mut sum, mut light, mut squares) = (DVec2::ZERO, 0.0, 0.0);
        for (aperture, counts) in lights.iter().filter(|(aperture, _)| near(*aperture)) {
            let weight = share(*counts);
            sum += weight * *aperture;
            light += weight;
            squares += weight * aperture.distance_squared(middle);
        }
        if light <= 0.0 {
            return None;
        }
        let next = sum / light;
        // An even disc has half its radius' square, an even square two thirds of its half side's.
        let even = if optics.passes(DVec2::splat(0.99 * radius)) { 2.0 / 3.0 } else { 0.5 };
        spread = (squares / light / even).max(0.0).sqrt() / radius;
        let step = next.distance(middle);
        middle = next;
        if step < 1e-4 * radius {
            break;
        }
    }
    let image_mm = optics.sensor_from_array(optics.lattice().nearest_centre_mm(sight.chief_mm()), DVec2::ZERO);
    (middle.is_finite() && spread > 0.5 && spread < 1.5).then_some(Filling { middle_mm: middle, spread, image_mm })
}
