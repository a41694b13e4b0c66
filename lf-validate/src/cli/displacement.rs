//! `displacement`: a vector field against the true displacement.

use super::inputs::{check_inputs, pixel_mm};
use super::limits::{are_at_most, components, number, share, verdict};
use super::picture::Picture;
use super::print::print;
use super::truth;
use lf_core::cli::{Session, Verdict};
use lf_core::field::Field;
use lf_core::{Result, io};
use lf_validate::pictures;
use lf_validate::scores::displacement::{Displacement, ParticleCounts, displacement};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Arguments {
    /// What the true displacement is known from: a field (it may have another layout), a scene.json with a steady flow, or
    /// a particles.csv
    truth: PathBuf,
    /// The field to score
    #[arg(default_value = "-")]
    field: PathBuf,
    /// Camera that gives the size of a pixel
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// The two frames of a particles.csv that the field lies between [default: 0,1]
    #[arg(long, value_name = "A,B", value_parser = frames)]
    frames: Option<[usize; 2]>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when an RMS error is above PX pixels: one number, or three for u,v,w
    #[arg(long, value_name = "PX", value_parser = number, value_delimiter = ',', requires = "camera")]
    max_rms: Vec<f64>,
    /// Exit code 1 when a mean error is further than PX pixels from 0: one number, or three for u,v,w
    #[arg(long, value_name = "PX", value_parser = number, value_delimiter = ',', requires = "camera")]
    max_bias: Vec<f64>,
    /// Exit code 1 when more than this share of the vectors are outliers, 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    max_outliers: Option<f64>,
    /// Exit code 1 when a component has less than this share of its errors within the stated uncertainty, 0 to 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_coverage: Option<f64>,
}

/// Limits as judged; none where not asked for.
struct Limits {
    rms_px: Option<[f64; 3]>,
    bias_px: Option<[f64; 3]>,
    outliers: Option<f64>,
    coverage: Option<f64>,
}

/// Reads, scores, prints, judges.
pub fn judge(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let mut inputs: Vec<&Path> = vec![&arguments.truth, &arguments.field];
    inputs.extend(arguments.camera.as_deref());
    check_inputs(&inputs, session)?;
    arguments.picture.check(&inputs, session)?;
    let limits = Limits {
        rms_px: components("--max-rms", &arguments.max_rms)?,
        bias_px: components("--max-bias", &arguments.max_bias)?,
        outliers: arguments.max_outliers,
        coverage: arguments.min_coverage,
    };
    let (truth, field, pixel_mm) = session.phase("read", |session| {
        let pixel_mm = pixel_mm(arguments.camera.as_deref())?;
        let truth = truth::open(&arguments.truth, arguments.frames, &arguments.picture, session)?;
        Ok((truth, Field::open(&arguments.field)?, pixel_mm))
    })?;
    session.explain(match pixel_mm {
        None => "numbers in mm and voxels: pixels need --camera".to_string(),
        Some(pixel_mm) => format!("a pixel at the focal plane is {pixel_mm:.6} mm"),
    });
    let score = session.phase("score", |_| Ok(displacement(&truth, &field, pixel_mm)))?;
    session.count("vectors", score.all.vectors);
    arguments.picture.draw(session, || pictures::displacement(&score))?;
    print(&score)?;
    if score.all.vectors == 0 {
        let name = io::name(&arguments.field);
        session.warn(format!("{name}: no vector could be scored: {}", reasons(&score)));
    }
    Ok(verdict(keeps(&score, &limits)))
}

/// Whether every number is within its limit; a field without a scored vector, or without a stated uncertainty, keeps none.
fn keeps(score: &Displacement, limits: &Limits) -> bool {
    are_at_most(score.all.rms_px(), limits.rms_px)
        && are_at_most(score.all.bias_px().map(|bias| bias.map(f64::abs)), limits.bias_px)
        && limits.outliers.is_none_or(|most| score.all.outlier_share() <= most)
        && limits.coverage.is_none_or(|least| score.uncertainty.within_1.iter().all(|share| *share >= least))
}

fn reasons(score: &Displacement) -> String {
    let Displacement { places, no_data, outside_truth, .. } = score;
    match score.particles {
        Some(ParticleCounts { particles, outside_field, .. }) => {
            format!("of {particles} particles, {outside_field} outside the field")
        }
        None => format!("of {places}, {no_data} without data, {outside_truth} outside the truth"),
    }
}

fn frames(text: &str) -> std::result::Result<[usize; 2], String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let frames = numbers.and_then(|numbers| <[usize; 2]>::try_from(numbers).ok());
    frames.ok_or_else(|| "wanted two frame numbers between commas".to_string())
}
