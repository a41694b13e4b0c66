//! The door of lf-calib: what was typed, images in, one call, a camera or an image out.

mod doors;

use clap::{Parser, Subcommand};
use lf_core::cli::{self, Common};
use std::path::PathBuf;
use std::process::ExitCode;

/// White images and particle frames to a camera that can be trusted
#[derive(Parser)]
#[command(
    name = "lf-calib",
    version,
    max_term_width = 100,
    after_help = "Examples:
  lf-calib lattice white.exr -c nominal.json -o camera.json
  lf-calib background frame-*.exr --quantile 0.05 -o background.exr"
)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum Task {
    /// Find the microlens lattice in white images
    ///
    /// Layout, pitch, rotation, offset and smooth departures come from the images. The nominal camera gives the main lens,
    /// the microlens focal length and the pixels, which of the offsets and rotations that mean the same lattice is
    /// written, and whatever else is in its file.
    Lattice(doors::Lattice),
    /// Per-pixel minimum, or a low quantile, of many frames
    ///
    /// Every page of a TIFF is a frame. Frames are read one at a time, those of one page or many; held in memory are that
    /// one, files that come through a pipe, and one image for the minimum whatever the number of frames, or for the
    /// quantile Q of N frames Q (N - 1) + 2 images.
    Background {
        /// Frames of one size, in files of one or of many; - for standard input
        #[arg(default_value = "-")]
        frames: Vec<PathBuf>,
        /// Quantile from 0, the minimum, to 0.5
        #[arg(long, value_name = "Q", default_value_t = 0.0)]
        quantile: f64,
        /// Background image (EXR), - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
    },
}

fn main() -> ExitCode {
    cli::run(
        "lf-calib",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| match &arguments.task {
            Task::Lattice(lattice) => lattice.measure(session),
            Task::Background { frames, quantile, output } => doors::background(frames, *quantile, output, session),
        },
    )
}
