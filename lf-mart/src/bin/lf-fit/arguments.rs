//! The options of lf-fit, their defaults and their checks.

use clap::{Parser, ValueEnum};
use lf_core::cli::{Common, ImageOptions, MemoryLimit};
use lf_core::{Error, Result};
use lf_mart::fit::{FitOptions, Free, Given, Shape};
use std::path::PathBuf;

/// Image, camera and volume to particles, by a joint fit to the raw pixels
#[derive(Parser)]
#[command(
    name = "lf-fit",
    version,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-fit volume-0000.lfv -i scene/frame-0000.exr -c camera.json --particles particles-0000.csv
  lf-mart support-0000.lfv -i scene/frame-0000.exr -c camera.json |
      lf-fit -i scene/frame-0000.exr -c camera.json --particles particles.csv -o drawn.lfv --log steps.jsonl"
)]
pub struct Arguments {
    /// Volume (.lfv), as lf-mart writes it: its local maxima are the first particles; - for standard input
    #[arg(default_value = "-")]
    pub volume: PathBuf,
    /// Light-field image (EXR, TIFF, PNG)
    #[arg(short, long, value_name = "FILE")]
    pub image: PathBuf,
    /// Camera (camera.json), as lf-calib writes it
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    /// Image to subtract first; values below zero stay, so that dark pixels keep their mean
    #[arg(short, long, value_name = "FILE")]
    pub background: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Standard deviation of a particle, pixels at the focal plane (pixel pitch over magnification): where its fit begins
    #[arg(long, value_name = "PX", default_value_t = 0.65)]
    pub size: f64,
    /// Shared by all particles and not fitted: their size, or the drift of the camera's lattice
    #[arg(long, value_enum, value_delimiter = ',', value_name = "size,drift")]
    pub hold: Vec<Hold>,
    /// Counts of an electron: a pixel's variance rises by this with each count [default: found from the image]
    #[arg(long, value_name = "COUNTS")]
    pub gain: Option<f64>,
    /// Standard deviation of a pixel without light, counts [default: found from the image]
    #[arg(long, value_name = "COUNTS")]
    pub read_noise: Option<f64>,
    /// Most rounds of dropping, splitting and adding particles
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub rounds: usize,
    /// Number of the frame in the table
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub frame: usize,
    /// Camera (camera.json) with the lattice where the fit finds it
    #[arg(long, value_name = "FILE")]
    pub camera_out: Option<PathBuf>,
    /// Write one line of JSON for each step: particles, changes, misfit, size, drift, noise, seconds since the beginning
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// Only print the resources needed: {"memory_bytes", "voxels"} as JSON on standard output
    #[arg(long)]
    pub estimate: bool,
    /// Particles (.csv) with their uncertainties, - for standard output
    #[arg(long, value_name = "FILE", default_value = "-")]
    pub particles: PathBuf,
    /// Volume (.lfv) on the same grid in which each particle is drawn as a Gaussian, - for standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub memory: MemoryLimit,
    #[command(flatten)]
    pub common: Common,
}

/// A part of the shape that is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Hold {
    /// The size of particles
    Size,
    /// The drift of the lattice
    Drift,
}

impl Arguments {
    /// The options of the fit. Refuses numbers outside their ranges.
    pub fn options(&self) -> Result<FitOptions> {
        for (option, value, least, most) in [
            ("--size", self.size, 0.15, 5.0),
            ("--gain", self.gain.unwrap_or(1.0), 1e-9, 1e9),
            ("--read-noise", self.read_noise.unwrap_or(1.0), 1e-9, 1e9),
            ("--rounds", self.rounds as f64, 0.0, 100.0),
        ] {
            if !(least..=most).contains(&value) {
                return Err(Error::new(option, format!("{value}"), format!("wanted {least} to {most}")));
            }
        }
        Ok(FitOptions {
            shape: Shape { sigma_px: self.size, drift_px: [0.0; 2] },
            free: Free { size: !self.hold.contains(&Hold::Size), drift: !self.hold.contains(&Hold::Drift) },
            noise: Given { gain: self.gain, read_variance: self.read_noise.map(|sigma| sigma * sigma) },
            rounds: self.rounds,
        })
    }
}
