//! The drift of the lattice and small sensor tilts, from ordinary frames of particles. Locate isolated bright particles
//! and see how their light fills the stop. Shift and turn the lattice, and tilt the sensor, so that it fills the stop
//! evenly. Repeat with the corrected camera.

use super::disparity::{GROUPS, IsolatedParticle, equations, evident, read_particle, solve_with_stop};
use super::{isolated::isolated_particles, report::Refined, report::report, stop_fill::StopFill};
use crate::{fit::changes::Changes, fit::equations::ParameterEstimate, fit::parameter::Parameter as P};
use glam::DVec2;
use lf_core::{Camera, Optics, Refusal};
use ndarray::Array2;
use rayon::prelude::*;

/// Smallest number of particles that determines a drift.
const FEWEST_PARTICLES: usize = 20;
/// Largest standard uncertainty of the lattice's offset that is accepted, px.
const LARGEST_UNCERTAINTY_PX: f64 = 0.1;
/// Times that the camera is corrected and the particles are read again. Each leaves a tenth of the error.
const ROUNDS: usize = 6;
/// The first rounds change only the offset.
const OFFSET_ROUNDS: usize = 2;

/// The number of steps that [`refine`] reports in all: one for each frame, and the rounds.
pub fn refine_steps(frames: usize) -> u64 {
    (frames + ROUNDS) as u64
}

/// Corrects a camera by the particles of some frames between two depths. The frames have the size of the camera's
/// sensor. Calls `watch(n)` after n more of the [`refine_steps`] steps.
/// Refuses frames with too few isolated particles, and particles that are too faint.
pub fn refine(
    frames: &[Array2<f32>],
    nominal: &Camera,
    depth_mm: [f64; 2],
    watch: &dyn Fn(u64),
) -> Result<Refined, Refusal> {
    let mut particles = particles(frames, nominal, depth_mm, watch);
    let mut changes = Changes::NONE;
    let mut free: Vec<P> = GROUPS[0].to_vec();
    let unclear = || Refusal::new("particles in one place", "wanted them all over the frame");
    for round in 0..ROUNDS - 1 {
        let camera = checked_camera(&changes, nominal)?;
        let seen = read_particles(frames, &camera, &particles, watch)?;
        particles = seen.iter().map(|(particle, _)| *particle).collect();
        let equations = equations(&seen, &camera);
        if round >= OFFSET_ROUNDS {
            free = evident(&equations, &changes, &free);
        }
        let estimate = solve_with_stop(&equations, &free).ok_or_else(unclear)?;
        for (n, parameter) in free.iter().enumerate() {
            changes = changes.plus(*parameter, estimate.step[n]);
        }
        let fixed = GROUPS.iter().flat_map(|group| group.iter()).filter(|p| !free.contains(p));
        fixed.for_each(|parameter| changes.set(*parameter, 0.0));
    }
    // The last round changes nothing; it measures what is left, and the uncertainties.
    let camera = checked_camera(&changes, nominal)?;
    let seen = read_particles(frames, &camera, &particles, watch)?;
    let parameters = if free.is_empty() { GROUPS[0] } else { &free };
    let estimate = solve_with_stop(&equations(&seen, &camera), parameters).ok_or_else(unclear)?;
    let offset_px = offset_uncertainty_px(parameters, &estimate, &camera);
    check_offset(&free, offset_px, seen.len())?;
    let mut refined = report(nominal, &changes, &free, &seen, &estimate, depth_mm);
    refined.offset_uncertainty_px = offset_px;
    Ok(refined)
}

fn particles(
    frames: &[Array2<f32>],
    nominal: &Camera,
    depth_mm: [f64; 2],
    watch: &dyn Fn(u64),
) -> Vec<IsolatedParticle> {
    let optics = Optics::new(nominal);
    let half_view = DVec2::from(nominal.half_view_mm());
    let pixel_mm = nominal.sensor.pixel_pitch_mm / nominal.main_lens.magnification;
    let mut particles = Vec::new();
    for (frame, image) in frames.iter().enumerate() {
        let found = isolated_particles(image.view(), &optics, half_view, pixel_mm, depth_mm);
        particles.extend(found.into_iter().map(|place_mm| IsolatedParticle { frame, place_mm }));
        watch(1);
    }
    particles
}

/// Refuses changes that no camera can have.
fn checked_camera(changes: &Changes, nominal: &Camera) -> Result<Camera, Refusal> {
    let camera = changes.camera(nominal);
    camera.check().map_err(|refusal| Refusal::new(refusal.found, "wanted particles that leave a camera"))?;
    Ok(camera)
}

/// Reads every particle again. Refuses too few that can be read.
fn read_particles(
    frames: &[Array2<f32>],
    camera: &Camera,
    particles: &[IsolatedParticle],
    watch: &dyn Fn(u64),
) -> Result<Vec<(IsolatedParticle, StopFill)>, Refusal> {
    let optics = Optics::new(camera);
    let seen: Vec<_> = particles.par_iter().filter_map(|particle| read_particle(frames, &optics, particle)).collect();
    watch(1);
    if seen.len() < FEWEST_PARTICLES {
        let found = format!("{} isolated bright particles in {} frames", seen.len(), frames.len());
        let wanted = format!(
            "wanted {FEWEST_PARTICLES} or more, out of focus and with all their sub-images in the frame; where particles \
             overlap, lf-fit --camera-out finds the drift"
        );
        return Err(Refusal::new(found, wanted));
    }
    Ok(seen)
}

/// The larger standard uncertainty of the lattice's offset, px, if it was solved for.
fn offset_uncertainty_px(solved: &[P], estimate: &ParameterEstimate, camera: &Camera) -> Option<f64> {
    let offset = GROUPS[0].iter().filter_map(|p| solved.iter().position(|known| known == p));
    let worst = offset.map(|n| estimate.uncertainty(n)).reduce(f64::max)?;
    Some(worst / camera.sensor.pixel_pitch_mm)
}

/// Refuses a change of the offset that is not known well enough.
fn check_offset(free: &[P], uncertainty_px: Option<f64>, particles: usize) -> Result<(), Refusal> {
    let worst = uncertainty_px.filter(|_| free.contains(&GROUPS[0][0])).unwrap_or(0.0);
    if worst <= LARGEST_UNCERTAINTY_PX {
        return Ok(());
    }
    Err(Refusal::new(
        format!("{particles} particles locate the lattice to {worst:.2} px"),
        format!("wanted {LARGEST_UNCERTAINTY_PX} px or better: more or brighter particles, or lf-fit --camera-out"),
    ))
}
