//! The options of lf-fit, their defaults and their checks.

use clap::{Parser, ValueEnum};
use lf_core::cli::{Common, ImageOptions, MemoryLimit};
use lf_core::{Error, Result};
use lf_fit::{FitOptions, Free, KnownNoise, Shape};
use std::path::PathBuf;

/// Headings of the help.
const FIT: &str = "Fit";
const OUTPUT: &str = "Output";
const EXPERIMENTS: &str = "For experiments";

/// Image, camera and support to particles, by a joint fit to the raw pixels
#[derive(Parser)]
#[command(
    name = "lf-fit",
    version,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-fit support-0000.lfv -i scene/frame-0000.exr -c camera.json --particles particles-0000.csv
  lf-prune scene/frame-0000.exr -c camera.json --pvr 4,4,r --depth -5,5 |
      lf-fit -i scene/frame-0000.exr -c camera.json --particles particles.csv -o drawn.lfv"
)]
pub struct Arguments {
    /// Support (.lfv) of lf-prune, or volume of lf-mart, whose local maxima are then the first particles; one for each
    /// camera
    #[arg(default_value = "-")]
    pub volume: Vec<PathBuf>,
    /// Light-field image (EXR, TIFF, PNG); again for each further camera of the same moment
    #[arg(short, long, value_name = "FILE", required = true)]
    pub image: Vec<PathBuf>,
    /// Camera (camera.json) of lf-calib; again for each image, with a 'pose'. Particles are written in the frame of the
    /// first
    #[arg(short, long, value_name = "FILE", required = true)]
    pub camera: Vec<PathBuf>,
    /// Image to subtract first; none, or one for each image. Values below zero stay, so that dark pixels keep their
    /// mean
    #[arg(short, long, value_name = "FILE")]
    pub background: Vec<PathBuf>,
    /// Image of the frame's size that is 0 where a wall or a reflection is: such pixels say nothing; none, or one for
    /// each image
    #[arg(long, value_name = "FILE")]
    pub mask: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Only print the resources needed: {"memory_bytes", "voxels"} as JSON on standard output
    #[arg(long)]
    pub estimate: bool,
    /// First standard deviation of a particle, pixels at the focal plane (pixel pitch over magnification)
    #[arg(long, value_name = "PX", default_value_t = 0.65, help_heading = FIT)]
    pub size: f64,
    /// Particles (.csv) of the frame before. The fit begins at them and finds the others in what they leave of the
    /// image. A table of several frames must hold the frame before --frame
    #[arg(long, value_name = "FILE", help_heading = FIT)]
    pub start: Option<PathBuf>,
    /// Field of displacements that moves the particles of --start to this frame
    #[arg(long, value_name = "FILE", requires = "start", help_heading = FIT)]
    pub start_field: Option<PathBuf>,
    /// Keep as given instead of fitting: the usual size of particles, that all have it, the drift of the lattice, the
    /// blur of a camera that has one, other parameters of a camera that does not explain its image, or the poses of
    /// further cameras
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "size,sizes,drift,blur,camera,pose",
        hide_possible_values = true,
        help_heading = FIT
    )]
    pub hold: Vec<Hold>,
    /// Counts of an electron: a pixel's variance rises by this with each count [default: found from the image]
    #[arg(long, value_name = "COUNTS", help_heading = FIT)]
    pub gain: Option<f64>,
    /// Standard deviation of a pixel without light, counts [default: found from the image]
    #[arg(long, value_name = "COUNTS", help_heading = FIT)]
    pub read_noise: Option<f64>,
    /// Largest number of rounds of dropping and splitting particles
    #[arg(long, value_name = "N", default_value_t = 5, help_heading = EXPERIMENTS, hide = true)]
    pub rounds: usize,
    /// Particles (.csv) with their uncertainties, - for standard output
    #[arg(long, value_name = "FILE", default_value = "-", help_heading = OUTPUT)]
    pub particles: PathBuf,
    /// Number of the frame in the table
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = OUTPUT)]
    pub frame: usize,
    /// Volume (.lfv) on the same grid with a Gaussian for each particle, - for standard output
    #[arg(short, long, value_name = "FILE", help_heading = OUTPUT)]
    pub output: Option<PathBuf>,
    /// Camera (camera.json) with what was found of it, and the pose of a further camera; none, or one for each camera
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub camera_out: Vec<PathBuf>,
    /// Evidence of the frame on its camera (JSON), for lf-calib refine
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub evidence: Option<PathBuf>,
    /// Image (EXR) as the fit explains it, without background; none, or one for each camera. Blind
    /// pixels have light too
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub expected: Vec<PathBuf>,
    /// Write one line of JSON for each step: particles, changes, misfit, size, drift, noise, seconds
    #[arg(long, value_name = "FILE", help_heading = EXPERIMENTS, hide = true)]
    pub log: Option<PathBuf>,
    #[command(flatten)]
    pub memory: MemoryLimit,
    #[command(flatten)]
    pub common: Common,
}

/// A part of the shape that is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Hold {
    /// The usual size of particles
    Size,
    /// Sizes that differ from the usual one
    Sizes,
    /// The drift of the lattice
    Drift,
    /// The blur of the sensor
    Blur,
    /// Parameters of a camera that does not explain its image
    Camera,
    /// The poses of further cameras
    Pose,
}

impl Arguments {
    /// Refuses lists of files that do not go together: a camera and a volume for each image.
    pub fn check_counts(&self) -> Result<()> {
        let images = self.image.len();
        let optional = |files: &[PathBuf]| files.is_empty() || files.len() == images;
        let wanted = |what: &str| match images {
            1 => format!("wanted one {what}, as there is one image"),
            _ => format!("wanted {images}, as there are {images} images"),
        };
        for (option, what, files, fits) in [
            ("--camera", "camera", &self.camera, self.camera.len() == images),
            ("volume", "volume", &self.volume, self.volume.len() == images),
            ("--background", "background", &self.background, optional(&self.background)),
            ("--mask", "mask", &self.mask, optional(&self.mask)),
            ("--camera-out", "camera", &self.camera_out, optional(&self.camera_out)),
            ("--expected", "image", &self.expected, optional(&self.expected)),
        ] {
            if !fits {
                return Err(Error::new(option, format!("given {} times", files.len()), wanted(what)));
            }
        }
        if images > 1 && self.evidence.is_some() {
            let found = format!("asked for with {images} images");
            return Err(Error::new("--evidence", found, "wanted one camera; fit each alone"));
        }
        Ok(())
    }

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
        let is_free = |part: Hold| !self.hold.contains(&part);
        Ok(FitOptions {
            shape: Shape {
                sigma_px: self.size,
                drift_px: [0.0; 2],
                blur_px: None,
                pattern: None,
                lens_px: Default::default(),
            },
            free: Free {
                size: is_free(Hold::Size),
                sizes: is_free(Hold::Sizes),
                drift: is_free(Hold::Drift),
                blur: is_free(Hold::Blur),
                camera: is_free(Hold::Camera),
                lens: Default::default(),
                pose: is_free(Hold::Pose),
            },
            noise: KnownNoise { gain: self.gain, read_variance: self.read_noise.map(|sigma| sigma * sigma) },
            rounds: self.rounds,
            evidence: self.evidence.is_some(),
        })
    }
}
