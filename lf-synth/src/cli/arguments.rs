//! The command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use lf_core::cli::{Common, ImageOptions, MemoryLimit};
use std::path::PathBuf;

/// Particles and a flow to light-field images and the truth, by ray tracing
#[derive(Parser)]
#[command(
    name = "lf-synth",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples:
  lf-synth scene demo > scene.json && lf-synth frames scene.json -o frames
  lf-synth scene tank --set sensor_noise.bits=12 | lf-synth white -o white.tif"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub task: Task,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Subcommand)]
pub enum Task {
    /// Print a ready scene.json; without NAME, list them
    #[command(after_help = "Examples:
  lf-synth scene
  lf-synth scene core --set particles.per_lenslet=0.5 --set seed=7 > scene.json")]
    Scene {
        /// Name of the scene
        name: Option<String>,
        /// Change a key before printing, such as particles.per_lenslet=0.5; null removes it
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// Render frames, camera, particles and truth into a folder
    #[command(after_help = "Examples:
  lf-synth scene demo | lf-synth frames -o frames
  lf-synth scene core --set particles.per_lenslet=0.5 | lf-synth frames -o core --format tiff")]
    Frames(FramesArguments),
    /// Render a white image (flat field)
    #[command(after_help = "Examples:
  lf-synth scene demo | lf-synth white -o white.exr
  lf-synth scene tank --set sensor_noise.bits=12 | lf-synth white --seed 2 -o white.tif")]
    White(ImageArguments),
    /// Render the image that the sensor records without light
    #[command(after_help = "Examples:
  lf-synth scene tank | lf-synth dark -o dark.exr
  lf-synth scene tank --set sensor_noise.dark_counts=100 | lf-synth dark --seed 2 -o dark.tif")]
    Dark(ImageArguments),
    /// Render a target of dots stepped through known depths
    #[command(after_help = "Examples:
  lf-synth scene target | lf-synth dots -o target
  lf-synth scene target --set dots.depths_mm=[-4,4] | lf-synth dots -o two --format tiff")]
    Dots {
        #[command(flatten)]
        source: SceneSource,
        /// Folder for dots-0000.exr ..., dots.csv (places; frame is the number of the depth), camera.json,
        /// scene-used.json
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
        /// File format of the images
        #[arg(long, value_enum, default_value_t = ImageFormat::Exr)]
        format: ImageFormat,
    },
}

#[derive(Args)]
pub struct FramesArguments {
    #[command(flatten)]
    pub source: SceneSource,
    /// Folder for frame-0000.exr ..., particles.csv, camera.json and scene-used.json, which is written last; if the
    /// scene has a truth, also for truth-0000.lfv ... and flow.exr (from the first frame to the second)
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// File format of the frames
    #[arg(long, value_enum, default_value_t = ImageFormat::Exr)]
    pub format: ImageFormat,
    /// Also measure the noise of the ray tracing, on 200 particles in the middle against 100 times their rays
    #[arg(long)]
    pub measure_noise: bool,
}

#[derive(Args)]
pub struct ImageArguments {
    #[command(flatten)]
    pub source: SceneSource,
    /// Image (EXR, or 16-bit TIFF if the name ends in .tif), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct SceneSource {
    /// scene.json, - for standard input
    #[arg(default_value = "-")]
    pub scene: PathBuf,
    /// Use this seed instead of the scene's
    #[arg(long)]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub reading: ImageOptions,
    #[command(flatten)]
    pub memory: MemoryLimit,
}

#[derive(Clone, Copy, ValueEnum)]
pub enum ImageFormat {
    /// Float, linear counts
    Exr,
    /// 16-bit grey TIFF: rounded, and cut at 0 and 65535
    Tiff,
}

impl ImageFormat {
    pub fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Tiff => "tif",
        }
    }
}
