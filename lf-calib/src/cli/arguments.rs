//! The options of `lf-calib`.

use clap::{Args, Parser, Subcommand};
use lf_core::cli::{self, Common};
use std::path::PathBuf;

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
pub struct Arguments {
    #[command(subcommand)]
    pub task: Task,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Subcommand)]
pub enum Task {
    /// Find the microlens lattice in white images
    ///
    /// The images give the layout, pitch, rotation, offset and smooth departures of the lattice. The nominal camera
    /// gives the main lens, the microlens focal length, the pixels and everything else in its file. Several offsets and
    /// rotations describe the same lattice; the ones nearest to the nominal camera are written.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-calib lattice white.exr -c nominal.json -o calibrated.json --plot lattice.svg
  lf-synth white scene/scene.json | lf-calib lattice -c nominal.json --vignetting flat.exr -o flat.json")]
    Lattice(LatticeArguments),
    /// Find the main lens, its distortion and its misalignment from a dot target at known depths
    ///
    /// The position of the target (focus offset, lean, turn) and the magnification are always fitted. Other parameters
    /// are fitted if the images clearly require them: array to sensor distance, focal length, offset and rotation of
    /// the lattice, tilt of the sensor, distortion, the medium. The images of the lenslets stay where a white image has
    /// shown them, so run `lattice` first. A dot must light at least five lenslets across at two depths or more. Images
    /// in which it lights no lenslet completely are left out. All images are held in memory.
    #[command(after_help = "Examples; the first makes the images of the second:
  lf-synth scene target | lf-synth dots -o target
  lf-calib volume target -c target/camera.json -v -o calibrated.json")]
    Volume(VolumeArguments),
    /// Correct a camera for drift since its last calibration, from ordinary frames of particles
    ///
    /// The light of isolated bright particles fills the stop of the main lens. Its middle shows where the lattice is,
    /// and its size over the frame shows whether the sensor has tilted. Offset, rotation and tilt are changed if the
    /// particles clearly require it. Magnification, focal length and distortion are kept, because particles have no
    /// scale. With too few particles nothing is written.
    #[command(after_help = "Examples; the first makes the frames of the second:
  lf-synth scene demo --set particles.per_lenslet=0.015 | lf-synth frames -o sparse
  lf-calib refine sparse/frame-*.exr -c sparse/camera.json --depth -5,5 -v -o refined.json")]
    Refine(RefineArguments),
    /// Per-pixel minimum, or a low quantile, of many frames
    ///
    /// Every page of a TIFF is a frame. Frames are read one at a time. Memory holds this frame, files that come through
    /// a pipe, and one image for the minimum (whatever the number of frames) or Q (N - 1) + 2 images for the quantile Q
    /// of N frames.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-calib background scene/frame-*.exr -o background.exr
  lf-calib background scene/frame-*.exr white.exr --quantile 0.5 -o median.exr")]
    Background(BackgroundArguments),
}

#[derive(Args)]
pub struct LatticeArguments {
    /// White images of one size, averaged; - for standard input
    #[arg(default_value = "-")]
    pub whites: Vec<PathBuf>,
    /// Nominal camera.json
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    /// Dark image of the same size (the sensor's counts without light), subtracted
    #[arg(long, value_name = "FILE")]
    pub dark: Option<PathBuf>,
    /// Table of every lenslet that was read: position of its image, residual, whether it was kept
    #[arg(long, value_name = "FILE.csv")]
    pub centres: Option<PathBuf>,
    /// Flat field (EXR): the white image divided by what even light would give. The camera names this file, and its
    /// frames are divided by it. Give --dark too if the sensor counts without light
    #[arg(long, value_name = "FILE.exr")]
    pub vignetting: Option<PathBuf>,
    /// Picture: the lattice over pieces of the image, departures and residuals over the frame
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Calibrated camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct VolumeArguments {
    /// Folder written by lf-synth dots, or images of one size, one for each depth
    #[arg(required = true, value_name = "DIR|IMAGES")]
    pub images: Vec<PathBuf>,
    /// Table of the dots, frame,id,x_mm,y_mm,z_mm,intensity, one frame for each image, x right and y up in the
    /// picture; a folder has its own, dots.csv
    #[arg(long, value_name = "FILE")]
    pub target: Option<PathBuf>,
    /// Instead of a table: spacing of a square grid of dots with one near the axis, mm
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub spacing: Option<f64>,
    /// With --spacing: the depth of each image, mm
    #[arg(long, value_name = "Z0,Z1,...", allow_hyphen_values = true)]
    pub depths: Option<String>,
    /// Camera to start from, camera.json
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    /// Calibrated camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct RefineArguments {
    /// Frames of one size
    #[arg(required = true)]
    pub frames: Vec<PathBuf>,
    /// Camera to correct, camera.json
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    /// Particles are searched between these depths, mm
    #[arg(long, value_name = "Z0,Z1", value_parser = cli::numbers::<2>, allow_hyphen_values = true)]
    pub depth: [f64; 2],
    /// Background image, subtracted from each frame
    #[arg(short, long, value_name = "FILE")]
    pub background: Option<PathBuf>,
    /// Corrected camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct BackgroundArguments {
    /// Frames of one size, one or many in a file; - for standard input
    #[arg(default_value = "-")]
    pub frames: Vec<PathBuf>,
    /// Quantile from 0, the minimum, to 0.5
    #[arg(long, value_name = "Q", default_value_t = 0.0)]
    pub quantile: f64,
    /// Leave out, with a warning, frames that cannot be read or do not have the size of this camera's sensor. Without
    /// it they are an error
    #[arg(short, long, value_name = "FILE")]
    pub camera: Option<PathBuf>,
    /// Background image (EXR), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}
