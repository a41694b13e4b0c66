//! Bundle adjustment: the sub-images of a target at all its depths, and the camera and pose that fit them.

use crate::fit::changes::{Changes, TargetPose};
use crate::fit::equations::{NormalEquations, Observation, ParameterEstimate};
use crate::fit::robust::{OUTLIER, deviation};
use crate::{fit::parameter::Parameter, points::sub_images::SubImage, points::view::PointView};
use glam::{DVec2, DVec3};
use lf_core::{Camera, Optics};
use rayon::prelude::*;

/// Gauss-Newton steps at most. Sub-images move almost in proportion to every parameter, so a few steps are enough.
const STEPS: usize = 15;
/// A fit ends when every step is smaller than this fraction of the parameter's uncertainty.
const SMALL_STEP: f64 = 0.02;
/// Factor by which a step may increase the median distance, because the weights change with the step.
const WORSE: f64 = 1.2;
/// Times that a step is halved before the fit fails.
const HALVINGS: usize = 8;

/// A dot of the target at one depth, and its sub-images.
#[derive(Clone)]
pub(crate) struct DotSighting {
    /// Number of the dot among all dots, the same at every depth.
    pub dot: usize,
    pub exposure: usize,
    pub target_mm: DVec3,
    /// Size of the dots as this exposure shows them, a standard deviation, mm.
    pub size_mm: f64,
    pub sub_images: Vec<SubImage>,
}

impl DotSighting {
    /// Moves the sub-images of a dot of this size to where a point would show them.
    pub fn make_points(&mut self, optics: &Optics, pose: &TargetPose, size_mm: f64) {
        let view = PointView::new(optics, pose.place_mm(self.target_mm));
        self.sub_images.iter_mut().for_each(|seen| seen.place_px -= view.shift_px(seen.lenslet, size_mm));
    }
}

pub(crate) struct Bundle<'a> {
    pub nominal: &'a Camera,
    pub sightings: &'a [DotSighting],
    pub dots: usize,
    /// How much the lengths of the data sheets count beside the sub-images; 0 for not at all.
    pub sheet_weight: f64,
}

pub(crate) struct BundleFit {
    pub parameters: Vec<Parameter>,
    pub changes: Changes,
    pub estimate: ParameterEstimate,
    pub misfit: BundleMisfit,
}

#[derive(Clone, Copy)]
pub(crate) struct BundleMisfit {
    /// Root mean square of a coordinate of the sub-images that have weight, px.
    pub rms_px: f64,
    /// The RMS expected from the sub-images' own uncertainties, px.
    pub expected_px: f64,
    /// Sub-images that have weight.
    pub kept: usize,
    pub sub_images: usize,
}

impl BundleMisfit {
    pub fn kept_share(&self) -> f64 {
        self.kept as f64 / self.sub_images.max(1) as f64
    }
}

type Setting = (Optics, TargetPose);

impl Bundle<'_> {
    /// Residual and derivatives of every sub-image, for each dot.
    pub fn observations(&self, changes: &Changes, parameters: &[Parameter]) -> Vec<Vec<Observation>> {
        let setting = |changes: Changes| (Optics::new(&changes.camera(self.nominal)), changes.pose());
        let here = setting(*changes);
        let beside: Vec<(f64, Setting, Setting)> = parameters
            .iter()
            .map(|parameter| {
                let step = parameter.step(self.nominal);
                (step, setting(changes.plus(*parameter, step)), setting(changes.plus(*parameter, -step)))
            })
            .collect();
        let each: Vec<Vec<Observation>> =
            self.sightings.par_iter().map(|sighting| observe(sighting, &here, &beside)).collect();
        let mut by_dot = vec![Vec::new(); self.dots];
        for (sighting, observations) in self.sightings.iter().zip(each) {
            by_dot[sighting.dot].extend(observations);
        }
        by_dot
    }

    /// Normal equations at given changes. They include the data sheets if these count.
    pub fn equations(&self, changes: &Changes, parameters: &[Parameter]) -> NormalEquations {
        let equations = NormalEquations::new(parameters, &self.observations(changes, parameters));
        let std = |parameter: Parameter| Some(parameter.sheet_std(self.nominal)? / self.sheet_weight.sqrt());
        equations.with_prior(|parameter| Some((-changes.get(parameter), std(parameter)?)))
    }

    /// Median distance of the sub-images from their predictions, in their uncertainties, as a standard deviation.
    fn scatter(&self, changes: &Changes) -> f64 {
        deviation(self.observations(changes, &[]).iter().flatten().map(distance).collect())
    }

    /// The sub-images, and whether each has weight.
    fn weighed(&self, changes: &Changes) -> impl Iterator<Item = (Observation, bool)> {
        let observations = self.observations(changes, &[]).concat();
        let limit = OUTLIER * deviation(observations.iter().map(distance).collect());
        observations.into_iter().map(move |observation| {
            let has_weight = distance(&observation) < limit;
            (observation, has_weight)
        })
    }

    pub fn misfit(&self, changes: &Changes) -> BundleMisfit {
        let (mut squares, mut expected, mut kept) = (0.0, 0.0, 0);
        for (observation, _) in self.weighed(changes).filter(|(_, has_weight)| *has_weight) {
            squares += 0.5 * (observation.off_px[0].powi(2) + observation.off_px[1].powi(2));
            expected += observation.uncertainty_px.powi(2);
            kept += 1;
        }
        let rms = |squares: f64| (squares / kept.max(1) as f64).sqrt();
        let sub_images = self.sightings.iter().map(|sighting| sighting.sub_images.len()).sum();
        BundleMisfit { rms_px: rms(squares), expected_px: rms(expected), kept, sub_images }
    }

    /// For each of some images, the share of its sub-images that have weight; 0 for one without any.
    pub fn following(&self, changes: &Changes, exposures: usize) -> Vec<f64> {
        let mut counts = vec![[0.0; 2]; exposures];
        for (observation, has_weight) in self.weighed(changes) {
            let [kept, all] = &mut counts[observation.exposure];
            *kept += f64::from(u8::from(has_weight));
            *all += 1.0;
        }
        counts.into_iter().map(|[kept, all]| kept / all.max(1.0)).collect()
    }

    /// Fits some parameters, from given changes. None if they cannot be separated or leave the range of a camera.
    pub fn fit(&self, parameters: &[Parameter], from: &Changes) -> Option<BundleFit> {
        let mut changes = *from;
        let mut scatter = self.scatter(&changes);
        for _ in 0..STEPS {
            let estimate = self.equations(&changes, parameters).solve()?;
            let (moved, next) = (0..HALVINGS).find_map(|halving| {
                let mut moved = changes;
                for (parameter, step) in parameters.iter().zip(&estimate.step) {
                    moved = moved.plus(*parameter, step * 0.5f64.powi(halving as i32));
                }
                moved.camera(self.nominal).check().ok()?;
                let next = self.scatter(&moved);
                (next <= WORSE * scatter + 1e-9).then_some((moved, next))
            })?;
            (changes, scatter) = (moved, next);
            let small = |n: usize| estimate.step[n].abs() <= SMALL_STEP * estimate.uncertainty(n);
            if (0..parameters.len()).all(small) {
                break;
            }
        }
        let equations = self.equations(&changes, parameters);
        let estimate = equations.solve()?;
        let misfit = self.misfit(&changes);
        Some(BundleFit { parameters: parameters.to_vec(), changes, estimate, misfit })
    }
}

/// The observations of one dot. `beside` holds the steps of the parameters and the settings on either side.
fn observe(sighting: &DotSighting, here: &Setting, beside: &[(f64, Setting, Setting)]) -> Vec<Observation> {
    let predict = |(optics, pose): &Setting| -> Vec<DVec2> {
        let view = PointView::new(optics, pose.place_mm(sighting.target_mm));
        sighting.sub_images.iter().map(|sub_image| view.place_px(sub_image.lenslet)).collect()
    };
    let predicted = predict(here);
    let slopes: Vec<Vec<DVec2>> = beside
        .iter()
        .map(|(step, up, down)| {
            predict(up).iter().zip(predict(down)).map(|(up, down)| (*up - down) / (2.0 * step)).collect()
        })
        .collect();
    let observation = |(n, sub_image): (usize, &SubImage)| Observation {
        off_px: (sub_image.place_px - predicted[n]).to_array(),
        uncertainty_px: sub_image.uncertainty_px,
        place_px: sub_image.place_px.to_array(),
        sampling_px: sub_image.sampling_px,
        exposure: sighting.exposure,
        slopes: [0, 1].map(|axis| slopes.iter().map(|slope| slope[n][axis]).collect()),
    };
    sighting.sub_images.iter().enumerate().map(observation).collect()
}

/// Distance of a sub-image from its prediction, in its uncertainty.
fn distance(observation: &Observation) -> f64 {
    observation.off_px[0].hypot(observation.off_px[1]) / observation.uncertainty_px
}
