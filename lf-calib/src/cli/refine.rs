//! `lf-calib refine`: frames of particles and a camera in, the camera corrected for drift out.

use super::{arguments::RefineArguments, files::frames, files::save_found};
use lf_calib::{Refined, refine_steps};
use lf_core::image::{self, FrameFiles};
use lf_core::{Camera, Error, Result, Session, Verdict, io, weights::check_depth_mm};
use std::path::Path;

pub fn refine(arguments: &RefineArguments, session: &mut Session) -> Result<Verdict> {
    let RefineArguments { camera, depth, background, mask, reading, output, .. } = arguments;
    let files = &image::frames(&arguments.frames);
    let (background, mask) = (background.as_deref(), mask.as_deref());
    let inputs: Vec<&Path> =
        files.iter().map(|file| file.as_path()).chain(background).chain(mask).chain([camera.as_path()]).collect();
    session.keep_apart(output, &inputs)?;
    io::check_place(output)?;
    let nominal = Camera::open(camera)?;
    session.explain(format!("camera: {}", nominal.about()));
    check_depths(*depth, &nominal)?;
    for (option, file) in [("--background", background), ("--mask", mask)] {
        if files.len() > 1 && file.is_some_and(io::is_standard) {
            let found = "standard input, for several frames";
            return Err(Error::new(option, found, "wanted a file, which can be read again"));
        }
    }
    let beside = FrameFiles { background, mask };
    let images = session.phase("read", |_| frames(files, beside, &nominal, camera, reading.channel))?;
    let subject = match files.as_slice() {
        [frame] => io::name(frame),
        _ => format!("{} frames", files.len()),
    };
    let found = session.phase("refine", |session| {
        let progress = session.progress("steps", refine_steps(files.len()));
        lf_calib::refine(&images, &nominal, *depth, &|steps| progress.add(steps))
            .map_err(|refusal| refusal.about(&subject))
    })?;
    report(&found, files.len(), session);
    save_found(found.camera, nominal.flat_field(camera), "wanted particles that fit one", output, session)?;
    Ok(Verdict::Done)
}

/// Refuses depths that do not rise or are not in front of the main lens.
fn check_depths([low, high]: [f64; 2], camera: &Camera) -> Result<()> {
    let wanted = "wanted two depths that rise, in front of the main lens";
    if low >= high {
        return Err(Error::new("--depth", format!("{low},{high}"), wanted));
    }
    check_depth_mm(camera, high).map_err(|refusal| Error::new("--depth", refusal.found, wanted))
}

/// Warn if the uncertainty of the lattice is larger than this, px.
const VAGUE_PX: f64 = 0.02;

fn report(found: &Refined, frames: usize, session: &mut Session) {
    session.count("frames", frames);
    session.count("particles", found.particles);
    let [before, after] = found.disparity_px;
    session.explain(format!("{} particles, disparity {before:.3} px RMS before, {after:.3} px after", found.particles));
    for (name, change, uncertainty) in &found.changed {
        session.explain(format!("{name} changed by {change:.7} +- {uncertainty:.7}"));
    }
    if found.changed.is_empty() {
        session.explain("the particles show no drift");
    }
    if let Some(offset_px) = found.offset_uncertainty_px {
        session.count("offset_std_px", offset_px);
        if offset_px > VAGUE_PX {
            session.warn(format!(
                "{} particles that overlap place the lattice to {offset_px:.2} px only; lf-fit --camera-out finds the drift \
                 from all of them",
                found.particles
            ));
        }
    }
}
