//! The spots of a target at all its depths, and the camera and pose that they are fitted by.

use crate::adjust::{Equations, Estimate, Line};
use crate::fan::{Spot, scale};
use crate::parameters::{Changes, Parameter};
use crate::sight::Sight;
use glam::{DVec2, DVec3};
use lf_core::camera::Camera;
use lf_core::optics::Optics;
use rayon::prelude::*;

/// Steps of Gauss and Newton; spots depend on every parameter almost in proportion, so a few are enough.
const STEPS: usize = 15;
/// A step below this part of every uncertainty ends a fit.
const SMALL_STEP: f64 = 0.02;
/// A step may make the median distance worse by this factor: weights change with it.
const WORSE: f64 = 1.2;
/// Times that a step is halved before a fit is given up.
const HALVINGS: usize = 8;

/// A dot of the target at one depth and its images.
#[derive(Debug, Clone)]
pub(crate) struct Sighting {
    /// Number of the dot among all dots, the same at every depth.
    pub source: usize,
    /// Number of the image.
    pub exposure: usize,
    /// Where the dot is on the target at its depth, mm.
    pub target_mm: DVec3,
    /// Its images.
    pub spots: Vec<Spot>,
}

/// What is to be fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bundle<'a> {
    pub before: &'a Camera,
    pub sightings: &'a [Sighting],
    pub sources: usize,
}

/// A fit.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub parameters: Vec<Parameter>,
    pub changes: Changes,
    pub estimate: Estimate,
    pub leftover: Leftover,
}

/// What a fit leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Leftover {
    /// Root mean square of the coordinates of the spots that have weight, px.
    pub rms_px: f64,
    /// The same by the spots' own uncertainties, px.
    pub expected_px: f64,
    /// Spots that have weight.
    pub kept: usize,
    /// All spots.
    pub spots: usize,
}

impl Bundle<'_> {
    fn spots(&self) -> usize {
        self.sightings.iter().map(|sighting| sighting.spots.len()).sum()
    }

    /// What each spot is off and how it moves with some parameters, by source.
    pub fn lines(&self, changes: &Changes, parameters: &[Parameter]) -> Vec<Vec<Line>> {
        let set = |changes: Changes| (Optics::new(&changes.camera(self.before)), changes.pose());
        let here = set(*changes);
        let beside: Vec<_> = parameters
            .iter()
            .map(|parameter| {
                let step = parameter.step(self.before);
                (step, set(changes.plus(*parameter, step)), set(changes.plus(*parameter, -step)))
            })
            .collect();
        let each: Vec<Vec<Line>> = self
            .sightings
            .par_iter()
            .map(|sighting| {
                let sight = |(optics, pose): &'_ (Optics, _)| -> Vec<DVec2> {
                    let pose: &crate::parameters::Pose = pose;
                    let sight = Sight::new(optics, pose.place_mm(sighting.target_mm));
                    sighting.spots.iter().map(|spot| sight.place_px(spot.lenslet)).collect()
                };
                let predicted = sight(&here);
                let slopes: Vec<Vec<DVec2>> = beside
                    .iter()
                    .map(|(step, up, down)| {
                        sight(up).iter().zip(sight(down)).map(|(up, down)| (*up - down) / (2.0 * step)).collect()
                    })
                    .collect();
                let line = |(n, spot): (usize, &Spot)| Line {
                    off_px: (spot.place_px - predicted[n]).to_array(),
                    uncertainty_px: spot.uncertainty_px,
                    place_px: spot.place_px.to_array(),
                    sampling_px: spot.sampling_px,
                    exposure: sighting.exposure,
                    slopes: [0, 1].map(|axis| slopes.iter().map(|slope| slope[n][axis]).collect()),
                };
                sighting.spots.iter().enumerate().map(line).collect()
            })
            .collect();
        let mut by_source = vec![Vec::new(); self.sources];
        for (sighting, lines) in self.sightings.iter().zip(each) {
            by_source[sighting.source].extend(lines);
        }
        by_source
    }

    /// The median distance of spots from where they should be, in their uncertainties.
    fn scatter(&self, changes: &Changes) -> f64 {
        scale(self.lines(changes, &[]).iter().flatten().map(distance).collect())
    }

    /// What spots are off by.
    pub fn leftover(&self, changes: &Changes) -> Leftover {
        let lines = self.lines(changes, &[]);
        let scatter = scale(lines.iter().flatten().map(distance).collect());
        let (mut squares, mut expected, mut kept) = (0.0, 0.0, 0);
        for line in lines.iter().flatten() {
            if distance(line) < crate::fan::OUTLIER * scatter {
                squares += 0.5 * (line.off_px[0].powi(2) + line.off_px[1].powi(2));
                expected += line.uncertainty_px.powi(2);
                kept += 1;
            }
        }
        let rms = |squares: f64| (squares / kept.max(1) as f64).sqrt();
        Leftover { rms_px: rms(squares), expected_px: rms(expected), kept, spots: self.spots() }
    }

    /// Fits some parameters from where they are; none where they cannot be told apart or run out of what a camera can be.
    pub fn fit(&self, parameters: &[Parameter], from: &Changes) -> Option<Fit> {
        let mut changes = *from;
        let mut scatter = self.scatter(&changes);
        for _ in 0..STEPS {
            let estimate = Equations::new(parameters, &self.lines(&changes, parameters)).solve(0.0)?;
            let (moved, next) = (0..HALVINGS).find_map(|halving| {
                let mut moved = changes;
                for (parameter, step) in parameters.iter().zip(&estimate.step) {
                    moved = moved.plus(*parameter, step * 0.5f64.powi(halving as i32));
                }
                moved.camera(self.before).check().ok()?;
                let next = self.scatter(&moved);
                (next <= WORSE * scatter + 1e-9).then_some((moved, next))
            })?;
            (changes, scatter) = (moved, next);
            let small = |n: usize| estimate.step[n].abs() <= SMALL_STEP * estimate.uncertainty(n);
            if (0..parameters.len()).all(small) {
                break;
            }
        }
        let equations = Equations::new(parameters, &self.lines(&changes, parameters));
        let estimate = equations.solve(0.0)?;
        let leftover = self.leftover(&changes);
        Some(Fit { parameters: parameters.to_vec(), changes, estimate, leftover })
    }
}

fn distance(line: &Line) -> f64 {
    line.off_px[0].hypot(line.off_px[1]) / line.uncertainty_px
}
