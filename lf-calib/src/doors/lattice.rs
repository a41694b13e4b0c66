//! `lf-calib lattice`.

use super::{seen_from, with_history};
use lf_calib::{Calibrated, Fill, ImageLattice, Refusal, White, calibrate, flat_field, lattice, plot};
use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict};
use lf_core::{Error, Result, image, io};
use ndarray::Array2;
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Misfit of lenslet images to the pitch, or to the f-number, that is worth a warning.
const NOTABLE_FILL: f64 = 0.05;

/// White images and a nominal camera in, a camera out.
#[derive(Debug, clap::Args)]
pub struct Lattice {
    /// White images of one size, averaged; - for standard input
    #[arg(default_value = "-")]
    whites: Vec<PathBuf>,
    /// Nominal camera.json
    #[arg(short, long, value_name = "FILE")]
    camera: PathBuf,
    /// Dark image of the same size: what the sensor counts without light, subtracted
    #[arg(long, value_name = "FILE")]
    dark: Option<PathBuf>,
    /// Every lenslet that was read, as a table: place of its image, residual, whether it was kept
    #[arg(long, value_name = "FILE.csv")]
    centres: Option<PathBuf>,
    /// Flat field (EXR): the white image over what even light would give; the camera names it, and its frames are divided
    /// by it. Give --dark too where the sensor counts without light
    #[arg(long, value_name = "FILE.exr")]
    vignetting: Option<PathBuf>,
    /// Picture: the lattice over pieces of the image, departures and residuals over the frame
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Calibrated camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

impl Lattice {
    /// Measures, tells and writes.
    pub fn measure(&self, session: &mut Session) -> Result<Verdict> {
        let inputs: Vec<&Path> =
            self.whites.iter().chain([&self.camera]).chain(&self.dark).map(PathBuf::as_path).collect();
        let files = self.centres.iter().chain(&self.vignetting).chain(&self.plot);
        let outputs: Vec<&Path> = files.chain([&self.output]).map(PathBuf::as_path).collect();
        check_outputs(&outputs)?;
        self.check_names()?;
        for output in &outputs {
            session.keep_apart(output, &inputs)?;
        }
        let nominal = Camera::open(&self.camera)?;
        session.explain(format!("nominal camera: {}", nominal.about()));
        let subject = match self.whites.as_slice() {
            [path] => io::name(path),
            paths => format!("mean of {} white images", paths.len()),
        };
        let refused = |refusal: Refusal| refusal.about(&subject);
        let white = session.phase("read", |_| self.white(&nominal))?;
        let white = white.ok_or_else(|| refused(Refusal::new("no image", "wanted a white image")))?;
        let lattice = session.phase("lattice", |session| {
            let progress = session.progress("rounds", lattice::ROUNDS);
            lattice::find_watched(&white, &|rounds| progress.add(rounds)).map_err(refused)
        })?;
        let mut calibrated = calibrate(&lattice, &nominal).map_err(refused)?;
        let flat = self.vignetting.as_ref().map(|file| {
            let none =
                Refusal::new("no pixel is well lit by the nominal f-number", "wanted a white image of this camera");
            let flat =
                session.phase("vignetting", |_| flat_field(&white, &calibrated.camera).ok_or(none.about(&subject)));
            flat.map(|flat| (file, flat))
        });
        let flat = flat.transpose()?;
        let picture = |file: &PathBuf| -> Result<(PathBuf, String)> {
            let svg = plot::lattice(&white, &lattice, &calibrated);
            Ok((file.clone(), svg.map_err(|error| Error::new(io::output_name(file), error, "wanted a picture"))?))
        };
        let svg = self.plot.as_ref().map(picture).transpose()?;
        let map = self.vignetting.clone().or_else(|| nominal.flat_field(&self.camera));
        calibrated.camera.vignetting = map.map(|map| seen_from(&map, &self.output, session)).transpose()?;
        session.phase("write", |session| {
            if let Some((file, flat)) = &flat {
                image::save(file, flat, &session.history(&Vec::new()))?;
            }
            if let Some((file, svg)) = &svg {
                io::save_text(file, |out| out.write_all(svg.as_bytes()))?;
            }
            if let Some(file) = &self.centres {
                io::save_text(file, |out| out.write_all(table(&calibrated).as_bytes()))?;
            }
            let camera = with_history(calibrated.camera.clone(), session);
            io::save_text(&self.output, |out| out.write_all(camera.to_json().as_bytes()))
        })?;
        // Where nothing could be written, that is the one line to read.
        tell(&lattice, &calibrated, session);
        Ok(Verdict::Done)
    }

    /// Refuses names that promise another kind of file than is written.
    fn check_names(&self) -> Result<()> {
        let other = |file: &Path, kinds: &[&str]| {
            file.extension().is_some_and(|end| kinds.iter().any(|kind| end.eq_ignore_ascii_case(kind)))
        };
        self.plot.as_deref().map_or(Ok(()), io::check_picture)?;
        [&self.centres, &self.vignetting].into_iter().flatten().try_for_each(|file| io::check_place(file))?;
        io::check_place(&self.output)?;
        match self.vignetting.as_deref() {
            Some(file) if io::is_standard(file) || other(file, &["png", "jpg", "jpeg", "tif", "tiff"]) => {
                Err(Error::new(
                    io::output_name(file),
                    "not the name of an EXR",
                    "wanted FILE.exr, which the camera can name",
                ))
            }
            _ => Ok(()),
        }
    }

    /// The mean white image less the dark one; none of no image.
    fn white(&self, nominal: &Camera) -> Result<Option<Array2<f32>>> {
        let read = |path: &Path| -> Result<Array2<f32>> {
            let image = image::open_counts(path)?.pixels;
            nominal.check_image(&io::name(path), image.ncols(), image.nrows())?;
            Ok(image)
        };
        let dark = self.dark.as_deref().map(read).transpose()?;
        let mut white = White::new();
        for path in &self.whites {
            white.add(&read(path)?).map_err(|refusal| refusal.about(io::name(path)))?;
        }
        let mut white = white.mean();
        if let (Some(white), Some(dark)) = (&mut white, &dark) {
            white.zip_mut_with(dark, |white, dark| *white = (*white - dark).max(0.0));
        }
        Ok(white)
    }
}

/// Refuses two outputs under one name, and two on standard output.
fn check_outputs(outputs: &[&Path]) -> Result<()> {
    for (n, output) in outputs.iter().enumerate() {
        if outputs[..n].iter().any(|other| other == output || io::same_file(other, output)) {
            return Err(Error::new(io::output_name(output), "named for two outputs", "wanted a file for each"));
        }
    }
    Ok(())
}

/// One line a lenslet; image places and residuals in pixels from the image's left and top edge.
fn table(calibrated: &Calibrated) -> String {
    let mut text = String::from("i,j,x_px,y_px,residual_x_px,residual_y_px,kept\n");
    for lenslet in &calibrated.residuals {
        let ((i, j), [x, y], [dx, dy]) = (lenslet.lenslet, lenslet.place_px, lenslet.residual_px);
        let _ = writeln!(text, "{i},{j},{x:.5},{y:.5},{dx:.5},{dy:.5},{}", u8::from(lenslet.kept));
    }
    text
}

fn tell(lattice: &ImageLattice, calibrated: &Calibrated, session: &mut Session) {
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
    if calibrated.degree > 0 {
        session.explain(format!(
            "lenslets depart by a polynomial of degree {}, up to {:.2} px at the frame's corners; {:.4} px RMS from that",
            calibrated.degree, calibrated.departure_px, calibrated.residual_rms_px
        ));
    }
    if let Some(stop) = &lattice.second_stop {
        session.explain(format!(
            "a second stop cuts into the lenslet images: a disc of {:.2} px that moves by {:.5} px per px from the middle; \
             only what it leaves is read",
            stop.diameter_px, stop.drift
        ));
    }
    if let Some(fill) = &calibrated.fill {
        tell_fill(fill, &calibrated.camera, session);
    }
    if calibrated.is_ambiguous {
        session.warn(
            "by the f-number lenslet images overlap, and a lattice half a pitch aside fits them as well: the one nearer to the \
             nominal offset is written",
        );
    }
}

/// Warns of lenslet images that are not as wide as they should be.
fn tell_fill(fill: &Fill, camera: &Camera, session: &Session) {
    let Fill { measured_px, nominal_px, pitch_px } = *fill;
    session.explain(format!("lenslet images are {measured_px:.2} px wide, {:.3} of the pitch", measured_px / pitch_px));
    let lens = &camera.main_lens;
    if (measured_px / nominal_px - 1.0).abs() > NOTABLE_FILL {
        session.warn(format!(
            "lenslet images are {measured_px:.2} px wide, and by the nominal f-number {} {nominal_px:.2} px: the white image was \
             taken at {:.2}, or the camera is another",
            lens.working_f_number,
            lens.working_f_number * nominal_px / measured_px
        ));
    } else if (measured_px / pitch_px - 1.0).abs() > NOTABLE_FILL {
        let (what, share) = if measured_px < pitch_px { ("underfill", "unused") } else { ("overfill", "shared") };
        session.warn(format!(
            "lenslet images {what} the pitch: {measured_px:.2} of {pitch_px:.2} px, {:.0} % {share}; f-number {:.2} would match",
            100.0 * (measured_px / pitch_px - 1.0).abs(),
            lens.working_f_number * measured_px / pitch_px
        ));
    }
}
