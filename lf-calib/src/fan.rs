//! The fan of a point's images under the lenslets that it lights: read from an image, and the point that it comes from.

use crate::sight::{Sight, cell_variance_mm2};
use crate::spot::{self, Shape};
use glam::{DVec2, DVec3};
use lf_core::optics::Optics;
use nalgebra::{Matrix3, Vector3};
use ndarray::ArrayView2;

/// Lenslets are read that are lit whole through this share of the stop: its rim is where f-numbers err and lenses shade.
const SHARE: f64 = 0.92;
/// A spot that its profile explains worse is not that spot.
const LEAST_EXPLAINED: f64 = 0.5;
/// Least known place of a spot that is kept, px.
const LEAST_KNOWN_PX: f64 = 0.3;
/// Fewest spots that a point is located from.
pub(crate) const FEWEST: usize = 5;
/// Narrowest fan that a point is located from, lenslets across: narrower ones have fewer than five lit whole.
pub(crate) const NARROWEST: f64 = 5.0;
/// Tukey's reach, in standard deviations by the median.
pub(crate) const OUTLIER: f64 = 4.5;
/// The median of a two-dimensional normal scatter's distances, in standard deviations of a coordinate: sqrt(2 ln 2).
pub(crate) const MEDIAN_DISTANCE: f64 = 1.177_410_022_515_474_7;

/// How a point glows: standard deviations along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Glow {
    /// Of its light in the object, mm.
    pub object_mm: f64,
    /// Of what blurs its images on the sensor, px.
    pub sensor_px: f64,
}

/// One image of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spot {
    /// The lenslet that shows it.
    pub lenslet: (i64, i64),
    /// Its middle, px.
    pub place_px: DVec2,
    /// Standard uncertainty of each coordinate by its pixels and by sampling, px.
    pub uncertainty_px: f64,
    /// Amplitude of what sampling may do to it, px.
    pub sampling_px: f64,
}

/// Width of a point's fan, lenslets.
pub(crate) fn width(optics: &Optics, place_mm: DVec3) -> f64 {
    2.0 * optics.half_aperture_mm() * Sight::new(optics, place_mm).spread().abs() / optics.lattice().row_pitch_mm()
}

/// How the images of a point should look.
pub(crate) fn shape(optics: &Optics, sight: &Sight, glow: Glow) -> Shape {
    let px_per_mm = 1.0 / optics.pixel_pitch_mm();
    let (i, j) = optics.lattice().lenslet_at(sight.chief_mm());
    let width_px = (12.0 * cell_variance_mm2(optics)).sqrt() * sight.widening((i, j)).abs() * px_per_mm;
    Shape { width_px, disc_px: glow.object_mm * sight.px_per_mm(), sigma_px: glow.sensor_px }
}

/// Reads a point's images where they should be, and no farther than `farthest_px` from there; with `look` after a first look
/// around.
pub(crate) fn measure(
    image: ArrayView2<f32>,
    optics: &Optics,
    place_mm: DVec3,
    glow: Glow,
    farthest_px: f64,
    look: bool,
) -> Vec<Spot> {
    let sight = Sight::new(optics, place_mm);
    let shape = shape(optics, &sight, glow);
    let sampling_px = shape.sampling_px();
    let fan = sight.fan(SHARE, Some(2.0 * glow.object_mm));
    let read = |seen: &crate::sight::Seen| {
        let from = if look { spot::look(image, shape, seen.place_px, farthest_px)? } else { seen.place_px };
        let reading = spot::read(image, shape, from, farthest_px)?;
        let good = reading.explained > LEAST_EXPLAINED
            && reading.uncertainty_px < LEAST_KNOWN_PX
            && reading.place_px.distance(seen.place_px) <= farthest_px;
        good.then(|| Spot {
            lenslet: seen.lenslet,
            place_px: reading.place_px,
            uncertainty_px: reading.uncertainty_px.hypot(sampling_px * std::f64::consts::FRAC_1_SQRT_2),
            sampling_px,
        })
    };
    fan.iter().filter_map(read).collect()
}

/// Tukey's weight of a residual in standard deviations.
pub(crate) fn trust(residual: f64) -> f64 {
    let part = residual / OUTLIER;
    if part >= 1.0 { 0.0 } else { (1.0 - part * part).powi(2) }
}

/// The median of positive numbers over what a normal scatter of deviation 1 has; not below 1e-9.
pub(crate) fn scale(mut distances: Vec<f64>) -> f64 {
    if distances.is_empty() {
        return 1.0;
    }
    let half = distances.len() / 2;
    let (_, &mut median, _) = distances.select_nth_unstable_by(half, f64::total_cmp);
    (median / MEDIAN_DISTANCE).max(1e-9)
}

/// The point that spots come from by a camera's own rays, and the scatter about it, px. None from too few, or where the point
/// runs into focus.
pub(crate) fn locate(optics: &Optics, spots: &[Spot], from_mm: DVec3) -> Option<(DVec3, f64)> {
    const STEPS_MM: [f64; 3] = [1e-3, 1e-3, 1e-3];
    if spots.len() < FEWEST {
        return None;
    }
    let mut place = from_mm;
    let mut scatter = 0.0;
    for _ in 0..6 {
        if width(optics, place) < 0.7 * NARROWEST {
            return None;
        }
        let at = |place: DVec3| {
            let sight = Sight::new(optics, place);
            spots.iter().map(|spot| sight.place_px(spot.lenslet)).collect::<Vec<_>>()
        };
        let here = at(place);
        let moved: Vec<Vec<DVec2>> =
            [DVec3::X, DVec3::Y, DVec3::Z].iter().zip(STEPS_MM).map(|(axis, step)| at(place + step * *axis)).collect();
        let off: Vec<DVec2> = spots.iter().zip(&here).map(|(spot, here)| spot.place_px - *here).collect();
        scatter = scale(off.iter().map(|off| off.length()).collect());
        let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (n, off) in off.iter().enumerate() {
            let weight = trust(off.length() / scatter.max(0.02));
            for axis in 0..2 {
                let slope = |p: usize| (moved[p][n][axis] - here[n][axis]) / STEPS_MM[p];
                let line = Vector3::new(slope(0), slope(1), slope(2));
                matrix.ger(weight, &line, &line, 1.0);
                right += weight * off[axis] * line;
            }
        }
        let step = matrix.cholesky()?.solve(&right);
        place += DVec3::new(step[0], step[1], step[2]);
        if !place.is_finite() || place.distance(from_mm) > 2.0 * (1.0 + from_mm.z.abs()) {
            return None;
        }
        if step.norm() < 1e-6 {
            break;
        }
    }
    Some((place, scatter))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sight::tests::seed;
    use lf_core::camera::Layout;

    #[test]
    fn a_point_is_found_again_from_its_fan_with_outliers_in_it() {
        let camera = seed(60, Layout::Square);
        let optics = Optics::new(&camera);
        for place in [DVec3::new(0.6, -0.9, 3.1), DVec3::new(-0.3, 0.2, -2.0)] {
            let fan = Sight::new(&optics, place).fan(SHARE, Some(0.02));
            let spots: Vec<Spot> = fan
                .iter()
                .enumerate()
                .map(|(n, seen)| Spot {
                    lenslet: seen.lenslet,
                    place_px: seen.place_px + if n % 9 == 4 { DVec2::new(2.0, 1.0) } else { DVec2::ZERO },
                    uncertainty_px: 0.01,
                    sampling_px: 0.0,
                })
                .collect();
            let from = place + DVec3::new(0.05, -0.03, 0.2);
            let (found, _) = locate(&optics, &spots, from).unwrap();
            assert!(found.distance(place) < 1e-4, "{found} {place}");
        }
        assert!(locate(&optics, &[], DVec3::Z).is_none());
    }
}
