//! `displacement`: a vector field against the true one.

use super::{check_inputs, number, print, verdict};
use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict};
use lf_core::field::Field;
use lf_core::{Error, Result, io};
use lf_validate::displacement::{Displacement, displacement};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// The true field; it may have another layout
    truth: PathBuf,
    /// The field to score
    #[arg(default_value = "-")]
    field: PathBuf,
    /// Camera that gives the size of a pixel
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Exit code 1 when an RMS error is above PX pixels: one number, or three for u,v,w
    #[arg(long, value_name = "PX", value_parser = number, value_delimiter = ',', requires = "camera")]
    max_rms: Vec<f64>,
}

/// Reads, scores, prints, judges.
pub fn judge(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let mut inputs: Vec<&Path> = vec![&arguments.truth, &arguments.field];
    inputs.extend(arguments.camera.as_deref());
    check_inputs(&inputs, session)?;
    let limits_px = limits_px(&arguments.max_rms)?;
    let (truth, field, camera) = session.phase("read", |_| {
        let camera = arguments.camera.as_deref().map(Camera::open).transpose()?;
        Ok((Field::open(&arguments.truth)?, Field::open(&arguments.field)?, camera))
    })?;
    let pixel_mm = camera.map(|camera| camera.voxel_spacing_mm([1.0; 3])[0]);
    let score = session.phase("score", |_| Ok(displacement(&truth, &field, pixel_mm)))?;
    if score.all.vectors == 0 {
        session.warn(format!("{}: no vector could be scored: {}", io::name(&arguments.field), reasons(&score)));
    }
    session.count("vectors", score.all.vectors);
    print(&score)?;
    Ok(verdict(limits_px.is_none_or(|limits| keeps(&score, limits))))
}

fn limits_px(max_rms: &[f64]) -> Result<Option<[f64; 3]>> {
    match *max_rms {
        [] => Ok(None),
        [all] => Ok(Some([all; 3])),
        [u, v, w] => Ok(Some([u, v, w])),
        _ => Err(Error::new("--max-rms", format!("{} numbers", max_rms.len()), "wanted one, or three for u,v,w")),
    }
}

/// Whether every RMS error is within its limit; a field without a scored vector keeps none.
fn keeps(score: &Displacement, limits_px: [f64; 3]) -> bool {
    let rms = score.all.rms_px().unwrap_or([f64::NAN; 3]);
    (0..3).all(|axis| rms[axis] <= limits_px[axis])
}

fn reasons(score: &Displacement) -> String {
    let Displacement { places, no_data, outside_truth, .. } = score;
    format!("of {places}, {no_data} without data, {outside_truth} outside the truth")
}
