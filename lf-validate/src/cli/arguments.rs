//! The subcommands, and the options that all of them share.

use super::{
    depth, displacement, divergence, elongation, ensemble, export, info, particles, precision, quality, report, score,
    self_check, split,
};
use clap::{Parser, Subcommand};
use lf_core::cli::{Common, MemoryLimit};

/// Results and truths to scores
///
/// A score is one JSON object on standard output; a terminal gets ten lines of it, or all with --full. A number that
/// does not exist, such as an error without vectors, is null. The help of each subcommand defines its numbers. Exit
/// codes: 0 done, 1 scored, but a limit is not kept, 2 could not do the work.
#[derive(Parser)]
#[command(
    name = "lf-validate",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate quality scene/truth-0000.lfv volume-0000.lfv --min-q 0.8 --plot quality.svg
  lf-validate info camera.json"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
    /// Print the whole score on a terminal, not only ten lines of it
    #[arg(long, global = true)]
    pub full: bool,
    #[command(flatten)]
    pub memory: MemoryLimit,
    #[command(flatten)]
    pub common: Common,
}

// Each subcommand's help stands above its own options.
#[derive(Subcommand)]
pub enum Command {
    Quality(quality::QualityArguments),
    Elongation(elongation::ElongationArguments),
    Particles(particles::ParticlesArguments),
    Depth(depth::DepthArguments),
    Displacement(displacement::DisplacementArguments),
    Divergence(divergence::DivergenceArguments),
    Ensemble(ensemble::EnsembleArguments),
    Precision(precision::PrecisionArguments),
    Score(score::ScoreArguments),
    Split(split::SplitArguments),
    #[command(name = "self")]
    SelfCheck(self_check::SelfArguments),
    Info(info::InfoArguments),
    Export(export::ExportArguments),
    Report(report::ReportArguments),
}
