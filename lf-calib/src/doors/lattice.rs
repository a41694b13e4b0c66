//! `lf-calib lattice`.

use super::{check_inputs, with_history};
use lf_calib::{Calibrated, ImageLattice, Refusal, White, calibrate, lattice, overlap};
use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict};
use lf_core::{Error, Result, image, io};
use ndarray::Array2;
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Overlap that is worth a warning: matched f-numbers and what pitches are given to stay below.
const NOTABLE_OVERLAP: f64 = 1.03;

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
    /// Calibrated camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

impl Lattice {
    /// Measures, tells and writes.
    pub fn measure(&self, session: &mut Session) -> Result<Verdict> {
        let inputs: Vec<&Path> =
            self.whites.iter().chain([&self.camera]).chain(&self.dark).map(PathBuf::as_path).collect();
        check_inputs(&inputs)?;
        let outputs: Vec<&Path> = [&self.output].into_iter().chain(&self.centres).map(PathBuf::as_path).collect();
        check_outputs(&outputs)?;
        for output in &outputs {
            session.keep_apart(output, &inputs)?;
        }
        let nominal = Camera::open(&self.camera)?;
        let subject = match self.whites.as_slice() {
            [path] => io::name(path),
            paths => format!("mean of {} white images", paths.len()),
        };
        let refused = |refusal: Refusal| refusal.about(&subject);
        let white = session.phase("read", |_| self.white(&nominal))?;
        let white = white.ok_or_else(|| refused(Refusal::new("no image", "wanted a white image")))?;
        let lattice = session.phase("lattice", |_| lattice::find(&white).map_err(refused))?;
        let calibrated = calibrate(&lattice, &nominal).map_err(refused)?;
        tell(&lattice, &calibrated, session);
        session.phase("write", |session| {
            if let Some(file) = &self.centres {
                io::save_text(file, |out| out.write_all(table(&calibrated).as_bytes()))?;
            }
            let camera = with_history(calibrated.camera, session);
            io::save_text(&self.output, |out| out.write_all(camera.to_json().as_bytes()))
        })?;
        Ok(Verdict::Done)
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
    let camera = &calibrated.camera;
    if overlap(camera) > NOTABLE_OVERLAP {
        session.warn(format!(
            "by its f-number the stop's images are {:.2} times as wide as the lenslets: compare the offset with the image",
            overlap(camera)
        ));
    }
}
