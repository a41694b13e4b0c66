//! The door of lf-synth: what was typed, scene in, one call, files out.

mod doors;

use clap::{Parser, Subcommand, ValueEnum};
use lf_core::cli::{self, Common, Verdict};
use std::path::PathBuf;
use std::process::ExitCode;

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
struct Arguments {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum Task {
    /// Print a ready scene.json; without NAME, list them
    #[command(after_help = "Examples:
  lf-synth scene
  lf-synth scene core --set particles.per_lenslet=0.5 --set seed=7 > scene.json")]
    Scene {
        /// Which one
        name: Option<String>,
        /// Change a key before printing, as particles.per_lenslet=0.5; null takes it away
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// Render frames, camera, particles and truth into a folder
    #[command(after_help = "Examples:
  lf-synth scene demo | lf-synth frames -o frames
  lf-synth scene core --set particles.per_lenslet=0.5 | lf-synth frames -o core --format tiff")]
    Frames {
        #[command(flatten)]
        source: Source,
        /// Folder for frame-0000.exr ..., camera.json, particles.csv, scene-used.json, and where the scene has a truth
        /// also truth-0000.lfv ... and flow.exr (from the first frame to the second)
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
        /// What frames are written as
        #[arg(long, value_enum, default_value_t = Format::Exr)]
        format: Format,
        /// Also measure the noise of the ray tracing, on 200 particles in the middle against 100 times their rays
        #[arg(long)]
        measure_noise: bool,
        /// Most memory to use, GB
        #[arg(long, value_name = "GB", default_value_t = 8.0)]
        max_memory: f64,
    },
    /// Render a flat field
    #[command(after_help = "Examples:
  lf-synth scene demo | lf-synth white -o white.exr
  lf-synth scene tank --set sensor_noise.bits=12 | lf-synth white --seed 2 -o white.tif")]
    White {
        #[command(flatten)]
        source: Source,
        /// White image (EXR, or 16-bit TIFF by the name .tif), - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
    },
    /// Render what the sensor records without light
    #[command(after_help = "Examples:
  lf-synth scene tank | lf-synth dark -o dark.exr
  lf-synth scene tank --set sensor_noise.dark_counts=100 | lf-synth dark --seed 2 -o dark.tif")]
    Dark {
        #[command(flatten)]
        source: Source,
        /// Dark image (EXR, or 16-bit TIFF by the name .tif), - for standard output
        #[arg(short, long, value_name = "FILE", default_value = "-")]
        output: PathBuf,
    },
    /// Render a target of dots stepped through known depths
    #[command(after_help = "Examples:
  lf-synth scene target | lf-synth dots -o target
  lf-synth scene target --set dots.depths_mm=[-4,4] | lf-synth dots -o two --format tiff")]
    Dots {
        #[command(flatten)]
        source: Source,
        /// Folder for dots-0000.exr ..., dots.csv (places; the depth's number as frame), camera.json, scene-used.json
        #[arg(short, long, value_name = "DIR")]
        output: PathBuf,
        /// What images are written as
        #[arg(long, value_enum, default_value_t = Format::Exr)]
        format: Format,
    },
}

/// The scene, and what a run may change in it.
#[derive(clap::Args)]
struct Source {
    /// scene.json, - for standard input
    #[arg(default_value = "-")]
    scene: PathBuf,
    /// Use this seed instead of the scene's
    #[arg(long)]
    seed: Option<u64>,
}

/// How images are written.
#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// Float, linear counts
    Exr,
    /// 16-bit grey TIFF: rounded, and cut at 0 and 65535
    Tiff,
}

impl Format {
    /// The extension of its files.
    fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Tiff => "tif",
        }
    }
}

fn main() -> ExitCode {
    cli::run(
        "lf-synth",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| {
            match &arguments.task {
                Task::Scene { name, set } => doors::scene(name.as_deref(), set),
                Task::Frames { source, output, format, measure_noise, max_memory } => {
                    let most = max_memory * 1e9;
                    doors::frames::render(source, output, *format, *measure_noise, most, session)
                }
                Task::White { source, output } => doors::white(source, output, session),
                Task::Dark { source, output } => doors::dark(source, output, session),
                Task::Dots { source, output, format } => doors::dots(source, output, *format, session),
            }?;
            Ok(Verdict::Done)
        },
    )
}
