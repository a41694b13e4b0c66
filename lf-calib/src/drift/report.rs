//! The result of a refinement, and its record in the camera.

use super::{disparity::IsolatedParticle, disparity::disparity_px, stop_fill::StopFill};
use crate::fit::changes::{Changes, record};
use crate::{fit::equations::ParameterEstimate, fit::parameter::Parameter as P};
use glam::{DVec2, DVec3};
use lf_core::Camera;
use serde_json::{Value, json};

/// Regions along x, y and z that a mean disparity is reported for.
const REGIONS: [usize; 3] = [3, 3, 2];

/// A refined camera.
#[derive(Debug, Clone)]
pub struct Refined {
    /// `calibration.refine` holds what was measured.
    pub camera: Camera,
    /// Number of particles used.
    pub particles: usize,
    /// Root mean square disparity before and after, px: how far particles' light is from the stop's middle.
    pub disparity_px: [f64; 2],
    /// Standard uncertainty of the lattice's offset, px, if it was solved for.
    pub offset_uncertainty_px: Option<f64>,
    /// Name, change and standard uncertainty of each changed parameter. Empty if nothing has drifted.
    pub changed: Vec<(&'static str, f64, f64)>,
}

/// Reports a refinement: as a value, and under `calibration.refine` of the camera.
pub(crate) fn report(
    nominal: &Camera,
    changes: &Changes,
    free: &[P],
    seen: &[(IsolatedParticle, StopFill)],
    estimate: &ParameterEstimate,
    depth_mm: [f64; 2],
) -> Refined {
    let mut camera = changes.camera(nominal);
    // The disparity before is what is left, plus what the changes have removed at each particle.
    let removed = |image_mm: DVec2| {
        let shift = DVec2::new(changes.get(P::LatticeX), changes.get(P::LatticeY));
        (shift + changes.get(P::LatticeTurn) * image_mm.perp()) / camera.sensor.pixel_pitch_mm
    };
    let after: Vec<DVec2> = seen.iter().map(|(_, fill)| disparity_px(fill, &camera)).collect();
    let before: Vec<DVec2> = seen.iter().zip(&after).map(|((_, fill), left)| *left + removed(fill.image_mm)).collect();
    let rms = |all: &[DVec2]| (all.iter().map(|d| d.length_squared()).sum::<f64>() / all.len() as f64).sqrt();
    let disparity_px = [rms(&before), rms(&after)];
    let change = |(n, p): (usize, &P)| (p.name(), changes.get(*p), estimate.uncertainty(n));
    let changed: Vec<(&'static str, f64, f64)> = free.iter().enumerate().map(change).collect();
    let half = DVec2::from(nominal.half_view_mm());
    let bounds = [[-half.x, half.x], [-half.y, half.y], depth_mm];
    let places: Vec<DVec3> = seen.iter().map(|(particle, _)| particle.place_mm).collect();
    let found = json!({
        "particles": seen.len(),
        "disparity_rms_before_px": disparity_px[0],
        "disparity_rms_px": disparity_px[1],
        "changes": changed.iter().map(|(name, change, uncertainty)| {
            json!({"parameter": name, "change": change, "standard_uncertainty": uncertainty})
        }).collect::<Vec<_>>(),
        "regions": regions(&places, &before, &after, bounds),
    });
    record(&mut camera, "refine", found);
    Refined { camera, particles: seen.len(), disparity_px, offset_uncertainty_px: None, changed }
}

/// Mean disparities before and after in each region of the volume that holds particles.
fn regions(places: &[DVec3], before: &[DVec2], after: &[DVec2], bounds: [[f64; 2]; 3]) -> Vec<Value> {
    let region = |place: DVec3| -> [usize; 3] {
        std::array::from_fn(|axis| {
            let ([low, high], count) = (bounds[axis], REGIONS[axis]);
            (((place[axis] - low) / (high - low) * count as f64).max(0.0) as usize).min(count - 1)
        })
    };
    let mut regions = Vec::new();
    for number in 0..REGIONS.iter().product() {
        let here = [number % REGIONS[0], number / REGIONS[0] % REGIONS[1], number / (REGIONS[0] * REGIONS[1])];
        let inside: Vec<usize> = (0..places.len()).filter(|&n| region(places[n]) == here).collect();
        let mean = |all: &[DVec2]| {
            let sum: DVec2 = inside.iter().map(|&n| all[n]).sum();
            (sum / inside.len() as f64).to_array()
        };
        if !inside.is_empty() {
            let [before, after] = [mean(before), mean(after)];
            regions.push(json!({
                "region": here, "particles": inside.len(), "disparity_before_px": before, "disparity_px": after
            }));
        }
    }
    regions
}
