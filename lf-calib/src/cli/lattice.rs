//! `lf-calib lattice`: white images and a nominal camera in, a camera with its microlenses out.

use super::{arguments::LatticeArguments, files::path_from_camera, files::with_history};
use super::{blur::report_blur, blur::set_blur};
use super::{fill::report_fill, fill::report_iris, fill::report_pitch, fill::report_shading};
use lf_calib::{
    Calibrated, ImageLattice, Keep, LATTICE_STEPS, MeanImage, calibrate, check_saturation, find_lattice, flat_field,
    plot, rims,
};
use lf_core::{Camera, Error, Refusal, Result, Session, Verdict, image, io};
use lf_plot::Drawing;
use ndarray::Array2;
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Warn from this share of clipped pixels on.
const NOTABLE_CLIPPED: f64 = 0.005;

pub fn lattice(arguments: &LatticeArguments, session: &mut Session) -> Result<Verdict> {
    check_files(arguments, session)?;
    let mut nominal = Camera::open(&arguments.camera)?;
    if let Some(nm) = arguments.wavelength {
        let nm = nominal.wavelength_of_nm(nm);
        nominal.blur.get_or_insert_default().wavelength_nm = Some(nm);
        nominal.check().map_err(|refusal| refusal.about("--wavelength"))?;
    }
    let nominal = nominal;
    session.explain(format!("nominal camera: {}", nominal.about()));
    let subject = match arguments.whites.as_slice() {
        [path] => io::name(path),
        paths => format!("mean of {} white images", paths.len()),
    };
    let refused = |refusal: Refusal| refusal.about(&subject);
    let white = session.phase("read", |session| white(arguments, &nominal, session))?;
    let white = white.ok_or_else(|| refused(Refusal::new("no image", "wanted a white image")))?;
    let lattice = session.phase("lattice", |session| {
        let progress = session.progress("rounds", LATTICE_STEPS);
        find_lattice(&white, &|rounds| progress.add(rounds)).map_err(refused)
    })?;
    let keep = Keep { f_number: arguments.keep_f_number, pitch: arguments.keep_pitch };
    let mut calibrated = calibrate(&lattice, &nominal, keep).map_err(refused)?;
    let rims = session.phase("rims", |_| Ok(rims(&white, &calibrated.camera_of_white(), &lattice)))?;
    if let Some(iris) = rims.iris {
        calibrated.set_iris(iris, keep);
    }
    if let Some(blur) = rims.blur {
        set_blur(&mut calibrated.camera, blur);
    }

    // Compute everything before the first file is written.
    let none = || Refusal::new("no pixel is well lit by the nominal f-number", "wanted a white image of this camera");
    let flat = |_: &mut Session| flat_field(&white, &calibrated.camera_of_white()).ok_or_else(|| refused(none()));
    let flat_pixels = arguments.vignetting.as_ref().map(|_| session.phase("vignetting", flat)).transpose()?;
    let picture = arguments.plot.as_ref().map(|_| plot::lattice(&white, &lattice, &calibrated));
    let flat = arguments.vignetting.clone().or_else(|| nominal.flat_field(&arguments.camera));
    let flat = flat.map(|flat| path_from_camera(&flat, &arguments.output, session)).transpose()?;
    calibrated.camera.vignetting = flat;
    session.phase("write", |session| save(arguments, &calibrated, flat_pixels.as_ref(), picture.as_ref(), session))?;
    // If a file cannot be written, its error is the only line.
    report(&lattice, &calibrated, &nominal, session);
    match rims.iris.filter(|_| !keep.f_number) {
        Some(iris) => report_iris(iris, &calibrated.camera, &nominal, session),
        None if calibrated.is_ambiguous => session.warn(
            "by the f-number lenslet images overlap, and a lattice half a pitch aside fits them as well: the one nearer to the \
             nominal offset is written",
        ),
        None => report_fill(calibrated.fill.as_ref(), &calibrated.camera, keep.f_number, session),
    }
    report_blur(rims.blur, &nominal, session);
    report_shading(rims.falls, calibrated.camera.vignetting.is_some(), session);
    Ok(Verdict::Done)
}

/// Refuses files named twice, and names that promise another kind of file than is written.
fn check_files(arguments: &LatticeArguments, session: &mut Session) -> Result<()> {
    let LatticeArguments { whites, camera, dark, centres, vignetting, plot, output, .. } = arguments;
    let inputs: Vec<&Path> = whites.iter().chain([camera]).chain(dark).map(PathBuf::as_path).collect();
    let outputs: Vec<&Path> =
        centres.iter().chain(vignetting).chain(plot).chain([output]).map(PathBuf::as_path).collect();
    for (n, output) in outputs.iter().enumerate() {
        if outputs[..n].iter().any(|other| other == output || io::same_file(other, output)) {
            return Err(Error::new(io::output_name(output), "named for two outputs", "wanted a file for each"));
        }
    }
    plot.as_deref().map_or(Ok(()), io::check_picture)?;
    [centres, vignetting].into_iter().flatten().try_for_each(|file| io::check_place(file))?;
    io::check_place(output)?;
    let is_other_image = |file: &Path| {
        let others = ["png", "jpg", "jpeg", "tif", "tiff"];
        file.extension().is_some_and(|end| others.iter().any(|other| end.eq_ignore_ascii_case(other)))
    };
    if let Some(file) = vignetting.as_deref().filter(|file| io::is_standard(file) || is_other_image(file)) {
        let wanted = "wanted FILE.exr, which the camera can name";
        return Err(Error::new(io::output_name(file), "not the name of an EXR", wanted));
    }
    outputs.iter().try_for_each(|output| session.keep_apart(output, &inputs))
}

/// The mean white image minus the dark one. None without images. Warns of clipped images that are not refused.
fn white(arguments: &LatticeArguments, nominal: &Camera, session: &Session) -> Result<Option<Array2<f32>>> {
    let read = |path: &Path| -> Result<Array2<f32>> {
        let image = image::open_counts(path, arguments.reading.channel)?.pixels;
        nominal.check_image(&io::name(path), image.ncols(), image.nrows())?;
        Ok(image)
    };
    let dark = arguments.dark.as_deref().map(read).transpose()?;
    let mut mean = MeanImage::default();
    for path in &image::frames(&arguments.whites) {
        let image = read(path)?;
        mean.add(&image).and_then(|()| check_saturation(&image)).map_err(|refusal| refusal.about(io::name(path)))?;
        if let Some((level, share)) = image::clipped_share(image.view()).filter(|(_, share)| *share > NOTABLE_CLIPPED) {
            session.warn(format!(
                "{}: {:.1} % of the pixels are at the highest count, {level}: clipped, or drawn without noise; clipped \
                 lenslet images look too wide, so take the white image with less light",
                io::name(path),
                100.0 * share
            ));
        }
    }
    let mut white = mean.mean();
    if let (Some(white), Some(dark)) = (&mut white, &dark) {
        white.zip_mut_with(dark, |white, dark| *white = (*white - dark).max(0.0));
    }
    Ok(white)
}

/// Writes the camera, and what was asked for: the flat field, the picture and the table.
fn save(
    arguments: &LatticeArguments,
    calibrated: &Calibrated,
    flat: Option<&Array2<f32>>,
    picture: Option<&Drawing>,
    session: &Session,
) -> Result<()> {
    if let Some((file, flat)) = arguments.vignetting.as_deref().zip(flat) {
        image::save(file, flat, &session.history(&Vec::new()))?;
    }
    if let Some((file, picture)) = arguments.plot.as_deref().zip(picture) {
        lf_plot::save(file, picture)?;
    }
    if let Some(file) = &arguments.centres {
        io::save_text(file, |out| out.write_all(table(calibrated).as_bytes()))?;
    }
    let camera = with_history(calibrated.camera.clone(), session);
    io::save_text(&arguments.output, |out| out.write_all(camera.to_json().as_bytes()))
}

/// The table of `--centres`, one row for each lenslet, px from the image's left and top edge.
fn table(calibrated: &Calibrated) -> String {
    let mut text = String::from("i,j,x_px,y_px,residual_x_px,residual_y_px,kept\n");
    for lenslet in &calibrated.residuals {
        let ((i, j), [x, y], [dx, dy]) = (lenslet.lenslet, lenslet.place_px, lenslet.residual_px);
        let _ = writeln!(text, "{i},{j},{x:.5},{y:.5},{dx:.5},{dy:.5},{}", u8::from(lenslet.kept));
    }
    text
}

fn report(lattice: &ImageLattice, calibrated: &Calibrated, nominal: &Camera, session: &mut Session) {
    session.count("lenslets", lattice.kept());
    session.count("lenslets_rejected", lattice.centres.len() - lattice.kept());
    session.count("lenslets_in_frame", lattice.in_frame);
    session.explain(format!(
        "{} lattice, image pitch {:.5} +- {:.5} px, rotation {:.6} +- {:.6} rad, {} lenslets, {:.4} px RMS from a perfect one",
        json!(lattice.layout).as_str().unwrap_or_default(),
        lattice.pitch_px,
        lattice.pitch_uncertainty_px,
        lattice.rotation_rad,
        lattice.rotation_uncertainty_rad,
        lattice.kept(),
        lattice.residual_rms_px
    ));
    let [found, stated] = [lattice.layout, nominal.microlenses.layout].map(|layout| json!(layout));
    if found != stated {
        let [found, stated] = [&found, &stated].map(|layout| layout.as_str().unwrap_or_default());
        session.warn(format!(
            "the lattice is {found}, and the nominal camera says {stated}: the camera gets the {found} one; if that is \
             wrong, this is the white image of another camera"
        ));
    }
    if calibrated.degree > 0 {
        session.explain(format!(
            "lenslets depart by a polynomial of degree {}, up to {:.2} px at the frame's corners; {:.4} px RMS from that",
            calibrated.degree, calibrated.departure_px, calibrated.residual_rms_px
        ));
    }
    if let Some(stop) = &lattice.second_stop {
        session.explain(format!(
            "a second stop cuts into the lenslet images: a disc of {:.2} px that moves by {:.5} px for each px from the \
             middle; only pixels that it cannot touch are read, here and later",
            stop.diameter_px, stop.slope
        ));
    }
    report_pitch(calibrated, nominal, session);
}
