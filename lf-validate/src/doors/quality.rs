//! `quality`: a volume against the true one.

use super::{check_inputs, number, print, verdict};
use lf_core::cli::{Session, Verdict};
use lf_core::volume::Volume;
use lf_core::{Error, Result};
use lf_validate::quality::{Light, Quality, quality};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// The true volume
    truth: PathBuf,
    /// The volume to score
    #[arg(default_value = "-")]
    volume: PathBuf,
    /// Exit code 1 when q is below Q
    #[arg(long, value_name = "Q", value_parser = number, allow_negative_numbers = true)]
    min_q: Option<f64>,
}

/// Reads, scores, prints, judges.
pub fn judge(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    check_inputs(&[&arguments.truth, &arguments.volume], session)?;
    let (truth, volume) =
        session.phase("read", |_| Ok((Volume::open(&arguments.truth)?, Volume::open(&arguments.volume)?)))?;
    let (true_light, light) = (light(&truth)?, light(&volume)?);
    let score = session.phase("score", |_| {
        quality(true_light, light).map_err(|(found, wanted)| Error::new(volume.name(), found, wanted))
    })?;
    for (name, voxels) in [(truth.name(), score.truth_voxels), (volume.name(), score.volume_voxels)] {
        if voxels == 0 {
            session.warn(format!("{name}: every voxel is dark; q is 0"));
        }
    }
    session.count("truth_voxels", score.truth_voxels);
    session.count("volume_voxels", score.volume_voxels);
    print(&score)?;
    Ok(verdict(arguments.min_q.is_none_or(|min_q| is_met(&score, min_q))))
}

fn is_met(score: &Quality, min_q: f64) -> bool {
    score.q >= min_q
}

fn light(volume: &Volume) -> Result<Light<'_>> {
    Ok(Light { grid: volume.grid(), indices: volume.indices(), intensity: volume.require("intensity")? })
}
