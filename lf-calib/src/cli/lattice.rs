//! `lf-calib lattice`: white images and a nominal camera in, a camera with its microlenses out.

use super::files::{path_from_camera, with_history};
use super::{arguments::LatticeArguments, tell_lattice::tell};
use lf_calib::{Calibrated, LATTICE_STEPS, WhiteMean, calibrate, find_lattice_watched, flat_field, plot};
use lf_core::{Camera, Error, Refusal, Result, Session, Verdict, image, io};
use ndarray::Array2;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Finds the lattice, then writes the camera and the other files asked for.
pub fn lattice(arguments: &LatticeArguments, session: &mut Session) -> Result<Verdict> {
    check_files(arguments, session)?;
    let nominal = Camera::open(&arguments.camera)?;
    session.explain(format!("nominal camera: {}", nominal.about()));
    let subject = match arguments.whites.as_slice() {
        [path] => io::name(path),
        paths => format!("mean of {} white images", paths.len()),
    };
    let refused = |refusal: Refusal| refusal.about(&subject);
    let white = session.phase("read", |_| white(arguments, &nominal))?;
    let white = white.ok_or_else(|| refused(Refusal::new("no image", "wanted a white image")))?;
    let lattice = session.phase("lattice", |session| {
        let progress = session.progress("rounds", LATTICE_STEPS);
        find_lattice_watched(&white, &|rounds| progress.add(rounds)).map_err(refused)
    })?;
    let mut calibrated = calibrate(&lattice, &nominal).map_err(refused)?;

    // Compute everything before the first file is written.
    let mut outputs = Outputs::default();
    if arguments.vignetting.is_some() {
        let none = Refusal::new("no pixel is well lit by the nominal f-number", "wanted a white image of this camera");
        let flat = |_: &mut Session| flat_field(&white, &calibrated.camera).ok_or_else(|| refused(none));
        outputs.flat = Some(session.phase("vignetting", flat)?);
    }
    if let Some(file) = &arguments.plot {
        let svg = plot::lattice(&white, &lattice, &calibrated);
        outputs.svg = Some(svg.map_err(|refusal| refusal.about(io::output_name(file)))?);
    }
    let flat = arguments.vignetting.clone().or_else(|| nominal.flat_field(&arguments.camera));
    let flat = flat.map(|flat| path_from_camera(&flat, &arguments.output, session)).transpose()?;
    calibrated.camera.vignetting = flat;
    session.phase("write", |session| outputs.save(arguments, &calibrated, session))?;
    // If a file cannot be written, its error is the only line.
    tell(&lattice, &calibrated, session);
    Ok(Verdict::Done)
}

/// Refuses files named twice, and names that promise another kind of file than is written.
fn check_files(arguments: &LatticeArguments, session: &mut Session) -> Result<()> {
    let LatticeArguments { whites, camera, dark, centres, vignetting, plot, output } = arguments;
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

/// The mean white image minus the dark one. None without images.
fn white(arguments: &LatticeArguments, nominal: &Camera) -> Result<Option<Array2<f32>>> {
    let read = |path: &Path| -> Result<Array2<f32>> {
        let image = image::open_counts(path)?.pixels;
        nominal.check_image(&io::name(path), image.ncols(), image.nrows())?;
        Ok(image)
    };
    let dark = arguments.dark.as_deref().map(read).transpose()?;
    let mut mean = WhiteMean::new();
    for path in &arguments.whites {
        mean.add(&read(path)?).map_err(|refusal| refusal.about(io::name(path)))?;
    }
    let mut white = mean.mean();
    if let (Some(white), Some(dark)) = (&mut white, &dark) {
        white.zip_mut_with(dark, |white, dark| *white = (*white - dark).max(0.0));
    }
    Ok(white)
}

/// Outputs besides the camera and the table.
#[derive(Default)]
struct Outputs {
    flat: Option<Array2<f32>>,
    svg: Option<String>,
}

impl Outputs {
    /// Writes all files.
    fn save(&self, arguments: &LatticeArguments, calibrated: &Calibrated, session: &Session) -> Result<()> {
        if let (Some(file), Some(flat)) = (&arguments.vignetting, &self.flat) {
            image::save(file, flat, &session.history(&Vec::new()))?;
        }
        if let (Some(file), Some(svg)) = (&arguments.plot, &self.svg) {
            io::save_text(file, |out| out.write_all(svg.as_bytes()))?;
        }
        if let Some(file) = &arguments.centres {
            io::save_text(file, |out| out.write_all(table(calibrated).as_bytes()))?;
        }
        let camera = with_history(calibrated.camera.clone(), session);
        io::save_text(&arguments.output, |out| out.write_all(camera.to_json().as_bytes()))
    }
}

/// The table of `--centres`, one row for each lenslet. Image positions and residuals are px from the image's left and
/// top edge.
fn table(calibrated: &Calibrated) -> String {
    let mut text = String::from("i,j,x_px,y_px,residual_x_px,residual_y_px,kept\n");
    for lenslet in &calibrated.residuals {
        let ((i, j), [x, y], [dx, dy]) = (lenslet.lenslet, lenslet.place_px, lenslet.residual_px);
        let _ = writeln!(text, "{i},{j},{x:.5},{y:.5},{dx:.5},{dy:.5},{}", u8::from(lenslet.kept));
    }
    text
}
