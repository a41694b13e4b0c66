//! `lf-calib volume`: images of a dot target and a camera in, a camera with its main lens out.

use super::{arguments::VolumeArguments, files::frames, files::save_found, target_images::Target};
use lf_calib::{Exposure, MainLensFit, closer_dots_mm, fit_warnings, main_lens_steps, setup_mistake};
use lf_core::image::{self, Channel, FrameFiles};
use lf_core::{Camera, Error, Result, Session, Verdict, io, weights::check_depth_mm};
use ndarray::Array2;
use std::path::{Path, PathBuf};

pub fn main_lens(arguments: &VolumeArguments, session: &mut Session) -> Result<Verdict> {
    let VolumeArguments { camera, reading, output, .. } = arguments;
    let channel = reading.channel;
    io::check_place(output)?;
    let target = Target::open(arguments, session)?;
    let Target { images, tables, .. } = &target;
    let all: Vec<&Path> = images.iter().chain(tables).chain([camera]).map(PathBuf::as_path).collect();
    session.keep_apart(output, &all)?;
    let nominal = Camera::open(camera)?;
    session.explain(format!("camera: {}", nominal.about()));
    let dots = target.dots(&nominal, session)?;
    // If the work cannot be done, its error is the only line.
    let mut warnings: Vec<String> = Vec::new();
    let exposures = session.phase("read", |_| {
        for depth in dots.iter().flatten().map(|dot| dot.place_mm[2]) {
            check_depth_mm(&nominal, depth).map_err(|refusal| {
                Error::new("the target", refusal.found, "wanted depths in front of the main lens")
            })?;
        }
        let counts = frames(images, FrameFiles::default(), &nominal, camera, channel)?;
        for (file, frame) in images.iter().zip(&counts) {
            warnings.extend(clipping(file, frame, &nominal, channel)?);
        }
        let exposure = |(pixels, dots)| Exposure { pixels, dots };
        Ok(counts.into_iter().zip(dots).map(exposure).collect::<Vec<_>>())
    })?;
    let subject = |image: Option<usize>| image.map_or_else(|| "the target".to_string(), |n| io::name(&images[n]));
    let found = session.phase("volume", |session| {
        let progress = session.progress("readings", main_lens_steps(exposures.len()));
        Ok(lf_calib::main_lens(&exposures, &nominal, &|readings| progress.add(readings)))
    })?;
    let found = found.or_else(|(image, refusal)| {
        let mistake = session.phase("mistakes", |_| Ok(setup_mistake(&exposures, &nominal)))?;
        Err(mistake.map_or_else(|| refusal.about(subject(image)), |mistake| mistake.about("the target")))
    })?;
    save_found(found.camera.clone(), nominal.flat_field(camera), "wanted a target that fits one", output, session)?;
    report(&found, exposures.len(), session);
    let lists = || target.tables.iter().map(|table| io::name(table)).collect::<String>();
    target.left_out.iter().for_each(|image| {
        session.say(format!("{} is left out: {} does not list it", io::name(image), lists()));
    });
    warnings.extend(warnings_of(&found, &exposures, &nominal));
    warnings.iter().for_each(|warning| session.warn(warning));
    Ok(Verdict::Done)
}

fn report(found: &MainLensFit, images: usize, session: &mut Session) {
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
    let value = |wanted: &str, digits: usize| {
        let of = found.values.iter().find(|(name, ..)| *name == wanted);
        of.map_or_else(String::new, |(_, value, uncertainty)| format!("{value:.digits$} +- {uncertainty:.digits$}"))
    };
    let zero = ["target_x_mm", "target_y_mm", "focus_offset_mm"].map(|name| value(name, 4)).join(", ");
    session.say(format!(
        "{after:.4} px RMS, {expected:.4} px expected from noise; magnification {}; besides it and the target's pose the \
         data require {selected}; the target's zero stands at x, y, z = {zero} mm of the camera",
        value("magnification", 6)
    ));
    let pairs = found.correlated.iter().map(|(a, b, correlation)| format!("{a} and {b} ({correlation:.3})"));
    let pairs: Vec<String> = pairs.collect();
    if !pairs.is_empty() {
        session.warn(format!("parameters can hardly be separated, by their correlation: {}", pairs.join(", ")));
    }
}

/// The warning of an image whose brightest pixels are clipped: its dots seem to be elsewhere.
fn clipping(file: &Path, pixels: &Array2<f32>, camera: &Camera, channel: Option<Channel>) -> Result<Option<String>> {
    // Divided by a flat field, the counts at the end of the histogram are no longer the same.
    let is_divided = camera.vignetting.is_some() && !io::is_standard(file);
    let raw = is_divided.then(|| image::open_counts(file, channel)).transpose()?;
    let pixels = raw.as_ref().map_or(pixels, |raw| &raw.pixels);
    Ok(image::clipped_share(pixels.view()).map(|(level, share)| {
        format!(
            "{}: {:.2} % of its pixels are clipped at {level} counts, which moves sub-images: take the target with less light",
            io::name(file),
            100.0 * share
        )
    }))
}

/// Warnings about the camera found, and the mistake that explains them if one is found.
fn warnings_of(found: &MainLensFit, exposures: &[Exposure], nominal: &Camera) -> Vec<String> {
    let mut warnings = fit_warnings(found, nominal);
    // A camera near its data sheets needs no other setup.
    let is_wrong = warnings.len() > usize::from(found.doubt.is_some());
    let mistake = is_wrong.then(|| setup_mistake(exposures, nominal)).flatten();
    warnings.extend(mistake.map(|mistake| format!("the target: {}; {}", mistake.found, mistake.wanted)));
    warnings.extend(closer_dots_mm(exposures, &found.used, &found.camera).map(|[seen, stated]| {
        format!(
            "the images show dots {seen:.3} mm apart, and the target is said to have them {stated:.3} mm apart: check the spacing"
        )
    }));
    warnings
}
