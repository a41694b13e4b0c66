//! Finds the dots of a target in an image, and reads their sub-images.

use super::{
    bundle::DotSighting, exposure::Exposure, recognise::no_target, recognise::recognise, recognise::spacing_mm,
};
use crate::points::locate::{FEWEST, locate};
use crate::points::sub_images::{PointBlur, measure};
use crate::{
    fit::changes::Changes, fit::changes::TargetPose, fit::parameter::Parameter as P, points::refocus::refocus,
    points::view::PointView,
};
use glam::{DVec2, DVec3};
use lf_core::{Camera, Optics, Refusal, statistics::upper_median};
use ndarray::ArrayView2;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cells of a refocused image per spacing of the dots.
const CELLS: f64 = 32.0;
/// Smallest distance between peaks of light, in spacings.
const APART: f64 = 0.4;
/// Peaks of light that show another spacing than that of the dots: their number, and the difference.
const FEWEST_PEAKS: usize = 9;
const OTHER_SPACING: f64 = 0.15;
/// Largest distance of a sub-image from its prediction in the first reading, px.
const FIRST_PX: f64 = 4.0;

/// Largest distance of a sub-image from the prediction of a located point, px.
const NEXT_PX: f64 = 1.5;
/// Blur that no camera names, px.
const SENSOR_PX: f64 = 0.05;
/// Sizes of dots (standard deviations) that are tried, px on the sensor, then factors about the best of them.
const BLURS_PX: [f64; 9] = [0.09, 0.13, 0.2, 0.3, 0.45, 0.65, 0.95, 1.4, 2.0];
const FACTORS: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.22];
/// Dots whose sub-images are read for it.
const BLUR_DOTS: usize = 24;

/// An image of a target and its number among the images, with the numbers of the dots and the camera's optics.
#[derive(Clone, Copy)]
pub(crate) struct TargetImage<'a> {
    pub exposure: &'a Exposure,
    pub number: usize,
    pub ids: &'a BTreeMap<u64, usize>,
    pub optics: &'a Optics,
    /// The camera as it is known, for its blur.
    pub nominal: &'a Camera,
}

impl TargetImage<'_> {
    /// Blur of the sub-images beside the size of the dots and of the pixels, px.
    fn sensor_px(&self) -> f64 {
        SENSOR_PX.hypot(self.nominal.blur_core_px())
    }
}

struct FirstDetection {
    sightings: Vec<DotSighting>,
    /// Measured minus stated position of the target across the axis, mm.
    shift_mm: DVec2,
    /// Median of the measured minus the stated depths, mm.
    deeper_mm: f64,
}

/// Finds the target in one image after another, with the nominal camera. Returns the dots seen and the start of a fit.
/// Calls `done` after each image. An error holds the number of its image.
pub(crate) fn first_detections<'a>(
    images: impl Iterator<Item = TargetImage<'a>>,
    half_view_mm: DVec2,
    done: impl Fn(),
) -> Result<(Vec<DotSighting>, Changes), (Option<usize>, Refusal)> {
    let (mut sightings, mut shift, mut deeper) = (Vec::new(), None, Vec::new());
    for image in images {
        let seen = first_detection(image, half_view_mm, shift).map_err(|refusal| (Some(image.number), refusal))?;
        shift = Some(seen.shift_mm);
        deeper.push(seen.deeper_mm);
        sightings.extend(seen.sightings);
        done();
    }
    let shift = shift.unwrap_or_default();
    let mut start = Changes::NONE;
    start.set(P::TargetX, shift.x);
    start.set(P::TargetY, shift.y);
    start.set(P::FocusOffset, deeper.iter().sum::<f64>() / deeper.len() as f64);
    Ok((sightings, start))
}

/// Finds the target in an image, with the nominal camera: in an image refocused at its depth, dots are peaks of light.
/// `shift_mm` is the target's shift if another image has shown it. Refuses an image in which the target is not found.
fn first_detection(
    target: TargetImage,
    half_view_mm: DVec2,
    shift_mm: Option<DVec2>,
) -> Result<FirstDetection, Refusal> {
    let TargetImage { exposure, optics, .. } = target;
    let (depth, flat) = (exposure.depth_mm(), exposure.flat_mm());
    let spacing = spacing_mm(&flat).ok_or_else(|| no_target("a table of fewer than 2 dots"))?;
    let lenslet = optics.lattice().row_pitch_mm() / optics.beta(depth);
    if spacing < lenslet {
        return Err(Refusal::new(
            format!("no target: dots {spacing} mm apart"),
            format!("wanted at least {lenslet:.3} mm, which lenslets can resolve"),
        ));
    }
    let image = exposure.pixels.view();
    let refocused = refocus(image, optics, depth, half_view_mm + 0.5 * spacing, spacing / CELLS);
    // All sub-images of a dot are in the frame if the dot is this near the axis.
    let axis = PointView::new(optics, DVec3::new(0.0, 0.0, depth));
    let inside = half_view_mm - axis.alpha.abs() * optics.half_aperture_mm * 0.5 / optics.beta(depth);
    let peaks: Vec<DVec2> = refocused.peaks(APART * spacing).into_iter().map(|(_, place)| place).collect();
    let found = recognise(&flat, &peaks, inside.max(0.3 * half_view_mm), shift_mm)
        .map_err(|refusal| with_spacing(refusal, spacing, &peaks))?;
    let rough = PointBlur { object_mm: 0.6 / axis.px_per_mm(), sensor_px: target.sensor_px() };
    let located: Vec<(usize, DVec3)> = found
        .pairs
        .par_iter()
        .filter_map(|&(dot, peak)| {
            let start = peak.extend(exposure.dots[dot].place_mm[2]);
            let (place, _) = locate(optics, &measure(image, optics, start, rough, FIRST_PX, true), start)?;
            let (place, _) = locate(optics, &measure(image, optics, place, rough, NEXT_PX, true), place)?;
            Some((dot, place))
        })
        .collect();
    let sightings = sightings(target, &located, FEWEST);
    let mut deeper: Vec<f64> = located.iter().map(|(dot, place)| place.z - exposure.dots[*dot].place_mm[2]).collect();
    let deeper_mm = upper_median(&mut deeper).unwrap_or(0.0);
    if sightings.len() < 3 {
        return Err(no_target(format!("{} dots with enough sub-images", sightings.len())));
    }
    Ok(FirstDetection { sightings, shift_mm: found.shift_mm, deeper_mm })
}

/// Adds the distance between peaks of light to the refusal of a target, if it is clearly not that of the dots.
fn with_spacing(refusal: Refusal, spacing: f64, peaks: &[DVec2]) -> Refusal {
    let Some(seen) = spacing_mm(peaks).filter(|_| peaks.len() >= FEWEST_PEAKS) else { return refusal };
    if (seen / spacing - 1.0).abs() < OTHER_SPACING {
        return refusal;
    }
    let found = format!("{}; peaks of light are {seen:.3} mm apart, and dots {spacing:.3} mm", refusal.found);
    Refusal { found, ..refusal }
}

/// Reads the sub-images of every dot where a camera and a pose of the target predict them.
pub(crate) fn detect_again(image: TargetImage, pose: &TargetPose) -> Vec<DotSighting> {
    let places = image.exposure.dots.iter().map(|dot| pose.place_mm(DVec3::from(dot.place_mm)));
    sightings(image, &places.enumerate().collect::<Vec<_>>(), 1)
}

/// Reads the sub-images of dots at known positions, and keeps the dots with at least `fewest` of them.
fn sightings(target: TargetImage, located: &[(usize, DVec3)], fewest: usize) -> Vec<DotSighting> {
    let TargetImage { exposure, number, ids, optics, .. } = target;
    let image = exposure.pixels.view();
    let places: Vec<DVec3> = located.iter().map(|(_, place)| *place).collect();
    let blur = best_blur(image, optics, target.sensor_px(), &places);
    located
        .par_iter()
        .map(|&(dot, place)| DotSighting {
            dot: ids[&exposure.dots[dot].id],
            exposure: number,
            target_mm: DVec3::from(exposure.dots[dot].place_mm),
            size_mm: blur.object_mm,
            sub_images: measure(image, optics, place, blur, NEXT_PX, false),
        })
        .filter(|sighting| sighting.sub_images.len() >= fewest)
        .collect()
}

/// The blur that gives the sub-images of points at `places` the smallest uncertainties.
fn best_blur(image: ArrayView2<f32>, optics: &Optics, sensor_px: f64, places: &[DVec3]) -> PointBlur {
    let middle = places.get(places.len() / 2).copied().unwrap_or(DVec3::Z);
    let px_per_mm = PointView::new(optics, middle).px_per_mm();
    let every = (places.len() / BLUR_DOTS).max(1);
    let some: Vec<DVec3> = places.iter().step_by(every).copied().collect();
    let blur = |blur_px: f64| PointBlur { object_mm: blur_px / px_per_mm, sensor_px };
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
