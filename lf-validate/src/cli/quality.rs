//! `quality`: a volume against the true one.

use super::limits::{counts, is_at_most, number, verdict};
use super::output::{Picture, print};
use lf_core::cli::MemoryLimit;
use lf_core::{Error, JoinedVolume, Result, Session, Verdict};
use lf_validate::pictures;
use lf_validate::scores::light::VoxelLight;
use lf_validate::scores::quality::{quality, quality_bytes};
use std::path::PathBuf;

/// Upper limit of `--regions`. Each box takes some hundred bytes and a number in each list of the score.
const MOST_REGIONS: usize = 1_000_000;

/// Q factor, ghosts and missed light of a volume
///
/// E1 is the volume and E0 the truth. A voxel that a file does not hold is 0. Both files need the
/// column `intensity` and the same grid.
///
///   q               sum E1 E0 / sqrt(sum E1^2 sum E0^2) over all voxels; 0 if either is dark
///   scale           factor on the volume that brings it closest to the truth in least squares
///   ghost_share     share of the volume's light in voxels where the truth is 0
///   missed_share    share of the true light in voxels where the volume is 0
///   max_difference  largest |E1 - E0| of a voxel over the largest |E0|
///   truth_voxels, volume_voxels, shared_voxels
///                   voxels that are not 0: in the truth, in the volume, in both
///   truth_sum, volume_sum
///                   sum of the intensities, counts
///   by_depth        the same for each slice across z, at z_mm
///   by_region       the same for boxes that divide the grid, at centre_mm, x fastest
///
/// A share is null if there is no light at all.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate quality scene/truth-0000.lfv volume-0000.lfv --min-q 0.8 --plot quality.svg
  lf-validate quality scene/truth-0000.lfv volume-0000.lfv --regions 1,1,5"
)]
pub struct QualityArguments {
    /// The true volume
    truth: PathBuf,
    /// The volume to score, or all its tiles (lf-prune --tile) in any order
    #[arg(default_value = "-")]
    volume: Vec<PathBuf>,
    /// Boxes along x, y, z to score one by one [default: 3,3,3, at most one a voxel]
    #[arg(long, value_name = "X,Y,Z", value_parser = counts::<3>)]
    regions: Option<[usize; 3]>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when q is below Q
    #[arg(long, help_heading = "Limits", value_name = "Q", value_parser = number, allow_negative_numbers = true)]
    min_q: Option<f64>,
    /// Exit code 1 when ghost_share is above SHARE
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = number)]
    max_ghosts: Option<f64>,
    /// Exit code 1 when missed_share is above SHARE
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = number)]
    max_missed: Option<f64>,
    /// Exit code 1 when max_difference is above SHARE
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = number)]
    max_difference: Option<f64>,
}

/// Scores a volume against the truth.
pub fn judge(arguments: &QualityArguments, limit: MemoryLimit, session: &mut Session) -> Result<Verdict> {
    let inputs = || [&arguments.truth].into_iter().chain(&arguments.volume);
    arguments.picture.check(inputs(), session)?;
    if let Some(regions) = arguments.regions.filter(|regions| !(1..=MOST_REGIONS).contains(&regions.iter().product())) {
        let wanted = format!("wanted 1 to {MOST_REGIONS} boxes in all");
        return Err(Error::new("--regions", format!("{regions:?}"), wanted));
    }
    let volumes = session.phase("read", |_| JoinedVolume::open_all(inputs().map(PathBuf::as_path), "intensity"))?;
    if volumes.len() != 2 {
        let names: Vec<&str> = volumes.iter().map(JoinedVolume::name).collect();
        let found = format!("{} volumes", volumes.len());
        return Err(Error::new(names.join(", "), found, "wanted truth and volume, each a file or all its tiles"));
    }
    let [truth, volume] = [0, 1].map(|n| &volumes[n]);
    let (true_light, light) = (light(truth), light(volume));
    let regions = arguments.regions.unwrap_or_else(|| truth.grid().shape.map(|voxels| voxels.min(3)));
    let bytes = quality_bytes(truth.grid(), regions);
    session.allow_memory(limit, bytes, truth.name(), || format!("a {}", truth.grid()))?;
    let score = session
        .phase("score", |_| quality(true_light, light, regions).map_err(|refusal| refusal.about(volume.name())))?;
    let ([x, y, z], whole) = (regions, &score.whole);
    session.explain(format!("{x} x {y} x {z} regions; {} voxels lit in the truth", whole.truth_voxels));
    session.count("truth_voxels", whole.truth_voxels);
    session.count("volume_voxels", whole.volume_voxels);
    arguments.picture.draw(session, || pictures::quality(&score))?;
    print(&score)?;
    for (name, voxels) in [(truth.name(), whole.truth_voxels), (volume.name(), whole.volume_voxels)] {
        if voxels == 0 {
            session.warn(format!("{name}: every voxel is dark; q is 0"));
        }
    }
    Ok(verdict(
        arguments.min_q.is_none_or(|least| whole.q >= least)
            && is_at_most(whole.ghost_share, arguments.max_ghosts)
            && is_at_most(whole.missed_share, arguments.max_missed)
            && is_at_most(whole.max_difference, arguments.max_difference),
    ))
}

fn light(volume: &JoinedVolume) -> VoxelLight<'_> {
    VoxelLight { grid: volume.grid(), indices: volume.indices(), intensity: volume.values() }
}
