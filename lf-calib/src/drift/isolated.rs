//! Isolated bright particles: peaks of an image that is refocused at one depth after another.

use crate::{points::locate::NARROWEST, points::locate::width_in_lenslets, points::refocus::refocus};
use glam::{DVec2, DVec3};
use lf_core::Optics;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Side of the cells of a refocused image, px in focus.
const CELL_PX: f64 = 5.0;
/// Between two neighbouring depths the light of a particle spreads by this many cells.
const STEP_CELLS: f64 = 2.0;
/// A peak must be the highest within this many cells, in its plane and across all depths.
const APART_CELLS: f64 = 5.0;
/// Largest number of particles of a frame.
const MOST: usize = 400;

/// A frame's brightest isolated peaks, mm. Depths that light too few lenslets to locate a point are left out.
pub(crate) fn isolated_particles(
    image: ArrayView2<f32>,
    optics: &Optics,
    half_view_mm: DVec2,
    pixel_mm: f64,
    depth_mm: [f64; 2],
) -> Vec<DVec3> {
    let cell_mm = CELL_PX * pixel_mm;
    // alpha changes by about beta / s_o for each mm of depth, and the light spreads by the stop's width times that.
    let per_mm = optics.alpha(1.0).abs() * 2.0 * optics.half_aperture_mm;
    let step = (STEP_CELLS * cell_mm / per_mm).max((depth_mm[1] - depth_mm[0]) / 400.0);
    let count = ((depth_mm[1] - depth_mm[0]) / step).ceil() as usize + 1;
    let planes: Vec<f64> = (0..count)
        .map(|n| depth_mm[0] + (depth_mm[1] - depth_mm[0]) * n as f64 / (count.max(2) - 1) as f64)
        .filter(|z| width_in_lenslets(optics, DVec3::new(0.0, 0.0, *z)) >= NARROWEST)
        .collect();
    let mut peaks: Vec<(f64, DVec3)> = planes
        .par_iter()
        .map(|&z| {
            let map = refocus(image, optics, z, half_view_mm, cell_mm);
            let peaks = map.peaks(APART_CELLS * cell_mm);
            peaks.into_iter().map(|(height, place)| (height, place.extend(z))).collect::<Vec<_>>()
        })
        .collect::<Vec<_>>()
        .concat();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<DVec3> = Vec::new();
    for (_, place) in peaks {
        if kept.len() == MOST {
            break;
        }
        let near = |other: &DVec3| other.truncate().distance(place.truncate()) < APART_CELLS * cell_mm;
        if !kept.iter().any(near) {
            kept.push(place);
        }
    }
    kept
}
