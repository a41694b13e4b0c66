//! `lf-calib volume`: images of a dot target and a camera in, a camera with its main lens out.

use super::{arguments::VolumeArguments, files::frames, files::save_found};
use lf_calib::{Dot, Exposure, MainLensFit, grid, main_lens_steps};
use lf_core::{Camera, Error, Result, Session, Verdict, cli::numbers, io, particles, weights::check_depth_mm};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

pub fn main_lens(arguments: &VolumeArguments, session: &mut Session) -> Result<Verdict> {
    let VolumeArguments { camera, output, .. } = arguments;
    let (images, table) = inputs(arguments)?;
    let all: Vec<&Path> = images.iter().chain(&table).chain([camera]).map(PathBuf::as_path).collect();
    session.keep_apart(output, &all)?;
    io::check_place(output)?;
    let nominal = Camera::open(camera)?;
    session.explain(format!("camera: {}", nominal.about()));
    let dots = dots(images.len(), table.as_deref(), arguments, &nominal, session)?;
    let exposures = session.phase("read", |_| {
        for depth in dots.iter().flatten().map(|dot| dot.place_mm[2]) {
            check_depth_mm(&nominal, depth).map_err(|refusal| {
                Error::new("the target", refusal.found, "wanted depths in front of the main lens")
            })?;
        }
        let images = frames(&images, None, &nominal, camera)?;
        let exposure = |(pixels, dots)| Exposure { pixels, dots };
        Ok(images.into_iter().zip(dots).map(exposure).collect::<Vec<_>>())
    })?;
    let subject = |image: Option<usize>| image.map_or_else(|| "the target".to_string(), |n| io::name(&images[n]));
    let found = session.phase("volume", |session| {
        let progress = session.progress("looks", main_lens_steps(exposures.len()));
        lf_calib::main_lens(&exposures, &nominal, &|looks| progress.add(looks))
            .map_err(|(image, refusal)| refusal.about(subject(image)))
    })?;
    save_found(found.camera.clone(), nominal.flat_field(camera), "wanted a target that fits one", output, session)?;
    tell(&found, exposures.len(), session);
    Ok(Verdict::Done)
}

/// The images and the table as typed, or those of a folder.
fn inputs(arguments: &VolumeArguments) -> Result<(Vec<PathBuf>, Option<PathBuf>)> {
    let [folder] = arguments.images.as_slice() else { return Ok((arguments.images.clone(), arguments.target.clone())) };
    if !folder.is_dir() {
        return Ok((arguments.images.clone(), arguments.target.clone()));
    }
    let wanted = "wanted a folder of images, as lf-synth dots writes it";
    let read = std::fs::read_dir(folder).map_err(|error| Error::new(io::name(folder), error.to_string(), wanted))?;
    let is_image = |path: &PathBuf| {
        let is_known = |end: &OsStr| ["exr", "tif", "tiff", "png"].iter().any(|e| end.eq_ignore_ascii_case(e));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("dots-") && path.extension().is_some_and(is_known)
    };
    let mut found: Vec<PathBuf> = read.filter_map(|entry| Some(entry.ok()?.path())).filter(is_image).collect();
    found.sort();
    if found.is_empty() {
        return Err(Error::new(io::name(folder), "no dots-0000.exr", wanted));
    }
    let is_grid = arguments.spacing.is_some() || arguments.depths.is_some();
    let table = || arguments.target.clone().unwrap_or_else(|| folder.join("dots.csv"));
    Ok((found, (!is_grid).then(table)))
}

/// The dots of each image: from a table, or on a square grid.
fn dots(
    images: usize,
    table: Option<&Path>,
    arguments: &VolumeArguments,
    nominal: &Camera,
    session: &Session,
) -> Result<Vec<Vec<Dot>>> {
    match (table, arguments.spacing, arguments.depths.as_deref()) {
        (Some(table), None, None) => dots_of_table(images, table, session),
        (None, Some(spacing), Some(depths)) => {
            if !(spacing.is_finite() && spacing > 0.0) {
                return Err(Error::new("--spacing", spacing.to_string(), "wanted a positive length, mm"));
            }
            Ok(depths_of(images, depths)?.iter().map(|depth| grid(spacing, *depth, nominal)).collect())
        }
        (Some(_), _, _) => Err(Error::new("--target", "given with --spacing or --depths", "wanted one or the other")),
        _ => Err(Error::new("the target", "not given", "wanted --target FILE, or --spacing MM and --depths Z0,Z1,...")),
    }
}

/// The dots of each image from a table, which must have as many frames as there are images.
fn dots_of_table(images: usize, table: &Path, session: &Session) -> Result<Vec<Vec<Dot>>> {
    let text = io::open_text(table)?;
    let rows = particles::read(&text).map_err(|refusal| refusal.about(io::name(table)))?;
    particles::warn_unmarked(&text, &io::name(table), session);
    let frames = rows.iter().map(|row| row.frame + 1).max().unwrap_or(0);
    if frames != images {
        let found = format!("dots of {frames} frames for {images} images");
        return Err(Error::new(io::name(table), found, "wanted the table of a target's dots"));
    }
    let mut dots = vec![Vec::new(); images];
    rows.iter().for_each(|row| dots[row.frame].push(Dot { id: row.id, place_mm: row.place_mm }));
    Ok(dots)
}

fn depths_of(images: usize, text: &str) -> Result<Vec<f64>> {
    let depths: Option<Vec<f64>> = text.split(',').map(|part| numbers::<1>(part).ok().map(|[depth]| depth)).collect();
    let depths = depths.ok_or_else(|| Error::new("--depths", text, "wanted numbers between commas, mm"))?;
    if depths.len() != images {
        let found = format!("{} depths for {images} images", depths.len());
        return Err(Error::new("--depths", found, "wanted one for each image"));
    }
    Ok(depths)
}

fn tell(found: &MainLensFit, images: usize, session: &mut Session) {
    session.count("images", images);
    session.count("images_used", found.used.len());
    session.count("dots", found.dots);
    let [sub_images, kept] = found.sub_images;
    session.count("sub_images", sub_images);
    session.count("sub_images_kept", kept);
    let left_out = images - found.used.len();
    if left_out > 0 {
        session
            .explain(format!("{left_out} images are left out, too near to focus: a dot lights no lenslet completely"));
    }
    let [before, after, expected] = found.rms_px;
    session.explain(format!(
        "{kept} of {sub_images} sub-images of {} dots, {before:.3} px RMS before, {after:.4} px after, {expected:.4} px \
         expected from their noise",
        found.dots
    ));
    for (name, value, uncertainty) in &found.values {
        session.explain(format!("{name} {value:.7} +- {uncertainty:.7}"));
    }
    let selected = if found.selected.is_empty() { "no other parameter".to_string() } else { found.selected.join(", ") };
    session.explain(format!("besides the target's pose and the magnification the data require {selected}"));
    for (a, b, correlation) in &found.correlated {
        session.warn(format!("{a} and {b} can hardly be told apart: correlation {correlation:.3}"));
    }
}
