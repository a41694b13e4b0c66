//! Measures how far the light of particles is from the middle of the stop, and sets up the equations for the drift that
//! explains it.

use super::stop_fill::{StopFill, stop_fill};
use crate::fit::equations::{NormalEquations, Observation, ParameterEstimate};
use crate::points::locate::{NARROWEST, locate, width_in_lenslets};
use crate::points::sub_images::{PointBlur, SHARE, measure};
use crate::{fit::changes::Changes, fit::parameter::Parameter as P, fit::robust::deviation, points::view::PointView};
use glam::{DVec2, DVec3};
use lf_core::statistics::{NORMAL_PER_MAD, upper_median};
use lf_core::{Camera, Optics};
use ndarray::Array2;

/// Blur of the sub-images of a particle, beside that by the lenslets' cells and the pixels, px.
const BLUR: PointBlur = PointBlur { object_mm: 0.0, sensor_px: 0.3 };
/// Largest distance of a sub-image from its prediction in the first reading, px.
const FIRST_PX: f64 = 4.0;
/// Smallest share of a particle's sub-images that are seen. A drift of 3 px darkens a quarter of them.
const LEAST_SEEN: f64 = 0.55;
/// Largest scatter of the sub-images about the point that they come from, px.
const LARGEST_SCATTER_PX: f64 = 0.35;
/// Evidence that a change needs, in squared standard deviations, and the addition for each further parameter.
const NEEDED: f64 = 16.0;
const NEEDED_MORE: f64 = 4.0;

/// Parameters that may have drifted. Those of a group are free or fixed together.
pub(crate) const GROUPS: [&[P]; 3] = [&[P::LatticeX, P::LatticeY], &[P::LatticeTurn], &[P::TiltX, P::TiltY]];

#[derive(Clone, Copy)]
pub(crate) struct IsolatedParticle {
    pub frame: usize,
    pub place_mm: DVec3,
}

/// Locates a particle again and reads how it fills the stop. None if it cannot be read well.
pub(crate) fn read_particle(
    frames: &[Array2<f32>],
    optics: &Optics,
    particle: &IsolatedParticle,
) -> Option<(IsolatedParticle, StopFill)> {
    let image = frames[particle.frame].view();
    let expected = PointView::new(optics, particle.place_mm).lit_lenslets(SHARE, Some(0.0)).len();
    let sub_images = measure(image, optics, particle.place_mm, BLUR, FIRST_PX, true);
    let (place, _) = locate(optics, &sub_images, particle.place_mm)?;
    if width_in_lenslets(optics, place) < NARROWEST {
        return None;
    }
    let sub_images = measure(image, optics, place, BLUR, 0.5 * FIRST_PX, false);
    let (place_mm, scatter) = locate(optics, &sub_images, place)?;
    if (sub_images.len() as f64) < LEAST_SEEN * expected as f64 || scatter > LARGEST_SCATTER_PX {
        return None;
    }
    let particle = IsolatedParticle { place_mm, ..*particle };
    stop_fill(image, optics, place_mm, BLUR).map(|fill| (particle, fill))
}

/// Shift of the lenslet images that would bring a particle's light to the middle of the stop, px.
pub(crate) fn disparity_px(fill: &StopFill, camera: &Camera) -> DVec2 {
    -camera.demagnification() * fill.middle_mm / camera.sensor.pixel_pitch_mm
}

/// Equations for [`GROUPS`], and for the stop's size in the column of [`P::Gap`]: f-numbers are too vague for the gap.
pub(crate) fn equations(seen: &[(IsolatedParticle, StopFill)], camera: &Camera) -> NormalEquations {
    let columns = [P::LatticeX, P::LatticeY, P::LatticeTurn, P::TiltX, P::TiltY, P::Gap];
    let (px, gap) = (1.0 / camera.sensor.pixel_pitch_mm, camera.gap_mm());
    let shifts: Vec<DVec2> = seen.iter().map(|(_, fill)| disparity_px(fill, camera)).collect();
    let median = |mut all: Vec<f64>| upper_median(&mut all).unwrap_or(f64::NAN);
    let middle = DVec2::new(median(shifts.iter().map(|s| s.x).collect()), median(shifts.iter().map(|s| s.y).collect()));
    let scatter = deviation(shifts.iter().map(|shift| shift.distance(middle)).collect()).max(1e-3);
    let logs: Vec<f64> = seen.iter().map(|(_, fill)| fill.spread.ln()).collect();
    let size = median(logs.clone());
    let size_scatter = (NORMAL_PER_MAD * median(logs.iter().map(|log| (log - size).abs()).collect())).max(1e-3);
    let observation =
        |off_px, uncertainty_px, slopes| Observation { off_px, uncertainty_px, slopes, ..Default::default() };
    let observe = |(fill, shift): (&StopFill, &DVec2)| {
        let e = fill.image_mm;
        let shift_slopes = [vec![px, 0.0, -e.y * px, 0.0, 0.0, 0.0], vec![0.0, px, e.x * px, 0.0, 0.0, 0.0]];
        let size_slopes = [vec![0.0, 0.0, 0.0, e.x / gap, e.y / gap, 1.0 / gap], vec![0.0; 6]];
        vec![
            observation(shift.to_array(), scatter, shift_slopes),
            observation([fill.spread.ln(), 0.0], size_scatter, size_slopes),
        ]
    };
    let sources: Vec<Vec<Observation>> = seen.iter().map(|(_, fill)| fill).zip(&shifts).map(observe).collect();
    NormalEquations::new(&columns, &sources)
}

/// Solves for some parameters and, in the last column, for the size of the stop.
pub(crate) fn solve_with_stop(equations: &NormalEquations, parameters: &[P]) -> Option<ParameterEstimate> {
    let columns: Vec<P> = parameters.iter().copied().chain([P::Gap]).collect();
    equations.columns(&columns).solve()
}

/// The groups with clear evidence for their whole change, so far and to come, beside the other free parameters.
pub(crate) fn evident(equations: &NormalEquations, changes: &Changes, free: &[P]) -> Vec<P> {
    let is_evident = |group: &&&[P]| {
        let others = free.iter().filter(|p| !group.contains(p));
        let all: Vec<P> = group.iter().chain(others).copied().collect();
        let Some(estimate) = solve_with_stop(equations, &all) else { return false };
        let columns: Vec<usize> = (0..group.len()).collect();
        let values: Vec<f64> = columns.iter().map(|&n| changes.get(group[n]) + estimate.step[n]).collect();
        estimate.evidence(&columns, &values) >= NEEDED + NEEDED_MORE * (group.len() - 1) as f64
    };
    GROUPS.iter().filter(is_evident).flat_map(|group| group.iter().copied()).collect()
}
