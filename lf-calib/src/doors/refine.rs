//! `lf-calib refine`.

use super::save_found;
use lf_calib::{refine_watched, steps};
use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict};
use lf_core::weights::check_depth_mm;
use lf_core::{Error, Result, io};
use std::path::{Path, PathBuf};

/// Frames of particles and a camera in, the camera without its drift out.
pub fn drift(
    frames: &[PathBuf],
    camera: &Path,
    background: Option<&Path>,
    depth_mm: [f64; 2],
    output: &Path,
    session: &mut Session,
) -> Result<Verdict> {
    let inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).chain(background).chain([camera]).collect();
    session.keep_apart(output, &inputs)?;
    io::check_place(output)?;
    let nominal = Camera::open(camera)?;
    session.explain(format!("camera: {}", nominal.about()));
    let [low, high] = depth_mm;
    let wanted = "wanted two depths that rise, before the main lens";
    if low >= high {
        return Err(Error::new("--depth", format!("{low},{high}"), wanted));
    }
    check_depth_mm(&nominal, high).map_err(|found| Error::new("--depth", found, wanted))?;
    if frames.len() > 1 && background.is_some_and(io::is_standard) {
        let found = "standard input, for several frames";
        return Err(Error::new("--background", found, "wanted a file, which can be read again"));
    }
    let images = session.phase("read", |_| super::frames(frames, background, &nominal, camera))?;
    let subject = match frames {
        [frame] => io::name(frame),
        _ => format!("{} frames", frames.len()),
    };
    let found = session.phase("refine", |session| {
        let progress = session.progress("steps", steps(frames.len()));
        refine_watched(&images, &nominal, depth_mm, &|steps| progress.add(steps))
            .map_err(|refusal| refusal.about(&subject))
    })?;
    session.count("frames", frames.len());
    session.count("particles", found.particles);
    let [before, after] = found.disparity_px;
    session.explain(format!("{} particles, disparity {before:.3} px RMS before, {after:.3} px after", found.particles));
    found.changed.iter().for_each(|(name, change, uncertainty)| {
        session.explain(format!("{name} changed by {change:.7} +- {uncertainty:.7}"));
    });
    if found.changed.is_empty() {
        session.explain("nothing has drifted that these particles could show");
    }
    save_found(found.camera, nominal.flat_field(camera), "wanted particles that fit one", output, session)?;
    Ok(Verdict::Done)
}
