//! The door of lf-validate.

mod doors;

use clap::{Parser, Subcommand};
use doors::{displacement, info, quality};
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
    /// not zero. Both files need the column `intensity` and the same grid.
    Quality(quality::Arguments),
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
            Command::Displacement(arguments) => displacement::judge(arguments, session),
            Command::Info(arguments) => info::describe(arguments, session),
        },
    )
}
