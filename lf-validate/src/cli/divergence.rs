//! `divergence`: a vector field without the truth.

use super::inputs::{check_inputs, pixel_mm};
use super::limits::{are_at_most, components, is_at_most, number, verdict};
use super::picture::Picture;
use super::print::print;
use lf_core::cli::{Session, Verdict};
use lf_core::field::Field;
use lf_core::{Result, io};
use lf_validate::pictures;
use lf_validate::scores::divergence::divergence;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// The field to score
    #[arg(default_value = "-")]
    field: PathBuf,
    /// Camera that gives the size of a pixel
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when the RMS divergence is above RMS
    #[arg(long, value_name = "RMS", value_parser = number)]
    max_divergence: Option<f64>,
    /// Exit code 1 when a component's noise is above PX pixels: one number, or three for u,v,w
    #[arg(long, value_name = "PX", value_parser = number, value_delimiter = ',', requires = "camera")]
    max_noise: Vec<f64>,
}

/// Reads, scores, prints, judges.
pub fn judge(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let mut inputs: Vec<&Path> = vec![&arguments.field];
    inputs.extend(arguments.camera.as_deref());
    check_inputs(&inputs, session)?;
    arguments.picture.check(&inputs, session)?;
    let noise_px = components("--max-noise", &arguments.max_noise)?;
    let (field, pixel_mm) = session.phase("read", |_| {
        let pixel_mm = pixel_mm(arguments.camera.as_deref())?;
        Ok((Field::open(&arguments.field)?, pixel_mm))
    })?;
    let score = session.phase("score", |_| Ok(divergence(&field, pixel_mm)))?;
    session.count("places", score.count);
    arguments.picture.draw(session, || pictures::divergence(&score))?;
    print(&score)?;
    if score.count == 0 {
        let [x, y, z] = score.stride;
        session.warn(format!(
            "{}: no place has data at its six neighbours {x}, {y} and {z} vectors away",
            io::name(&arguments.field)
        ));
    }
    Ok(verdict(is_at_most(Some(score.rms), arguments.max_divergence) && are_at_most(score.noise.px(), noise_px)))
}
