//! The door of lf-validate.

mod doors;

use clap::{Parser, Subcommand};
use doors::{depth, displacement, elongation, info, quality};
use lf_core::cli::{self, Common};
use std::process::ExitCode;

/// Result and truth to scores
///
/// Scores are one JSON object on standard output; a number that does not exist, such as an error without vectors, is
/// null. Exit codes: 0 done, 1 judged and the answer is no, 2 could not do the work.
#[derive(Parser)]
#[command(name = "lf-validate", version, propagate_version = true, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum Command {
    /// Q factor, ghosts and missed light of a volume
    ///
    /// q = sum E1 E0 / sqrt(sum E1^2 sum E0^2) over all voxels, 0 where either volume is dark. scale: the factor on the
    /// volume that brings it closest to the truth. ghost_share: share of the volume's light in voxels where the truth is
    /// zero. missed_share: share of the truth's light in voxels that the volume leaves zero. *_voxels: voxels that are
    /// not zero. by_depth and by_region: the same for each slice across z and for each box, null where there is no light to
    /// take a share of. Both files need the column `intensity` and the same grid.
    Quality(quality::Arguments),
    /// Diameters of reconstructed particles along x, y and z
    ///
    /// diameter: as the paper takes it, where a particle has fallen to exp(-2) of its peak, 3 voxels for its ideal particle,
    /// a Gaussian of 0.75 voxel. half_maximum: the full width at half maximum. Both are read along the three lines of
    /// voxels through the brightest voxel near a particle's true place, between voxels as a Gaussian falls. median, p10
    /// and p90 of all particles, in vox, mm and, with --camera, px of the focal plane. histogram: shares of the particles in
    /// bins of half a voxel. by_depth: medians in twenty slabs. Not measured are particles without light near them
    /// (missed), with a brightest voxel that is nearer to another particle (merged), and at the end of the grid (cut).
    Elongation(elongation::Arguments),
    /// Light along z: profile, brightest voxel per slice, light outside the lit slab
    ///
    /// profile: light of each slice across z, mean of the volumes. peak: brightest voxel of each slice, mean of the
    /// volumes. With --slab: outside_share, of all light, in slices whose middle is outside; outside_peak, the brightest slice outside
    /// over the mean of those inside. unevenness: standard deviation over mean of the slices in the slab.
    Depth(depth::Arguments),
    /// Error of a vector field: bias, RMS, standard deviation and median per component
    ///
    /// error = measured - true; the truth is interpolated to the places of the measured vectors, and vectors outside it
    /// are counted (outside_truth) and not scored, nor are places without data (no_data). Units: mm; vox, the voxels
    /// correlated; px, pixels at the focal plane, only with --camera. outliers: vectors more than 5 robust standard
    /// deviations and 0.1 voxel from the median error; they stay in every number. The object measured_only leaves out the
    /// replaced vectors.
    Displacement(displacement::Arguments),
    /// What any of the chain's files is, in one screen
    Info(info::Arguments),
}

fn main() -> ExitCode {
    cli::run(
        "lf-validate",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| match &arguments.command {
            Command::Quality(arguments) => quality::judge(arguments, session),
            Command::Elongation(arguments) => elongation::judge(arguments, session),
            Command::Depth(arguments) => depth::judge(arguments, session),
            Command::Displacement(arguments) => displacement::judge(arguments, session),
            Command::Info(arguments) => info::describe(arguments, session),
        },
    )
}
