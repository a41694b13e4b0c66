//! Images of a dot target: which dot is where, and its spots.

use crate::bundle::Sighting;
use crate::fan::{self, Glow};
use crate::parameters::Pose;
use crate::recognise::{recognise, spacing_mm};
use crate::refocus::refocus;
use crate::sight::Sight;
use glam::{DVec2, DVec3};
use lf_core::optics::Optics;
use ndarray::Array2;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cells of a refocused image in a dot's spacing.
const CELLS: f64 = 32.0;
/// Peaks of light are at least this part of a spacing apart.
const APART: f64 = 0.4;
/// What blurs sub-images beside the dots and pixels, px.
const SENSOR_PX: f64 = 0.05;
/// Deviations of dots that are tried, px; and then steps between them.
const BLURS_PX: [f64; 9] = [0.09, 0.13, 0.2, 0.3, 0.45, 0.65, 0.95, 1.4, 2.0];
const BETWEEN: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.22];
/// Dots whose spots are looked at for the blur.
const BLUR_DOTS: usize = 24;
/// How far a spot may be from its prediction, px: at a first look, then about the point that its fan comes from.
const FIRST_PX: f64 = 4.0;
const NEXT_PX: f64 = 1.5;

/// A dot of a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dot {
    /// The same at every depth.
    pub id: u64,
    /// Where it is said to be, mm.
    pub place_mm: [f64; 3],
}

/// An image of a target at one depth.
#[derive(Debug, Clone)]
pub struct Exposure {
    /// Counts, shape (height, width).
    pub pixels: Array2<f32>,
    /// The target's dots, all that could be seen.
    pub dots: Vec<Dot>,
}

impl Exposure {
    /// Depth of the target: the mean of its dots.
    pub fn depth_mm(&self) -> f64 {
        self.dots.iter().map(|dot| dot.place_mm[2]).sum::<f64>() / self.dots.len().max(1) as f64
    }

    fn flat(&self) -> Vec<DVec2> {
        self.dots.iter().map(|dot| DVec3::from(dot.place_mm).truncate()).collect()
    }
}

/// Numbers of dots by their ids.
pub(crate) fn numbers(exposures: &[Exposure]) -> BTreeMap<u64, usize> {
    let ids: std::collections::BTreeSet<u64> =
        exposures.iter().flat_map(|exposure| exposure.dots.iter().map(|dot| dot.id)).collect();
    ids.into_iter().zip(0..).collect()
}

/// What a first look at an image gives.
#[derive(Debug, Clone)]
pub(crate) struct FirstLook {
    pub sightings: Vec<Sighting>,
    /// Where the target is less where it is said to be, mm.
    pub shift_mm: DVec2,
    /// Depth by the fans less the depth given: the median, mm.
    pub deeper_mm: f64,
}

/// Finds the target in an image by the camera given: in focus at its depth, dots are peaks of light. The error says how many
/// dots were found.
pub(crate) fn first_look(
    exposure: &Exposure,
    number: usize,
    ids: &BTreeMap<u64, usize>,
    optics: &Optics,
    half_view_mm: DVec2,
    shift_mm: Option<DVec2>,
) -> Result<FirstLook, String> {
    let (depth, flat) = (exposure.depth_mm(), exposure.flat());
    let spacing = spacing_mm(&flat).ok_or("a target of less than 2 dots")?;
    let lenslet = optics.lattice().row_pitch_mm() / optics.beta(depth);
    if spacing < lenslet {
        return Err(format!("dots {spacing} mm apart, closer than lenslets, {lenslet:.3} mm, can tell"));
    }
    let image = exposure.pixels.view();
    let map = refocus(image, optics, depth, half_view_mm + 0.5 * spacing, spacing / CELLS);
    // A dot's whole fan fits into the frame where it is this far inside.
    let axis = Sight::new(optics, DVec3::new(0.0, 0.0, depth));
    let inside = half_view_mm - axis.spread().abs() * optics.half_aperture_mm() * 0.5 / optics.beta(depth);
    let peaks: Vec<DVec2> = map.peaks(APART * spacing).into_iter().map(|(_, place)| place).collect();
    let found = recognise(&flat, &peaks, inside.max(0.3 * half_view_mm), shift_mm)?;
    let rough = Glow { object_mm: 0.6 / axis.px_per_mm(), sensor_px: SENSOR_PX };
    let located: Vec<(usize, DVec3)> = found
        .pairs
        .par_iter()
        .filter_map(|&(dot, peak)| {
            let start = peak.extend(exposure.dots[dot].place_mm[2]);
            let spots = fan::measure(image, optics, start, rough, FIRST_PX, true);
            let (place, _) = fan::locate(optics, &spots, start)?;
            let spots = fan::measure(image, optics, place, rough, NEXT_PX, true);
            fan::locate(optics, &spots, place).map(|(place, _)| (dot, place))
        })
        .collect();
    let places: Vec<DVec3> = located.iter().map(|(_, place)| *place).collect();
    let glow = glow(exposure, optics, &places);
    let sightings: Vec<Sighting> = located
        .par_iter()
        .map(|&(dot, place)| Sighting {
            source: ids[&exposure.dots[dot].id],
            exposure: number,
            target_mm: DVec3::from(exposure.dots[dot].place_mm),
            spots: fan::measure(image, optics, place, glow, NEXT_PX, false),
        })
        .filter(|sighting| sighting.spots.len() >= fan::FEWEST)
        .collect();
    let mut deeper: Vec<f64> = located.iter().map(|(dot, place)| place.z - exposure.dots[*dot].place_mm[2]).collect();
    deeper.sort_by(f64::total_cmp);
    let deeper_mm = deeper.get(deeper.len() / 2).copied().unwrap_or(0.0);
    if sightings.len() < 3 {
        return Err(format!("{} dots with a fan of sub-images", sightings.len()));
    }
    Ok(FirstLook { sightings, shift_mm: found.shift_mm, deeper_mm })
}

/// The blur by which the spots of points are best known.
pub(crate) fn glow(exposure: &Exposure, optics: &Optics, places: &[DVec3]) -> Glow {
    let middle = places.get(places.len() / 2).copied().unwrap_or(DVec3::Z);
    let px_per_mm = Sight::new(optics, middle).px_per_mm();
    let every = (places.len() / BLUR_DOTS).max(1);
    let some: Vec<DVec3> = places.iter().step_by(every).copied().collect();
    let of = |blur_px: f64| Glow { object_mm: blur_px / px_per_mm, sensor_px: SENSOR_PX };
    let unknown = |blur_px: &f64| {
        let mut all: Vec<f64> = some
            .par_iter()
            .flat_map_iter(|place| fan::measure(exposure.pixels.view(), optics, *place, of(*blur_px), NEXT_PX, false))
            .map(|spot| spot.uncertainty_px)
            .collect();
        let half = all.len() / 2;
        if all.is_empty() { f64::INFINITY } else { *all.select_nth_unstable_by(half, f64::total_cmp).1 }
    };
    let best = |blurs: &[f64]| {
        let judged = blurs.iter().map(|blur| (unknown(blur), *blur));
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(blurs[0], |judged| judged.1)
    };
    let coarse = best(&BLURS_PX);
    of(best(&BETWEEN.map(|factor| factor * coarse)))
}

/// Reads the spots of every dot where a camera and a pose show it.
pub(crate) fn look_again(
    exposure: &Exposure,
    number: usize,
    ids: &BTreeMap<u64, usize>,
    optics: &Optics,
    pose: &Pose,
) -> Vec<Sighting> {
    let places: Vec<DVec3> = exposure.dots.iter().map(|dot| pose.place_mm(DVec3::from(dot.place_mm))).collect();
    let glow = glow(exposure, optics, &places);
    exposure
        .dots
        .par_iter()
        .map(|dot| {
            let target_mm = DVec3::from(dot.place_mm);
            let spots = fan::measure(exposure.pixels.view(), optics, pose.place_mm(target_mm), glow, NEXT_PX, false);
            Sighting { source: ids[&dot.id], exposure: number, target_mm, spots }
        })
        .filter(|sighting| !sighting.spots.is_empty())
        .collect()
}

/// A square grid of dots across the axis at a depth, one of them on it, over all that the sensor could see there and a
/// little more; the same ids at every depth.
pub fn grid(spacing_mm: f64, depth_mm: f64, camera: &lf_core::camera::Camera) -> Vec<Dot> {
    const MOST: f64 = 200.0;
    let [half_x, half_y] = camera.half_view_mm().map(|half| (1.1 * half / spacing_mm).ceil().min(MOST) as i64);
    let (columns, rows) = (-half_x..=half_x, -half_y..=half_y);
    let dot = |(n, (row, column)): (usize, (i64, i64))| Dot {
        id: n as u64,
        place_mm: [column as f64 * spacing_mm, row as f64 * spacing_mm, depth_mm],
    };
    rows.flat_map(|row| columns.clone().map(move |column| (row, column))).enumerate().map(dot).collect()
}
