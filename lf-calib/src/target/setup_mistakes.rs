//! Finds the mistake in the stated setup that explains images which do not fit: other depths, another spacing, a
//! liquid, a target that was turned or mirrored.
//!
//! Each mistake is undone in turn on two images, the usable ones nearest to focus on either side. Only the pose of the
//! target and the magnification are free, so that a gap or a focal length cannot hide what is wrong.

use super::bundle::{Bundle, DotSighting};
use super::exposure::{Dot, Exposure, numbers_by_id};
use super::first_detection::{TargetImage, first_detections};
use super::main_lens::{ALWAYS, LARGEST_RMS_PX, LEAST_FOLLOWING};
use super::recognise::spacing_mm;
use crate::points::locate::{NARROWEST, width_in_lenslets};
use crate::points::{sub_images::SHARE, view::PointView};
use glam::{DVec2, DVec3};
use lf_core::{Camera, Optics, Refusal};

/// Index of water.
const WATER: f64 = 1.333;
/// Factors by which people err in depths and spacings: halves and doubles, diagonals, inches.
const DEPTH_FACTORS: [f64; 4] = [1.0 / WATER, WATER, 0.5, 2.0];
const SPACING_FACTORS: [f64; 6] =
    [0.5, 2.0, std::f64::consts::SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 25.4, 1.0 / 25.4];
/// A mistake is believed if it leaves at most this share of the residual of what was stated.
const BETTER: f64 = 0.5;
/// Dots from the middle that are looked for, in spacings.
const FARTHEST: f64 = 4.5;
/// Largest number of lenslets across that a dot may light. Beyond, sub-images are many and dim, and take long to read.
const WIDEST: f64 = 40.0;
/// Largest depth that is tried, as a share of the distance to the main lens.
const DEEPEST: f64 = 0.5;

/// A mistake that may have been made.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mistake {
    None,
    Sign,
    Depths(f64),
    Spacing(f64),
    Mirrored,
    /// Quarter turns.
    Turned(u8),
}

impl Mistake {
    /// The place of a dot if the mistake is undone.
    fn undone(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::None => [x, y, z],
            Self::Sign => [x, y, -z],
            Self::Depths(factor) => [x, y, factor * z],
            Self::Spacing(factor) => [factor * x, factor * y, z],
            Self::Mirrored => [-x, y, z],
            Self::Turned(1) => [-y, x, z],
            Self::Turned(2) => [-x, -y, z],
            Self::Turned(_) => [y, -x, z],
        }
    }

    /// The mistake and its remedy as a message. The dots are stated to be `spacing` mm apart.
    fn message(self, rms_px: f64, spacing: f64) -> Refusal {
        let fits = |how: String| format!("it fits {how}, within {rms_px:.2} px, and not as stated");
        match self {
            Self::Sign | Self::None => Refusal::new(
                fits("with depths of the other sign".to_owned()),
                "wanted depths that grow towards the camera",
            ),
            Self::Depths(factor) if factor == 1.0 / WATER => Refusal::new(
                fits(format!("with depths of {factor:.2} times those stated, as behind water")),
                "wanted a camera for water by lf-calib nominal --water, or smaller depths",
            ),
            Self::Depths(factor) if factor == WATER => Refusal::new(
                fits(format!("with depths of {factor:.2} times those stated, as a camera for water in air")),
                "wanted a target in the water, a camera for air, or larger depths",
            ),
            Self::Depths(factor) => Refusal::new(
                fits(format!("with depths of {factor:.4} times those stated")),
                "wanted depths in mm, from the plane in focus",
            ),
            Self::Spacing(factor) => Refusal::new(
                fits(format!("with dots {:.4} mm apart", factor * spacing)),
                format!("wanted the distance from a dot to its neighbour in mm, and not {spacing:.4}"),
            ),
            Self::Mirrored => Refusal::new(
                fits("as its mirror image".to_owned()),
                "wanted x of the table to the right and y upwards, as the camera sees the target",
            ),
            Self::Turned(quarters) => Refusal::new(
                fits(format!("turned by {} degrees", 90 * u32::from(quarters))),
                "wanted x of the table to the right and y upwards, as the camera sees the target",
            ),
        }
    }
}

/// The mistake that explains images of a target which do not fit, or fit badly, as stated. None if nothing fits better.
pub fn setup_mistake(exposures: &[Exposure], nominal: &Camera) -> Option<Refusal> {
    let spacing = exposures.iter().find_map(|exposure| spacing_mm(&exposure.flat_mm()))?;
    let depths = DEPTH_FACTORS.map(Mistake::Depths);
    let spacings = SPACING_FACTORS.map(Mistake::Spacing);
    let others = [Mistake::Sign, Mistake::Mirrored, Mistake::Turned(1), Mistake::Turned(2), Mistake::Turned(3)];
    let mistakes = others.into_iter().chain(depths).chain(spacings);
    let stated = residual(exposures, nominal, Mistake::None).unwrap_or(f64::INFINITY);
    let judged = mistakes.filter_map(|mistake| Some((residual(exposures, nominal, mistake)?, mistake)));
    let (rms_px, mistake) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (rms_px < BETTER * stated).then(|| mistake.message(rms_px, spacing))
}

/// Residual, px, of two images if a mistake is undone. None if they do not show the target then.
fn residual(exposures: &[Exposure], nominal: &Camera, mistake: Mistake) -> Option<f64> {
    let optics = Optics::new(nominal);
    let depth = |n: usize| mistake.undone([0.0, 0.0, exposures[n].depth_mm()])[2];
    let farthest = DEEPEST * nominal.object_distance_mm();
    let is_usable = |n: &usize| {
        let z = depth(*n);
        z.abs() < farthest && (NARROWEST..=WIDEST).contains(&width_in_lenslets(&optics, DVec3::new(0.0, 0.0, z)))
    };
    let mut usable: Vec<usize> = (0..exposures.len()).filter(is_usable).collect();
    usable.sort_by(|&a, &b| depth(a).abs().total_cmp(&depth(b).abs()));
    let first = *usable.first()?;
    let beyond = usable.iter().find(|&&n| depth(n).signum() != depth(first).signum());
    let second = *beyond.or_else(|| usable.iter().find(|&&n| depth(n) != depth(first)))?;
    let undone = [first, second].map(|n| {
        let place = |dot: &Dot| Dot { id: dot.id, place_mm: mistake.undone(dot.place_mm) };
        Exposure { pixels: exposures[n].pixels.clone(), dots: exposures[n].dots.iter().map(place).collect() }
    });
    fit(&undone, nominal, &optics)
}

/// Root mean square residual, px, of images with only the pose of the target and the magnification free.
fn fit(exposures: &[Exposure], nominal: &Camera, optics: &Optics) -> Option<f64> {
    let ids = numbers_by_id(exposures);
    let spacing = spacing_mm(&exposures[0].flat_mm())?;
    let view = DVec2::from(nominal.half_view_mm()).min(DVec2::splat(FARTHEST * spacing));
    let images = exposures.iter().enumerate();
    let images = images.map(|(number, exposure)| TargetImage { exposure, number, ids: &ids, optics, nominal });
    let (sightings, start) = first_detections(images, view, || ()).ok()?;
    let bundle = Bundle { nominal, sightings: &sightings, dots: ids.len(), sheet_weight: 0.0 };
    let misfit = bundle.fit(&ALWAYS, &start)?.misfit;
    // A regular grid at a wrong depth has some sub-images where another dot's should be: too few.
    let lit = |sighting: &DotSighting| PointView::new(optics, sighting.target_mm).lit_lenslets(SHARE, 0.0).len();
    let wanted = sightings.iter().map(lit).sum::<usize>().max(misfit.sub_images);
    let follows = misfit.kept as f64 >= LEAST_FOLLOWING * wanted as f64;
    (follows && misfit.rms_px <= LARGEST_RMS_PX).then_some(misfit.rms_px)
}
