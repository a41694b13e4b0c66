//! The options that every tool has.

use std::path::PathBuf;

/// Options that mean the same in every tool; `#[command(flatten)]` it at the top of a tool's arguments.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Worker threads; 0 takes every core
    #[arg(long, value_name = "N", default_value_t = 0, global = true)]
    pub threads: usize,
    /// Write seconds per phase, peak memory and counts to FILE as JSON
    #[arg(long, value_name = "FILE", global = true)]
    pub stats: Option<PathBuf>,
    /// Print errors only
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Say what was decided and why
    #[arg(short, long, global = true)]
    pub verbose: bool,
}
