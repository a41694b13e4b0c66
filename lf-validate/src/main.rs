//! The door of lf-validate.

mod doors;

use clap::{Parser, Subcommand};
use doors::{curves, displacement, info, line, quality, trade};
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
    /// One run as one line of JSON, of its settings and of what tools wrote about it
    ///
    /// KEY=VALUE is a setting: a number, true or false, or else text. FILE is JSON of any tool, scores or --stats: its keys,
    /// nested ones joined with dots (counts.kept); lists of numbers stay, other lists are left out. NAME:FILE puts `NAME.`
    /// before them. An argument is a setting where `=` comes before any `:` and `/`. A key given twice is refused. Lines
    /// of many runs are what `curves` and `trade` read; a factor of a study is best named set.KEY, its seed set.seed.
    Line(line::Arguments),
    /// Runs as curves: medians over seeds, with their spread
    ///
    /// Runs with equal --panel, --by and x are one group: they differ in their seed. median, low and high: its median,
    /// least and greatest value; runs: how many have a number there. Where x and y are lists, such as a profile, each run
    /// is a curve and all is taken bin by bin; the bins of a series' runs must agree, and x with one number more than y is
    /// the edges of bins, told by their centres. Numeric series are sorted by number. Runs that lack a key are left out and
    /// counted in a warning. In the picture the line is the median, the area least to greatest.
    Curves(curves::Arguments),
    /// Cost against error of settings: the Pareto front, and each factor's own effect
    ///
    /// Runs of one name, which differ in set.seed only, are a setting: cost, error and memory are medians over them, *_range
    /// least and greatest. front: settings for which no other has both less or equal cost and error, with one of them
    /// strictly less; by rising cost. dominated_by: of the front, the setting with at most this cost and the least error.
    /// With --base, factors: settings that differ from the base in exactly one key set.KEY, by that key, with cost, error
    /// and memory over the base's (*_ratio); ungrouped: settings that differ in more keys, or in none. Runs without name,
    /// cost or error are left out and counted in a warning.
    Trade(trade::Arguments),
}

fn main() -> ExitCode {
    cli::run(
        "lf-validate",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| match &arguments.command {
            Command::Quality(arguments) => quality::judge(arguments, session),
            Command::Displacement(arguments) => displacement::judge(arguments, session),
            Command::Info(arguments) => info::describe(arguments, session),
            Command::Line(arguments) => line::join(arguments, session),
            Command::Curves(arguments) => curves::plot(arguments, session),
            Command::Trade(arguments) => trade::judge(arguments, session),
        },
    )
}
