//! `depth`: where along z the light of volumes lies.

use super::inputs::{light, open_whole};
use super::limits::{is_at_most, number, verdict};
use super::output::{Picture, print};
use lf_core::cli::{MemoryLimit, numbers};
use lf_core::{Error, Result, Session, Verdict};
use lf_validate::pictures;
use lf_validate::scores::depth::DepthSums;
use std::path::PathBuf;

/// Light along z: profile, brightest voxel per slice, light outside the lit slab
///
/// Volumes of one grid are added up. Slices are across z, one voxel thick, at z_mm.
///
///   light          sum of the intensities of a volume, counts, mean over the volumes
///   profile        light of each slice, mean over the volumes
///   peak           brightest voxel of each slice, mean over the volumes
///   mean_z_mm, std_z_mm
///                  mean and standard deviation of the depth of the light
///   unevenness     standard deviation over mean of the light of the slices in the slab, or of all
///   outside_share  with --slab: share of the light in slices with their middle outside it
///   outside_peak   with --slab: light of the brightest slice outside over the mean slice inside
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate depth volume-000?.lfv --plot depth.svg
  lf-validate depth volume-000?.lfv --slab -4,4 --max-outside 0.3"
)]
pub struct DepthArguments {
    /// Volumes of one grid
    #[arg(default_value = "-")]
    volumes: Vec<PathBuf>,
    /// The lit slab: depths between which there should be light, mm
    #[arg(long, value_name = "Z0,Z1", value_parser = numbers::<2>, allow_hyphen_values = true)]
    slab: Option<[f64; 2]>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when outside_share is above SHARE
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = number, requires = "slab")]
    max_outside: Option<f64>,
}

/// Scores the light of volumes along z.
pub fn judge(arguments: &DepthArguments, limit: MemoryLimit, session: &mut Session) -> Result<Verdict> {
    arguments.picture.check(&arguments.volumes, session)?;
    if let Some([low, high]) = arguments.slab.filter(|[low, high]| low >= high) {
        return Err(Error::new("--slab", format!("{low},{high}"), "wanted the lower depth first"));
    }
    let sums = session.phase("score", |session| {
        let progress = session.progress("volumes", arguments.volumes.len() as u64);
        let mut sums: Option<DepthSums> = None;
        // One volume is in memory at a time.
        for input in &arguments.volumes {
            let volume = open_whole(input)?;
            let (grid, name) = (volume.grid(), volume.name());
            if sums.is_none() {
                let bytes = DepthSums::bytes(grid, arguments.picture.is_asked());
                session.allow_memory(limit, bytes, name, || format!("a {grid}"))?;
            }
            let sums = sums.get_or_insert_with(|| DepthSums::new(grid));
            sums.add(light(&volume)?).map_err(|refusal| refusal.about(name))?;
            progress.add(1);
        }
        sums.ok_or_else(|| Error::new("VOLUMES", "none", "wanted at least one"))
    })?;
    let score = sums.score(arguments.slab);
    session.count("volumes", score.volumes);
    arguments.picture.draw(session, || pictures::depth(&score))?;
    print(&score)?;
    if score.light <= 0.0 {
        session.warn("every voxel is dark");
    }
    Ok(verdict(is_at_most(score.outside_share, arguments.max_outside)))
}
