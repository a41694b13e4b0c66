//! `lf-calib lattice`.

use super::{check_inputs, with_history};
use lf_calib::{ImageLattice, Refusal, White, calibrate, lattice, overlap};
use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict};
use lf_core::{Result, image, io};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Departure from a perfect lattice at the frame's corners that is worth a warning, px: a fiftieth of a lenslet of the
/// seed camera, and thirty times what the lattice of a good white image is known to.
const NOTABLE_DEPARTURE_PX: f64 = 0.3;

/// Overlap that is worth a warning: matched f-numbers and what pitches are given to stay below.
const NOTABLE_OVERLAP: f64 = 1.03;

/// White images and a nominal camera in, a camera out.
pub fn measure(whites: &[PathBuf], camera: &Path, output: &Path, session: &mut Session) -> Result<Verdict> {
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
