//! `lf-calib volume`.

use super::{frames, save_found};
use lf_calib::{Dot, Exposure, Volume, looks, volume_watched};
use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict, numbers};
use lf_core::weights::check_depth_mm;
use lf_core::{Error, Result, io, particles};
use std::path::{Path, PathBuf};

/// What the target is.
pub struct Target<'a> {
    /// Table of its dots, a frame an image.
    pub table: Option<&'a Path>,
    /// Spacing of a square grid, mm.
    pub spacing_mm: Option<f64>,
    /// Its depths, mm.
    pub depths_mm: Option<&'a str>,
}

/// The images as typed, or those of a folder, with the folder's table.
fn inputs(images: &[PathBuf], target: &Target) -> Result<(Vec<PathBuf>, Option<PathBuf>)> {
    let [folder] = images else { return Ok((images.to_vec(), target.table.map(Path::to_path_buf))) };
    if !folder.is_dir() {
        return Ok((images.to_vec(), target.table.map(Path::to_path_buf)));
    }
    let read = std::fs::read_dir(folder).map_err(|error| {
        Error::new(io::name(folder), error.to_string(), "wanted a folder of images as lf-synth dots writes it")
    })?;
    let is_image = |path: &PathBuf| {
        let known = |end: &std::ffi::OsStr| ["exr", "tif", "tiff", "png"].iter().any(|e| end.eq_ignore_ascii_case(e));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("dots-") && path.extension().is_some_and(known)
    };
    let mut found: Vec<PathBuf> = read.filter_map(|entry| Some(entry.ok()?.path())).filter(is_image).collect();
    found.sort();
    if found.is_empty() {
        return Err(Error::new(io::name(folder), "no dots-0000.exr", "wanted a folder as lf-synth dots writes it"));
    }
    let table = target.table.map_or_else(|| folder.join("dots.csv"), Path::to_path_buf);
    let grid = target.spacing_mm.is_some() || target.depths_mm.is_some();
    Ok((found, (!grid).then_some(table)))
}

/// The dots of each of so many images.
fn dots(count: usize, table: Option<&Path>, target: &Target, nominal: &Camera) -> Result<Vec<Vec<Dot>>> {
    match (table, target.spacing_mm, target.depths_mm) {
        (Some(table), None, None) => {
            let wrong = |found: String| Error::new(io::name(table), found, "wanted the table of a target's dots");
            let lines = particles::read(&io::open_text(table)?).map_err(|refusal| refusal.about(io::name(table)))?;
            let frames = lines.iter().map(|line| line.frame + 1).max().unwrap_or(0);
            if frames != count {
                return Err(wrong(format!("dots of {frames} frames for {count} images")));
            }
            let of = |frame: usize| {
                let here = lines.iter().filter(|line| line.frame == frame);
                here.map(|line| Dot { id: line.id, place_mm: line.place_mm }).collect()
            };
            Ok((0..count).map(of).collect())
        }
        (None, Some(spacing), Some(text)) => {
            if !(spacing.is_finite() && spacing > 0.0) {
                return Err(Error::new("--spacing", spacing.to_string(), "wanted a positive length, mm"));
            }
            let depths: Option<Vec<f64>> =
                text.split(',').map(|part| numbers::<1>(part).ok().map(|[depth]| depth)).collect();
            let depths = depths.ok_or_else(|| Error::new("--depths", text, "wanted numbers between commas, mm"))?;
            if depths.len() != count {
                let found = format!("{} depths for {count} images", depths.len());
                return Err(Error::new("--depths", found, "wanted one an image"));
            }
            Ok(depths.iter().map(|depth| lf_calib::grid(spacing, *depth, nominal)).collect())
        }
        (Some(_), _, _) => Err(Error::new("--target", "given with --spacing or --depths", "wanted one or the other")),
        _ => Err(Error::new("the target", "not given", "wanted --target FILE, or --spacing MM and --depths Z0,Z1,...")),
    }
}

/// Images of a target and a camera in, a camera out.
pub fn main_lens(
    images: &[PathBuf],
    target: &Target,
    camera: &Path,
    output: &Path,
    session: &mut Session,
) -> Result<Verdict> {
    let (images, table) = inputs(images, target)?;
    let all: Vec<&Path> = images.iter().map(PathBuf::as_path).chain(table.as_deref()).chain([camera]).collect();
    session.keep_apart(output, &all)?;
    io::check_place(output)?;
    let nominal = Camera::open(camera)?;
    session.explain(format!("camera: {}", nominal.about()));
    let dots = dots(images.len(), table.as_deref(), target, &nominal)?;
    let exposures = session.phase("read", |_| {
        for depth in dots.iter().flatten().map(|dot| dot.place_mm[2]) {
            check_depth_mm(&nominal, depth)
                .map_err(|found| Error::new("the target", found, "wanted depths before the main lens"))?;
        }
        let images = frames(&images, None, &nominal, camera)?;
        let exposure = |(pixels, dots)| Exposure { pixels, dots };
        Ok(images.into_iter().zip(dots).map(exposure).collect::<Vec<_>>())
    })?;
    let subject = |image: Option<usize>| image.map_or_else(|| "the target".to_string(), |n| io::name(&images[n]));
    let found = session.phase("volume", |session| {
        let progress = session.progress("looks", looks(exposures.len()));
        volume_watched(&exposures, &nominal, &|looks| progress.add(looks))
            .map_err(|(image, refusal)| refusal.about(subject(image)))
    })?;
    save_found(found.camera.clone(), nominal.flat_field(camera), "wanted a target that fits one", output, session)?;
    tell(&found, exposures.len(), session);
    Ok(Verdict::Done)
}

fn tell(found: &Volume, images: usize, session: &mut Session) {
    session.count("images", images);
    session.count("images_used", found.used.len());
    session.count("dots", found.dots);
    session.count("sub_images", found.spots[0]);
    session.count("sub_images_kept", found.spots[1]);
    let left_out = images - found.used.len();
    if left_out > 0 {
        session.explain(format!("{left_out} images too near to focus are left out: no lenslet is lit whole by a dot"));
    }
    let [before, after, expected] = found.rms_px;
    session.explain(format!(
        "{} of {} sub-images of {} dots, {before:.3} px RMS before, {after:.4} px after, {expected:.4} px by their own noise",
        found.spots[1], found.spots[0], found.dots
    ));
    for (name, value, uncertainty) in &found.values {
        session.explain(format!("{name} {value:.7} +- {uncertainty:.7}"));
    }
    let asked = if found.asked.is_empty() { "nothing else".to_string() } else { found.asked.join(", ") };
    session.explain(format!("besides the target's pose and the magnification the data ask for {asked}"));
    for (a, b, correlation) in &found.correlated {
        session.warn(format!("{a} and {b} can hardly be told apart: correlation {correlation:.3}"));
    }
}
