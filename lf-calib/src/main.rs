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
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-calib lattice white.exr -c nominal.json -o calibrated.json --plot lattice.svg
  lf-calib background scene/frame-*.exr -o background.exr"
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
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-calib lattice white.exr -c nominal.json -o calibrated.json --plot lattice.svg
  lf-synth white scene/scene.json | lf-calib lattice -c nominal.json --vignetting flat.exr -o flat.json")]
    Lattice(doors::Lattice),
    /// Find the main lens, its distortion and its misalignment from a dot target at known depths
    ///
    /// Free are where the target stands (focus offset, lean, turn), the magnification, and of the rest what the images
    /// clearly ask for: array to sensor distance, focal length, the lattice's offset and rotation, the sensor's tilt,
    /// distortion, the medium. The lenslets' images stay where a white image has shown them: run `lattice` before. A dot must
    /// light five lenslets across at two depths or more; images in which it lights no lenslet whole are left out. All
    /// images are held in memory.
    #[command(after_help = "Examples; the first makes the images of the second:
  lf-synth scene target | lf-synth dots -o target
  lf-calib volume target -c target/camera.json -v -o calibrated.json")]
    Volume {
        /// Folder as lf-synth dots writes it, or images of one size, one a depth
        #[arg(required = true, value_name = "DIR|IMAGES")]
        images: Vec<PathBuf>,
        /// Table of the dots, frame,id,x_mm,y_mm,z_mm,intensity, a frame an image; a folder has its own, dots.csv
        #[arg(long, value_name = "FILE")]
        target: Option<PathBuf>,
        /// In place of a table: spacing of a square grid of dots with one near the axis, mm
        #[arg(long, value_name = "MM", allow_hyphen_values = true)]
        spacing: Option<f64>,
        /// With --spacing: the depth of each image, mm
        #[arg(long, value_name = "Z0,Z1,...", allow_hyphen_values = true)]
        depths: Option<String>,
        /// Camera to start from, camera.json
        #[arg(short, long, value_name = "FILE")]
        camera: PathBuf,
        /// Calibrated camera.json, - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
    },
    /// Mend what has drifted since the last calibration, from ordinary frames of particles
    ///
    /// Where in the stop does the light of bright particles that stand alone come from? Its middle tells where the lattice
    /// is, its size over the frame whether the sensor has tilted. Offset, rotation and tilt are changed where the particles
    /// clearly ask for it; magnification, focal length and distortion, for which particles have no scale, are kept. With
    /// too few particles nothing is written.
    #[command(after_help = "Examples; the first makes the frames of the second:
  lf-synth scene demo --set particles.per_lenslet=0.015 | lf-synth frames -o sparse
  lf-calib refine sparse/frame-*.exr -c sparse/camera.json --depth -5,5 -v -o mended.json")]
    Refine {
        /// Frames of one size
        #[arg(required = true)]
        frames: Vec<PathBuf>,
        /// Camera to mend, camera.json
        #[arg(short, long, value_name = "FILE")]
        camera: PathBuf,
        /// Depths that particles are looked for between, mm
        #[arg(long, value_name = "Z0,Z1", value_parser = cli::numbers::<2>, allow_hyphen_values = true)]
        depth: [f64; 2],
        /// Background image, subtracted from each frame
        #[arg(short, long, value_name = "FILE")]
        background: Option<PathBuf>,
        /// Mended camera.json, - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
    },
    /// Per-pixel minimum, or a low quantile, of many frames
    ///
    /// Every page of a TIFF is a frame. Frames are read one at a time, those of one page or many; held in memory are that
    /// one, files that come through a pipe, and one image for the minimum whatever the number of frames, or for the
    /// quantile Q of N frames Q (N - 1) + 2 images.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-calib background scene/frame-*.exr -o background.exr
  lf-calib background scene/frame-*.exr white.exr --quantile 0.5 -o median.exr")]
    Background {
        /// Frames of one size, in files of one or of many; - for standard input
        #[arg(default_value = "-")]
        frames: Vec<PathBuf>,
        /// Quantile from 0, the minimum, to 0.5
        #[arg(long, value_name = "Q", default_value_t = 0.0)]
        quantile: f64,
        /// Leave out, with a warning, frames that cannot be read or that have another size than this camera's sensor; else
        /// they are an error
        #[arg(short, long, value_name = "FILE")]
        camera: Option<PathBuf>,
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
            Task::Volume { images, target, spacing, depths, camera, output } => {
                let target =
                    doors::Target { table: target.as_deref(), spacing_mm: *spacing, depths_mm: depths.as_deref() };
                doors::main_lens(images, &target, camera, output, session)
            }
            Task::Refine { frames, camera, depth, background, output } => {
                doors::drift(frames, camera, background.as_deref(), *depth, output, session)
            }
            Task::Background { frames, quantile, camera, output } => {
                doors::background(frames, *quantile, camera.as_deref(), output, session)
            }
        },
    )
}
