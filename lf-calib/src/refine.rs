//! The drift of the lattice and small tilts from ordinary frames of particles.

use crate::Refusal;
use crate::adjust::{Equations, Estimate, Line};
use crate::fan::{self, Glow};
use crate::isolated::isolated;
use crate::parameters::{Changes, Parameter as P};
use crate::stop::{Filling, filling};
use glam::{DVec2, DVec3};
use lf_core::camera::Camera;
use lf_core::optics::Optics;
use ndarray::Array2;
use rayon::prelude::*;
use serde_json::json;

/// Fewest particles that a drift is taken from.
pub const FEWEST_PARTICLES: usize = 20;
/// Largest standard uncertainty of the offset that is a correction, px.
const LARGEST_UNCERTAINTY_PX: f64 = 0.1;
/// How a particle's sub-images look: what blurs them beside the lenslets' cells and the pixels, px.
const GLOW: Glow = Glow { object_mm: 0.0, sensor_px: 0.3 };
/// How far a sub-image may be from where it should be at a first look, px.
const FIRST_PX: f64 = 4.0;
/// Least share of a fan that is seen: a drift of 3 px darkens a quarter of it.
const LEAST_SEEN: f64 = 0.55;
/// Largest scatter of a fan about the point it comes from, px.
const LARGEST_SCATTER_PX: f64 = 0.35;
/// Times that the camera is mended and the particles are looked at again; each leaves a tenth of what is off.
const ROUNDS: usize = 6;
/// Evidence that a change is asked for with, the square of deviations, and more for each further parameter.
const ASKED: f64 = 16.0;
const ASKED_MORE: f64 = 4.0;
/// Regions along x, y, z that a disparity is given for.
const REGIONS: [usize; 3] = [3, 3, 2];

/// What may have drifted, by groups.
const GROUPS: [&[P]; 3] = [&[P::LatticeX, P::LatticeY], &[P::LatticeTurn], &[P::TiltX, P::TiltY]];

/// A refined camera.
#[derive(Debug, Clone)]
pub struct Refined {
    /// The camera, with what was learned under `calibration.refine`.
    pub camera: Camera,
    /// Particles that were used.
    pub particles: usize,
    /// Root mean square over the particles of how far their light is from the middle of the stop, as a shift of the lenslets'
    /// images, before and after, px.
    pub disparity_px: [f64; 2],
    /// Change and standard uncertainty of what was changed, by name; empty where nothing has drifted.
    pub changed: Vec<(&'static str, f64, f64)>,
}

/// A particle of a frame.
#[derive(Debug, Clone, Copy)]
struct Particle {
    frame: usize,
    place_mm: DVec3,
}

/// Mends a camera by the particles of some frames between two depths. The frames are of the camera's size.
///
/// # Errors
/// Too few particles that stand alone, or too faint ones.
pub fn refine(frames: &[Array2<f32>], nominal: &Camera, depth_mm: [f64; 2]) -> Result<Refined, Refusal> {
    refine_watched(frames, nominal, depth_mm, &|_| ())
}

/// The steps that [`refine_watched`] counts up to: one for each frame's particles, and the rounds.
pub fn steps(frames: usize) -> u64 {
    (frames + ROUNDS) as u64
}

/// The same; calls `watch(n)` after n more steps, of [`steps`] in all.
///
/// # Errors
/// As [`refine`].
pub fn refine_watched(
    frames: &[Array2<f32>],
    nominal: &Camera,
    depth_mm: [f64; 2],
    watch: &dyn Fn(u64),
) -> Result<Refined, Refusal> {
    let optics = Optics::new(nominal);
    let half_view = DVec2::from(nominal.half_view_mm());
    let pixel_mm = nominal.sensor.pixel_pitch_mm / nominal.main_lens.magnification;
    let mut particles: Vec<Particle> = Vec::new();
    for (frame, image) in frames.iter().enumerate() {
        let found = isolated(image.view(), &optics, half_view, pixel_mm, depth_mm);
        particles.extend(found.into_iter().map(|place_mm| Particle { frame, place_mm }));
        watch(1);
    }
    let mut changes = Changes::NONE;
    let mut free: Vec<P> = GROUPS[0].to_vec();
    let mut last = None;
    for round in 0..ROUNDS {
        let camera = changes.camera(nominal);
        camera.check().map_err(|refusal| Refusal::new(refusal.found, "wanted particles that leave a camera"))?;
        let optics = Optics::new(&camera);
        let seen: Vec<(Particle, Filling)> =
            particles.par_iter().filter_map(|particle| look(frames, &optics, particle)).collect();
        watch(1);
        if seen.len() < FEWEST_PARTICLES {
            let found = format!("{} isolated bright particles in {} frames", seen.len(), frames.len());
            let wanted =
                format!("wanted {FEWEST_PARTICLES} or more, out of focus and with their whole fans in the frame");
            return Err(Refusal::new(found, wanted));
        }
        particles = seen.iter().map(|(particle, _)| *particle).collect();
        let equations = equations(&seen, &camera);
        let unclear = || Refusal::new("particles in one place", "wanted them all over the frame");
        if round + 1 < ROUNDS {
            if round >= 2 {
                free = asked(&equations, &changes, &free);
            }
            let estimate = with_stop(&equations, &free).ok_or_else(unclear)?;
            for (n, parameter) in free.iter().enumerate() {
                changes = changes.plus(*parameter, estimate.step[n]);
            }
            let dropped = GROUPS.iter().flat_map(|group| group.iter()).filter(|p| !free.contains(p));
            dropped.for_each(|parameter| changes.set(*parameter, 0.0));
            continue;
        }
        let estimate = with_stop(&equations, if free.is_empty() { GROUPS[0] } else { &free }).ok_or_else(unclear)?;
        let offset = GROUPS[0].iter().filter_map(|p| free.iter().position(|known| known == p));
        let worst = offset.map(|n| estimate.uncertainty(n)).fold(0.0, f64::max) / camera.sensor.pixel_pitch_mm;
        if worst > LARGEST_UNCERTAINTY_PX {
            let found = format!("{} particles tell the lattice's place to {worst:.2} px", seen.len());
            return Err(Refusal::new(
                found,
                format!("wanted {LARGEST_UNCERTAINTY_PX} px or better: more or brighter ones"),
            ));
        }
        last = Some((seen, estimate));
    }
    let (seen, estimate) = last.expect("the last round leaves it");
    Ok(report(nominal, &changes, &free, &seen, &estimate, depth_mm))
}

/// Locates a particle again and sees how it fills the stop.
fn look(frames: &[Array2<f32>], optics: &Optics, particle: &Particle) -> Option<(Particle, Filling)> {
    let image = frames[particle.frame].view();
    let whole = crate::sight::Sight::new(optics, particle.place_mm).fan(0.92, Some(0.0)).len();
    let spots = fan::measure(image, optics, particle.place_mm, GLOW, FIRST_PX, true);
    let (place, _) = fan::locate(optics, &spots, particle.place_mm)?;
    if fan::width(optics, place) < fan::NARROWEST {
        return None;
    }
    let spots = fan::measure(image, optics, place, GLOW, 0.5 * FIRST_PX, false);
    let (place_mm, scatter) = fan::locate(optics, &spots, place)?;
    if (spots.len() as f64) < LEAST_SEEN * whole as f64 || scatter > LARGEST_SCATTER_PX {
        return None;
    }
    let particle = Particle { place_mm, ..*particle };
    filling(image, optics, place_mm, GLOW).map(|filling| (particle, filling))
}

/// Shift of the lenslets' images that would bring a particle's light to the middle of the stop, px.
fn disparity_px(filling: &Filling, camera: &Camera) -> DVec2 {
    -camera.demagnification() * filling.middle_mm / camera.sensor.pixel_pitch_mm
}

/// Equations of what may have drifted, and, as [`P::Gap`], of the stop's size: f-numbers are not known well enough for that to
/// say something of the gap.
fn equations(seen: &[(Particle, Filling)], camera: &Camera) -> Equations {
    let columns = [P::LatticeX, P::LatticeY, P::LatticeTurn, P::TiltX, P::TiltY, P::Gap];
    let (px, gap) = (1.0 / camera.sensor.pixel_pitch_mm, camera.gap_mm());
    let shifts: Vec<DVec2> = seen.iter().map(|(_, filling)| disparity_px(filling, camera)).collect();
    let median = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let middle = DVec2::new(median(shifts.iter().map(|s| s.x).collect()), median(shifts.iter().map(|s| s.y).collect()));
    let scatter = fan::scale(shifts.iter().map(|shift| shift.distance(middle)).collect()).max(1e-3);
    let logs: Vec<f64> = seen.iter().map(|(_, filling)| filling.spread.ln()).collect();
    let size = median(logs.clone());
    let unsure = (1.4826 * median(logs.iter().map(|log| (log - size).abs()).collect())).max(1e-3);
    let lines = seen.iter().zip(&shifts).map(|((_, filling), shift)| {
        let e = filling.image_mm;
        let line = |off_px, uncertainty_px, slopes| Line {
            off_px,
            uncertainty_px,
            place_px: [0.0; 2],
            sampling_px: 0.0,
            exposure: 0,
            slopes,
        };
        vec![
            line(
                shift.to_array(),
                scatter,
                [vec![px, 0.0, -e.y * px, 0.0, 0.0, 0.0], vec![0.0, px, e.x * px, 0.0, 0.0, 0.0]],
            ),
            line(
                [filling.spread.ln(), 0.0],
                unsure,
                [vec![0.0, 0.0, 0.0, e.x / gap, e.y / gap, 1.0 / gap], vec![0.0; 6]],
            ),
        ]
    });
    Equations::new(&columns, &lines.collect::<Vec<_>>())
}

/// Solves for some parameters and the stop's size, which comes last.
fn with_stop(equations: &Equations, parameters: &[P]) -> Option<Estimate> {
    let columns: Vec<P> = parameters.iter().copied().chain([P::Gap]).collect();
    equations.of(&columns).solve(0.0)
}

/// The groups whose change so far and to come is clearly seen beside the others that are.
fn asked(equations: &Equations, changes: &Changes, free: &[P]) -> Vec<P> {
    let clear = |group: &&&[P]| {
        let others = free.iter().filter(|p| !group.contains(p));
        let all: Vec<P> = group.iter().chain(others).copied().collect();
        let Some(estimate) = with_stop(equations, &all) else { return false };
        let places: Vec<usize> = (0..group.len()).collect();
        let values: Vec<f64> = places.iter().map(|&n| changes.get(group[n]) + estimate.step[n]).collect();
        estimate.evidence(&places, &values) >= ASKED + ASKED_MORE * (group.len() - 1) as f64
    };
    GROUPS.iter().filter(clear).flat_map(|group| group.iter().copied()).collect()
}

fn report(
    nominal: &Camera,
    changes: &Changes,
    free: &[P],
    seen: &[(Particle, Filling)],
    estimate: &Estimate,
    depth_mm: [f64; 2],
) -> Refined {
    let mut camera = changes.camera(nominal);
    // What is left, and what has been taken away at each particle.
    let taken = |e: DVec2| {
        let shift = DVec2::new(changes.get(P::LatticeX), changes.get(P::LatticeY));
        (shift + changes.get(P::LatticeTurn) * e.perp()) / camera.sensor.pixel_pitch_mm
    };
    let after: Vec<DVec2> = seen.iter().map(|(_, filling)| disparity_px(filling, &camera)).collect();
    let before: Vec<DVec2> =
        seen.iter().zip(&after).map(|((_, filling), left)| *left + taken(filling.image_mm)).collect();
    let rms = |all: &[DVec2]| (all.iter().map(|d| d.length_squared()).sum::<f64>() / all.len() as f64).sqrt();
    let half = DVec2::from(nominal.half_view_mm());
    let region = |place: DVec3| -> [usize; 3] {
        let part = |at: f64, [low, high]: [f64; 2], count: usize| {
            (((at - low) / (high - low) * count as f64).max(0.0) as usize).min(count - 1)
        };
        [
            part(place.x, [-half.x, half.x], REGIONS[0]),
            part(place.y, [-half.y, half.y], REGIONS[1]),
            part(place.z, depth_mm, REGIONS[2]),
        ]
    };
    let mut regions = Vec::new();
    for number in 0..REGIONS.iter().product() {
        let here = [number % REGIONS[0], number / REGIONS[0] % REGIONS[1], number / (REGIONS[0] * REGIONS[1])];
        let inside: Vec<usize> = (0..seen.len()).filter(|&n| region(seen[n].0.place_mm) == here).collect();
        let mean = |all: &[DVec2]| {
            let sum: DVec2 = inside.iter().map(|&n| all[n]).sum();
            (sum / inside.len() as f64).to_array()
        };
        if !inside.is_empty() {
            let [before, after] = [mean(&before), mean(&after)];
            regions.push(json!({
                "region": here, "particles": inside.len(), "disparity_before_px": before, "disparity_px": after
            }));
        }
    }
    let changed: Vec<(&'static str, f64, f64)> = free
        .iter()
        .enumerate()
        .map(|(n, parameter)| (parameter.name(), changes.get(*parameter), estimate.uncertainty(n)))
        .collect();
    let disparity_px = [rms(&before), rms(&after)];
    let found = json!({
        "particles": seen.len(),
        "disparity_rms_before_px": disparity_px[0],
        "disparity_rms_px": disparity_px[1],
        "changes": changed.iter().map(|(name, change, uncertainty)| {
            json!({"parameter": name, "change": change, "standard_uncertainty": uncertainty})
        }).collect::<Vec<_>>(),
        "regions": regions,
    });
    let calibration = camera.calibration.get_or_insert_with(|| json!({}));
    if !calibration.is_object() {
        *calibration = json!({});
    }
    calibration["refine"] = found;
    Refined { camera, particles: seen.len(), disparity_px, changed }
}
