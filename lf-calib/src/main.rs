//! The door of lf-calib: what was typed, images in, one call, a camera or an image out.

use clap::{Parser, Subcommand};
use lf_calib::{Background, ImageLattice, Refusal, White, calibrate, lattice, overlap};
use lf_core::camera::Camera;
use lf_core::cli::{self, Common, Session, Verdict};
use lf_core::history::History;
use lf_core::{Error, Result, image, io};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Departure from a perfect lattice at the frame's corners that is worth a warning, px: a fiftieth of a lenslet of the
/// seed camera, and thirty times what the lattice of a good white image is known to.
const NOTABLE_DEPARTURE_PX: f64 = 0.3;

/// Overlap that is worth a warning: matched f-numbers and what pitches are given to stay below.
const NOTABLE_OVERLAP: f64 = 1.03;

/// White images and particle frames to a camera that can be trusted
#[derive(Parser)]
#[command(
    name = "lf-calib",
    version,
    max_term_width = 100,
    after_help = "Examples:
  lf-calib lattice white.exr -c nominal.json -o camera.json
  lf-calib background frame-*.exr --quantile 0.05 -o background.exr"
)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum Task {
    /// Find the microlens lattice in white images
    ///
    /// Layout, pitch, rotation and offset come from the images. The nominal camera gives the main lens, the microlens
    /// focal length and the pixels, which of the offsets and rotations that mean the same lattice is written, and
    /// whatever else is in its file.
    Lattice {
        /// White images of one size, averaged; - for standard input
        #[arg(default_value = "-")]
        whites: Vec<PathBuf>,
        /// Nominal camera.json
        #[arg(short, long, value_name = "FILE")]
        camera: PathBuf,
        /// Calibrated camera.json, - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
    },
    /// Per-pixel minimum, or a low quantile, of many frames
    Background {
        /// Frames of one size; - for standard input
        #[arg(default_value = "-")]
        frames: Vec<PathBuf>,
        /// Quantile from 0, the minimum, to 0.5; memory grows with it times the number of frames
        #[arg(long, value_name = "Q", default_value_t = 0.0)]
        quantile: f64,
        /// Background image (EXR), - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
    },
}

fn main() -> ExitCode {
    cli::run(
        "lf-calib",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| match &arguments.task {
            Task::Lattice { whites, camera, output } => measure(whites, camera, output, session),
            Task::Background { frames, quantile, output } => background(frames, *quantile, output, session),
        },
    )
}

fn measure(whites: &[PathBuf], camera: &Path, output: &Path, session: &mut Session) -> Result<Verdict> {
    let inputs: Vec<&Path> = whites.iter().map(PathBuf::as_path).chain([camera]).collect();
    check_inputs(&inputs)?;
    session.keep_apart(output, &inputs)?;
    let nominal = Camera::open(camera)?;
    let white = session.phase("read", |_| {
        let mut white = White::new();
        for path in whites {
            let image = image::open_counts(path)?.pixels;
            nominal.check_image(&io::name(path), image.ncols(), image.nrows())?;
            white.add(&image).map_err(|refusal| refusal.about(io::name(path)))?;
        }
        Ok(white.mean())
    })?;
    let subject = match whites {
        [path] => io::name(path),
        paths => format!("mean of {} white images", paths.len()),
    };
    let refused = |refusal: Refusal| refusal.about(&subject);
    let white = white.ok_or_else(|| refused(Refusal::new("no image", "wanted a white image")))?;
    let lattice = session.phase("lattice", |_| lattice::find(&white).map_err(refused))?;
    tell(&lattice, session);
    let camera = calibrate(&lattice, &nominal);
    if overlap(&camera) > NOTABLE_OVERLAP {
        session.warn(format!(
            "by its f-number the stop's images are {:.2} times as wide as the lenslets: compare the offset with the image",
            overlap(&camera)
        ));
    }
    let camera = with_history(camera, session);
    session.phase("write", |_| io::save_text(output, |out| out.write_all(camera.to_json().as_bytes())))?;
    Ok(Verdict::Done)
}

fn tell(lattice: &ImageLattice, session: &mut Session) {
    session.count("lenslets", lattice.kept());
    session.count("lenslets_rejected", lattice.centres.len() - lattice.kept());
    session.count("lenslets_in_frame", lattice.in_frame);
    session.explain(format!(
        "{} lattice, image pitch {:.5} +- {:.5} px, rotation {:.6} +- {:.6} rad, {} lenslets, residual {:.4} px RMS",
        json!(lattice.layout).as_str().unwrap_or_default(),
        lattice.pitch_px,
        lattice.pitch_uncertainty_px,
        lattice.rotation_rad,
        lattice.rotation_uncertainty_rad,
        lattice.kept(),
        lattice.residual_rms_px
    ));
    if lattice.affine_departure_px > NOTABLE_DEPARTURE_PX {
        session.warn(format!(
            "at the frame's corners the lenslets are up to {:.2} px from the perfect lattice that is written",
            lattice.affine_departure_px
        ));
    }
}

/// This run after the steps that led to the nominal camera.
fn with_history(mut camera: Camera, session: &Session) -> Camera {
    if let Some(Value::Object(calibration)) = &mut camera.calibration {
        let before = calibration.remove("history").and_then(|steps| serde_json::from_value::<History>(steps).ok());
        let history = session.history(&before.unwrap_or_default());
        if !history.is_empty() {
            calibration.insert("history".to_string(), json!(history));
        }
    }
    camera
}

fn background(frames: &[PathBuf], quantile: f64, output: &Path, session: &mut Session) -> Result<Verdict> {
    if !(0.0..=0.5).contains(&quantile) {
        return Err(Error::new("--quantile", quantile.to_string(), "wanted 0 to 0.5"));
    }
    let inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).collect();
    check_inputs(&inputs)?;
    session.keep_apart(output, &inputs)?;
    let mut background = Background::new(frames.len(), quantile);
    let mut history = None;
    let progress = session.progress("frames", frames.len() as u64);
    for path in frames {
        let frame = session.phase("read", |_| image::open_counts(path))?;
        session.phase("sort", |_| background.add(&frame.pixels).map_err(|refusal| refusal.about(io::name(path))))?;
        history.get_or_insert(frame.history);
        progress.add(1);
    }
    drop(progress);
    let pixels = background.finish().ok_or_else(|| Error::new("background", "no frame", "wanted at least one"))?;
    session.count("frames", frames.len());
    let history = session.history(&history.unwrap_or_default());
    session.phase("write", |_| image::save(output, &pixels, &history))?;
    Ok(Verdict::Done)
}

/// Standard input can be read once.
fn check_inputs(inputs: &[&Path]) -> Result<()> {
    if inputs.iter().filter(|path| **path == Path::new("-")).count() > 1 {
        return Err(Error::new("standard input", "named more than once", "wanted - for one input only"));
    }
    Ok(())
}
