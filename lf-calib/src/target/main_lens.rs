//! The main lens, its distortion and its misalignment, from images of a dot target at known depths.
//!
//! 1. Refocus each image at its depth and recognise the dots among the peaks of light.
//! 2. Locate each dot from its sub-images, and fit the camera to all of them (bundle adjustment).
//! 3. Read the sub-images again where the fitted camera predicts them, and fit again.
//! 4. Select the parameters that the data require.
//! 5. If lengths come out far from the data sheets, do 2 to 4 again with what these say counted beside the dots. A long
//!    lens that aberrates can look like a short one; the camera near the data sheets is taken if it fits as well.

use super::bundle::{Bundle, BundleFit, BundleMisfit, DotSighting};
use super::exposure::{Exposure, numbers_by_id};
use super::first_detection::{TargetImage, detect_again, first_detections};
use super::selection::{GroupResult, ParameterGroup, select};
use super::{report::MainLensFit, report::report, warnings::far_lengths};
use crate::points::locate::{NARROWEST, nearest_depths_mm, width_in_lenslets};
use crate::{fit::changes::Changes, fit::changes::is_white_known, fit::parameter::Parameter as P};
use glam::{DVec2, DVec3};
use lf_core::{Camera, Optics, Refusal};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Smallest number of depths that separates a focus offset from a magnification.
const FEWEST_DEPTHS: usize = 2;
/// Largest number of sub-images that are fitted. More from the same dots add little.
const MOST_SUB_IMAGES: usize = 60_000;
/// Times that the sub-images are read again with the camera found.
const READINGS: usize = 2;
/// Largest root mean square residual of a fit, px.
pub(super) const LARGEST_RMS_PX: f64 = 0.3;
/// Smallest share of the sub-images that must follow the fit.
pub(super) const LEAST_FOLLOWING: f64 = 0.5;

/// Weights of the data sheets beside the dots, tried until no length comes out far from them. The error of the model
/// behind a thick lens is the same for thousands of sub-images, which count as if each had an error of its own.
const SHEET_WEIGHTS: [f64; 2] = [1.0, 10.0];
/// A camera near its data sheets explains the dots as well if its residual is larger by at most this factor. A camera
/// far from the truth makes up for a part of what the model lacks.
const AS_WELL: f64 = 1.1;

/// Always free: the pose of the target (the first six) and the magnification.
pub(super) const ALWAYS: [P; 7] =
    [P::TargetX, P::TargetY, P::FocusOffset, P::TargetLeanX, P::TargetLeanY, P::TargetTurn, P::Magnification];

/// The error of a calibration, with the number of the image that it is about, if there is one.
type ImageRefusal = (Option<usize>, Refusal);

/// The number of readings of an image that [`main_lens`] reports in all.
pub fn main_lens_steps(images: usize) -> u64 {
    ((1 + READINGS) * images) as u64
}

/// Calibrates the main lens of a camera. Calls `watch(n)` after n more of the [`main_lens_steps`] readings of an image.
/// The error holds the number of the image that it is about, if there is one.
/// Refuses fewer than two usable depths, images without the target, and dots where no camera could show them.
pub fn main_lens(
    exposures: &[Exposure],
    nominal: &Camera,
    watch: &dyn Fn(u64),
) -> Result<MainLensFit, (Option<usize>, Refusal)> {
    let search = TargetSearch { exposures, nominal, ids: numbers_by_id(exposures), watch };
    let groups = groups(nominal);
    let usable = search.usable(&Optics::new(nominal)).map_err(|refusal| (None, refusal))?;
    let (sightings, start) = search.first_detections(&usable)?;
    let (found, doubt) = search.two_ways(&sightings, &groups, &start).ok_or_else(unsolved)?;
    let FoundCamera { readings, sightings, fit, results } = found;
    let bundle = search.bundle(&sightings, 0.0);
    let misfit = fit.misfit;
    if !follows(&misfit) {
        let found =
            format!("{} of {} sub-images follow a camera, {:.2} px RMS", misfit.kept, misfit.sub_images, misfit.rms_px);
        let wanted = format!("wanted at least {:.0} %, within {LARGEST_RMS_PX} px", 100.0 * LEAST_FOLLOWING);
        return Err((None, Refusal::new(found, wanted)));
    }
    let pose_only = bundle.fit(&ALWAYS[..6], &start).map_or_else(|| bundle.misfit(&start), |posed| posed.misfit);
    let used = (0..exposures.len()).filter(|&n| !readings[n].is_empty()).collect();
    let following = bundle.following(&fit.changes, exposures.len());
    let mut against_mm: Vec<f64> =
        usable.into_iter().filter(|&n| following[n] < LEAST_FOLLOWING).map(|n| exposures[n].depth_mm()).collect();
    against_mm.sort_by(f64::total_cmp);
    let report = report(nominal, &fit, &results, pose_only, used, &sightings, exposures);
    Ok(MainLensFit { against_mm, ..report.with_doubt(doubt) })
}

/// Groups of parameters that may be free. With a white image the positions of the lenslets are known. Without one, a
/// shifted lattice readings like a traverse that moves aside, so only one of the two may be free.
fn groups(nominal: &Camera) -> Vec<ParameterGroup> {
    let one = |parameters: &'static [P], after: Option<P>| ParameterGroup {
        parameters,
        after,
        is_first: after.is_none() && !matches!(parameters[0], P::ComaGrowth | P::Index | P::Window),
    };
    let lens = &nominal.main_lens;
    let is_far = lens.pupil_vergence_per_mm.is_some() || lens.telecentric.is_some() && lens.pupil_distance_mm.is_none();
    let mut groups = vec![
        one(&[P::Gap], None),
        one(if is_far { &[P::Vergence] } else { &[P::Pupil] }, None),
        one(&[P::FocalLength], None),
        if is_white_known(nominal) { one(&[P::SkewX, P::SkewY], None) } else { one(&[P::LatticeX, P::LatticeY], None) },
        one(&[P::LatticeTurn], None),
        one(&[P::TiltX, P::TiltY], None),
        one(&[P::K1], None),
        one(&[P::K2], Some(P::K1)),
        one(&[P::K3], Some(P::K2)),
        one(&[P::P1, P::P2], None),
        one(&[P::Spherical], None),
        one(&[P::SecondarySpherical], Some(P::Spherical)),
        one(&[P::Coma], None),
        one(&[P::ComaGrowth], None),
        one(&[P::Astigmatism], None),
        one(&[P::FieldCurvature], None),
    ];
    if lens.telecentric.is_some() {
        groups.retain(|group| group.parameters != [P::FocalLength]);
    }
    if nominal.medium.is_some() {
        groups.push(one(&[P::Index], None));
        groups.push(one(&[P::Window], None));
    }
    groups
}

fn unsolved() -> ImageRefusal {
    let wanted = "wanted a target at known depths seen by this camera";
    (None, Refusal::new("no camera shows the dots where they are seen", wanted))
}

/// Whether the sub-images follow a camera.
fn follows(misfit: &BundleMisfit) -> bool {
    misfit.rms_px <= LARGEST_RMS_PX && misfit.kept_share() >= LEAST_FOLLOWING
}

/// A camera that was found, with the last reading of each image and the sub-images that were fitted.
struct FoundCamera {
    readings: Vec<Vec<DotSighting>>,
    sightings: Vec<DotSighting>,
    fit: BundleFit,
    results: Vec<GroupResult>,
}

struct TargetSearch<'a> {
    exposures: &'a [Exposure],
    nominal: &'a Camera,
    ids: BTreeMap<u64, usize>,
    watch: &'a dyn Fn(u64),
}

impl TargetSearch<'_> {
    fn bundle<'a>(&'a self, sightings: &'a [DotSighting], sheet_weight: f64) -> Bundle<'a> {
        Bundle { nominal: self.nominal, sightings, dots: self.ids.len(), sheet_weight }
    }

    /// Finds the target in every usable image. Returns the dots seen, and the start of the fit.
    fn first_detections(&self, used: &[usize]) -> Result<(Vec<DotSighting>, Changes), ImageRefusal> {
        let optics = Optics::new(self.nominal);
        let half_view = DVec2::from(self.nominal.half_view_mm());
        (self.watch)((self.exposures.len() - used.len()) as u64);
        first_detections(used.iter().map(|&n| self.image(n, &optics)), half_view, || (self.watch)(1))
    }

    fn image<'a>(&'a self, number: usize, optics: &'a Optics) -> TargetImage<'a> {
        TargetImage { exposure: &self.exposures[number], number, ids: &self.ids, optics, nominal: self.nominal }
    }

    /// Numbers of the images in which a dot lights enough lenslets, nearest to focus first: they help the others.
    fn usable(&self, optics: &Optics) -> Result<Vec<usize>, Refusal> {
        let depth_mm = |n: usize| self.exposures[n].depth_mm();
        let is_usable = |n: &usize| width_in_lenslets(optics, DVec3::new(0.0, 0.0, depth_mm(*n))) >= NARROWEST;
        let mut used: Vec<usize> = (0..self.exposures.len()).filter(is_usable).collect();
        let mut depths: Vec<f64> = used.iter().map(|&n| depth_mm(n)).collect();
        depths.sort_by(f64::total_cmp);
        depths.dedup();
        if depths.len() < FEWEST_DEPTHS {
            let found = format!("{} of {} images at depths out of focus", used.len(), self.exposures.len());
            let [away, towards] = nearest_depths_mm(optics, NARROWEST);
            let wanted = format!(
                "wanted {FEWEST_DEPTHS} depths or more beyond {away:.2} and {towards:.2} mm, where a dot lights {NARROWEST} lenslets \
                 across"
            );
            return Err(Refusal::new(found, wanted));
        }
        used.sort_by(|&a, &b| depth_mm(a).abs().total_cmp(&depth_mm(b).abs()));
        Ok(used)
    }

    /// Finds the camera by the images alone. If that one is in doubt, finds another with the data sheets, and returns
    /// it with the doubt if it explains the dots as well.
    fn two_ways(
        &self,
        sightings: &[DotSighting],
        groups: &[ParameterGroup],
        start: &Changes,
    ) -> Option<(FoundCamera, Option<String>)> {
        let alone = self.found(sightings, groups, start, 0.0);
        let doubt = |found: &FoundCamera| match far_lengths(&found.fit.changes.camera(self.nominal), self.nominal) {
            far if far.is_empty() => (!follows(&found.fit.misfit)).then(|| "the dots follow no camera".to_owned()),
            far => Some(far.join(", ")),
        };
        let depths = || self.exposures.iter().map(|exposure| exposure.depth_mm());
        let is_one_sided = depths().all(|depth| depth > 0.0) || depths().all(|depth| depth < 0.0);
        let none = if is_one_sided {
            "no camera fits (dots on one side of the focus leave much open)"
        } else {
            "no camera fits"
        };
        let Some(in_doubt) = alone.as_ref().map_or(Some(none.to_owned()), doubt) else {
            return alone.map(|alone| (alone, None));
        };
        let by_sheets = |weight: &f64| self.found(sightings, groups, start, *weight);
        let held = SHEET_WEIGHTS.iter().find_map(|weight| by_sheets(weight).filter(|held| doubt(held).is_none()));
        let as_well = |held: &FoundCamera| {
            let Some(alone) = alone.as_ref().filter(|alone| follows(&alone.fit.misfit)) else { return true };
            // Each by the sub-images as it reads them.
            let (one, other) = (alone.fit.misfit, held.fit.misfit);
            other.rms_px <= AS_WELL * one.rms_px && AS_WELL * other.kept_share() >= one.kept_share()
        };
        match held.filter(as_well) {
            Some(held) => Some((held, Some(in_doubt))),
            None => alone.map(|alone| (alone, None)),
        }
    }

    /// Finds the camera from the first reading. Where data sheets count, the parameters that they give are always free.
    fn found(
        &self,
        sightings: &[DotSighting],
        groups: &[ParameterGroup],
        start: &Changes,
        sheet_weight: f64,
    ) -> Option<FoundCamera> {
        let is_known =
            |group: &ParameterGroup| sheet_weight > 0.0 && group.parameters[0].sheet_std(self.nominal).is_some();
        let (known, groups): (Vec<_>, Vec<_>) = groups.iter().copied().partition(is_known);
        let always: Vec<P> = ALWAYS.iter().chain(known.iter().flat_map(|group| group.parameters)).copied().collect();
        let first = Self::first_fit(&self.bundle(&thinned(sightings), sheet_weight), &always, &groups, start)?;
        let (readings, changes) = self.detect_again(&first, sheet_weight)?;
        let sightings = thinned(&readings.concat());
        let (fit, results) = select(&self.bundle(&sightings, sheet_weight), &always, &groups, &changes)?;
        Some(FoundCamera { readings, sightings, fit, results })
    }

    /// Fits all parameters that are free at the start; if that fails, the ones that a selection finds.
    fn first_fit(bundle: &Bundle, always: &[P], groups: &[ParameterGroup], start: &Changes) -> Option<BundleFit> {
        let first = groups.iter().filter(|group| group.is_first).flat_map(|group| group.parameters);
        let free: Vec<P> = always.iter().chain(first).copied().collect();
        bundle.fit(&free, start).or_else(|| select(bundle, always, groups, start).map(|(fit, _)| fit))
    }

    /// Reads the sub-images where the fitted camera predicts them, and fits again, [`READINGS`] times. Images too near
    /// to focus before take part: some of their lenslets may be lit as a whole. Returns the last reading of each image.
    fn detect_again(&self, first: &BundleFit, sheet_weight: f64) -> Option<(Vec<Vec<DotSighting>>, Changes)> {
        let mut changes = first.changes;
        let mut readings = Vec::new();
        for _ in 0..READINGS {
            let (optics, pose) = (Optics::new(&changes.camera(self.nominal)), changes.pose());
            let read = |n| {
                let seen = detect_again(self.image(n, &optics), &pose);
                // The progress counts the readings of the first way only.
                if sheet_weight == 0.0 {
                    (self.watch)(1);
                }
                seen
            };
            readings = (0..self.exposures.len()).map(read).collect::<Vec<_>>();
            // All that the model lacks makes dots look larger.
            let size_mm = readings.iter().flatten().map(|sighting| sighting.size_mm).fold(f64::INFINITY, f64::min);
            readings.par_iter_mut().flatten().for_each(|sighting| sighting.make_points(&optics, &pose, size_mm));
            let sightings = thinned(&readings.concat());
            changes = self.bundle(&sightings, sheet_weight).fit(&first.parameters, &changes)?.changes;
        }
        Some((readings, changes))
    }
}

/// An even choice of each dot's sub-images, so that at most [`MOST_SUB_IMAGES`] remain in all.
fn thinned(sightings: &[DotSighting]) -> Vec<DotSighting> {
    let all: usize = sightings.iter().map(|sighting| sighting.sub_images.len()).sum();
    let every = all.div_ceil(MOST_SUB_IMAGES).max(1);
    let thin = |(n, sighting): (usize, &DotSighting)| DotSighting {
        sub_images: sighting.sub_images.iter().skip(n % every).step_by(every).copied().collect(),
        ..*sighting
    };
    sightings.iter().enumerate().map(thin).collect()
}
