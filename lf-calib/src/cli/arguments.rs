//! The options of `lf-calib`.

use super::parse::{aperture, layout, numerical_aperture, sensor_px, wavelength_nm, window};
use clap::{Args, Parser, Subcommand};
use lf_core::camera::{Aperture, Layout};
use lf_core::cli::{Common, ImageOptions, MemoryLimit, length_mm};
use std::path::PathBuf;

/// White images and particle frames to a camera that can be trusted
#[derive(Parser)]
#[command(
    name = "lf-calib",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples; the last one in out/ after scripts/demo:
  lf-calib nominal --sensor 1092x1092 --pixel 5.5um --f 200 --magnification 1 --f-number 4 \\
      --pitch 77um --lenslet-f 308um
  lf-calib lattice white.exr -c nominal.json -o calibrated.json --plot lattice.svg"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub task: Task,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Subcommand)]
pub enum Task {
    /// Make a camera from data sheets, in air or before a liquid
    ///
    /// Prints camera.json, the start of every calibration, and says which depths the camera resolves, how large voxels
    /// should be and where a dot target should stand. Warns of parts that do not fit each other. Lengths take a unit,
    /// as 5.5um or 20cm; without one they are mm.
    #[command(after_help = "Examples; the second is before a tank of water:
  lf-calib nominal --sensor 6600x4400 --pixel 5.5um --f 200 --magnification 1 --f-number 4 \\
      --pitch 77um --lenslet-f 308um -o nominal.json
  lf-calib nominal --sensor 6600x4400 --pixel 5.5um --f 200 --magnification 0.95 --ring 4 \\
      --pitch 77um --lenslet-f 600um --layout hexagonal --water -o nominal.json")]
    Nominal(NominalArguments),
    /// Find the microlens lattice in white images
    ///
    /// The images give the layout, pitch, rotation, offset and smooth departures of the lattice, the working f-number
    /// from the width of the lenslet images, and the blur on the sensor from how soft their rims are. The nominal
    /// camera gives the rest of the main lens, the microlens focal length, the pixels and everything else in its file.
    /// Several offsets and rotations describe the same lattice; the ones nearest to the nominal camera are written.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-calib lattice white.exr -c nominal.json -o calibrated.json --plot lattice.svg
  lf-synth white scene/scene.json |
      lf-calib lattice -c nominal.json --vignetting flat.exr -o flat.json")]
    Lattice(LatticeArguments),
    /// Find the main lens, its aberrations and its misalignment from a dot target at known depths
    ///
    /// The position of the target (focus offset, lean, turn) and the magnification are always fitted. Other parameters
    /// are fitted if the images clearly require them: array to sensor distance, focal length, offset and rotation of
    /// the lattice, tilt of the sensor, distortion, aberrations, the medium. The images of the lenslets stay where a
    /// white image has shown them, and as wide, so run `lattice` first. A dot must light at least five lenslets across
    /// at two depths or more. Images in which it lights no lenslet completely are left out. All images are held in
    /// memory.
    #[command(after_help = "Examples; the first makes the images of the second:
  lf-synth scene target | lf-synth dots -o target
  lf-calib volume target -c target/camera.json -v -o calibrated.json")]
    Volume(VolumeArguments),
    /// Correct a camera by what the particles of frames show: a bundle adjustment
    ///
    /// Each frame brings its evidence by lf-fit, which takes the places of the particles as unknown too. All frames
    /// together correct what they clearly show: place, pitch, rotation and departures of the lenslets, f-number, gap to
    /// the sensor, tilt, blur, spherical aberration and coma. Magnification and focal lengths are kept, because they
    /// move all particles together. One frame is enough; more show smaller errors.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-fit support-0000.lfv -i scene/frame-0000.exr -c camera.json --particles particles-0000.csv \\
      --evidence evidence-0000.json
  lf-calib refine evidence-*.json -c camera.json -v -o refined.json")]
    Refine(RefineArguments),
    /// Find the noise of the sensor from white and dark images (photon transfer)
    ///
    /// The variance of a pixel grows with its counts by the gain, counts for an electron; without light it is that of
    /// the read noise. Two or more white images of the same light show the first, dark images the second. The camera
    /// gets both as sensor_noise.
    #[command(after_help = "Examples; the first two make the images of the last:
  for n in 1 2; do lf-synth scene demo --set seed=$n | lf-synth white -o white-$n.exr; done
  lf-synth scene demo | lf-synth dark -o dark.exr; lf-synth scene demo | lf-synth frames -o demo
  lf-calib noise white-1.exr white-2.exr --dark dark.exr -c demo/camera.json -v")]
    Noise(NoiseArguments),
    /// Per-pixel minimum, a low quantile or the mean of many frames, a minimum about each frame, or haze
    ///
    /// Every page of a TIFF is a frame. Frames are read one at a time. Memory holds this frame, files that come through
    /// a pipe, and one image for the minimum (whatever the number of frames) or Q (N - 1) + 2 images for the quantile Q
    /// of N frames. With --sliding every frame gets a background of its own name, for light that changes slowly. Memory
    /// then holds as many frames as the window.
    #[command(after_help = "Examples, in out/ after scripts/demo:
  lf-calib background scene/frame-*.exr -o background.exr
  mkdir -p sliding && lf-calib background scene/frame-*.exr --sliding 31 -o sliding
  lf-calib background scene/frame-0000.exr --haze white.exr -c camera.json -o haze.exr")]
    Background(BackgroundArguments),
    /// Correct raw frames: sensitivity of the pixels, hot pixels, lasers of different light
    ///
    /// Only what is asked for is corrected. Corrected frames are EXR of the same names in a folder; the table on
    /// standard output has the mean, the noise where a frame is darkest and the brightest pixel of each, before and
    /// after. Make backgrounds from the corrected frames, with --equalise one for each laser. The uneven light behind
    /// the lenslets is not corrected here: `lattice --vignetting` makes the flat field of a camera.
    #[command(after_help = "Examples; the first makes the frames of the others:
  lf-synth scene demo --set frames=6 | lf-synth frames -o raw
  mkdir -p corrected && lf-calib frame raw/frame-*.exr --hot 12 -o corrected
  lf-calib frame raw/frame-000[024].exr --second raw/frame-000[135].exr --hot 12 --equalise \\
      -o corrected")]
    Frame(FrameArguments),
}

#[derive(Args)]
pub struct NominalArguments {
    /// Columns and rows of the sensor
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = sensor_px)]
    pub sensor: [usize; 2],
    /// Distance between pixels
    #[arg(long, value_name = "LENGTH", value_parser = length_mm)]
    pub pixel: f64,
    /// Focal length of the main lens, or of a microscope's objective
    #[arg(
        long = "f",
        visible_alias = "focal-length",
        value_name = "LENGTH",
        value_parser = length_mm,
        required_unless_present_any = ["telecentric", "microscope"]
    )]
    pub focal_length: Option<f64>,
    /// Size of the image on the microlenses over the size of the object in focus
    #[arg(long, value_name = "M", required_unless_present = "tube_lens")]
    pub magnification: Option<f64>,
    /// Working f-number: distance from the lens to the microlenses, over the diameter of the stop
    #[arg(long, value_name = "N", required_unless_present_any = ["ring", "microscope"])]
    pub f_number: Option<f64>,
    /// Instead of --f-number: the number on the lens's ring, which holds for objects far away. The working f-number is
    /// 1 + M times as large
    #[arg(long, value_name = "N", conflicts_with_all = ["f_number", "telecentric", "microscope"])]
    pub ring: Option<f64>,
    /// The lens is telecentric towards the object, which is in a medium of this index, 1 if none is given. --f may be
    /// left out, because no ray depends on it
    #[arg(long, value_name = "INDEX", num_args = 0..=1, default_missing_value = "1", conflicts_with = "water")]
    pub telecentric: Option<f64>,
    /// A microscope, by its numerical aperture and the index of the liquid with the particles, 1 if none is given; such
    /// as 0.5,1.33 for water, also below a dry objective. It is telecentric, and has M / (2 NA) as its f-number
    #[arg(
        long,
        value_name = "NA[,INDEX]",
        value_parser = numerical_aperture,
        conflicts_with_all = ["f_number", "telecentric", "water"]
    )]
    pub microscope: Option<[f64; 2]>,
    /// With --microscope, instead of --magnification: focal length of the tube lens. M is this over --f
    #[arg(
        long,
        value_name = "LENGTH",
        value_parser = length_mm,
        requires_all = ["microscope", "focal_length"],
        conflicts_with = "magnification"
    )]
    pub tube_lens: Option<f64>,
    /// Shape of the stop
    #[arg(long, value_name = "SHAPE", default_value = "circle", value_parser = aperture())]
    pub aperture: Aperture,
    /// Distance between neighbouring microlenses
    #[arg(long, value_name = "LENGTH", value_parser = length_mm)]
    pub pitch: f64,
    /// Focal length of the microlenses
    #[arg(long = "lenslet-f", visible_alias = "lenslet-focal-length", value_name = "LENGTH", value_parser = length_mm)]
    pub lenslet_focal_length: f64,
    /// Wavelength of the light, nm, which diffracts at the rim of each lenslet
    #[arg(long, value_name = "NM", value_parser = wavelength_nm)]
    pub wavelength: Option<f64>,
    /// How the microlenses are packed
    #[arg(long, value_name = "LAYOUT", default_value = "square", value_parser = layout())]
    pub layout: Layout,
    /// The volume is in a liquid of this index, 1.333 if none is given. The camera written stands in air and sees the
    /// same rays, except for the aberration of the liquid; lf-prune and lf-mart are fast with it
    #[arg(long, value_name = "INDEX", num_args = 0..=1, default_missing_value = "1.333")]
    pub water: Option<f64>,
    /// With --water: distance from the plane in focus to the window, the window's thickness and its index, such as
    /// 180,20,1.49. Warns if the camera in air is off by too much
    #[arg(long, value_name = "DISTANCE,THICKNESS,INDEX", value_parser = window, requires = "water")]
    pub window: Option<[f64; 3]>,
    /// With --water and --window: write a camera with the exact rays through window and liquid, which lf-prune and
    /// lf-mart follow slowly
    #[arg(long, requires = "window")]
    pub exact: bool,
    /// Camera that follows from the data sheets, camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct LatticeArguments {
    /// White images of one size, averaged, also pages of a TIFF; - for standard input
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
    /// Wavelength of the light, nm, which diffracts at the rim of each lenslet; instead of that in the nominal
    /// camera. Without either, 550 if the rims show diffraction
    #[arg(long, value_name = "NM", value_parser = wavelength_nm)]
    pub wavelength: Option<f64>,
    /// Keep the nominal working f-number although the lenslet images show another: the white images were taken with
    /// another stop than the frames
    #[arg(long)]
    pub keep_f_number: bool,
    /// Take the nominal pitch of the array as exact. The distance between lenslet images then gives the distance of the
    /// main lens's exit pupil, which the camera gets as pupil_distance_mm; if the pupil is at infinity or behind the
    /// array, as 1 over that distance, pupil_vergence_per_mm
    #[arg(long)]
    pub keep_pitch: bool,
    /// Picture: the lattice over pieces of the image, departures and residuals over the frame
    #[arg(long, value_name = "FILE.svg|.png|.pdf")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Calibrated camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct VolumeArguments {
    /// Images of one size, one for each depth, also pages of a TIFF, or a folder of them. A folder that lf-synth dots
    /// has written knows its dots and depths
    #[arg(required = true, value_name = "DIR|IMAGES")]
    pub images: Vec<PathBuf>,
    /// Table of the dots, frame,id,x_mm,y_mm,z_mm,intensity, one frame for each image, x right and y up in the
    /// picture; a folder may have its own, dots.csv
    #[arg(long, value_name = "FILE")]
    pub target: Option<PathBuf>,
    /// Instead of a table: spacing of a square grid of dots with one near the axis, mm
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub spacing: Option<f64>,
    /// With --spacing: the depth of each image, mm, + towards the camera; or a table with the columns file,depth_mm.
    /// Without it, each name must have its depth after a z: dots_z-2.70.tif, z+4mm.tif
    #[arg(long, value_name = "Z0,Z1,...|FILE.csv", allow_hyphen_values = true)]
    pub depths: Option<String>,
    /// Camera to start from, camera.json
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Calibrated camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct RefineArguments {
    /// Evidence of the frames (JSON), by lf-fit --evidence
    #[arg(required = true)]
    pub evidence: Vec<PathBuf>,
    /// The camera that lf-fit had, camera.json
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    /// Corrected camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct NoiseArguments {
    /// Raw white images of the same light, two or more, also pages of a TIFF
    #[arg(required = true)]
    pub whites: Vec<PathBuf>,
    /// Dark image of the same exposure; may be repeated, and two or more keep a pattern out of the noise
    #[arg(long, value_name = "FILE", required = true)]
    pub dark: Vec<PathBuf>,
    /// Camera that gets the noise, camera.json
    #[arg(short, long, value_name = "FILE")]
    pub camera: PathBuf,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Camera with the noise of its sensor, camera.json, - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

#[derive(Args)]
pub struct BackgroundArguments {
    /// Frames of one size, also pages of a TIFF; - for standard input
    #[arg(default_value = "-")]
    pub frames: Vec<PathBuf>,
    /// Quantile from 0, the minimum, to 0.5
    #[arg(long, value_name = "Q", default_value_t = 0.0)]
    pub quantile: f64,
    /// The mean of all frames: for a background that is taken without particles
    #[arg(long, conflicts_with = "quantile")]
    pub mean: bool,
    /// The minimum over each frame and the frames before and after it, N in all, N odd. The output is a folder. Every
    /// frame must be readable: its neighbours need it
    #[arg(long, value_name = "N", conflicts_with_all = ["quantile", "mean", "camera"], value_parser = odd)]
    pub sliding: Option<usize>,
    /// Keep only the haze: the light that follows this white image and is smooth from lenslet to lenslet. One frame
    /// with particles will do
    #[arg(long, value_name = "WHITE", requires = "camera", conflicts_with = "sliding")]
    pub haze: Option<PathBuf>,
    /// With --haze: it is smooth over this many lenslets
    #[arg(long, value_name = "LENSLETS", default_value_t = 3.0, requires = "haze")]
    pub reach: f64,
    /// With --haze: take this light of particles away first, as lf-fit --expected writes it. The second haze of a frame
    /// is better than the first
    #[arg(long, value_name = "FILE", requires = "haze")]
    pub expected: Option<PathBuf>,
    /// Leave out, with a warning, frames that cannot be read or do not have the size of this camera's sensor. Without
    /// it they are an error
    #[arg(short, long, value_name = "FILE")]
    pub camera: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Background image (EXR), - for standard output; with --sliding an existing folder
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
    #[command(flatten)]
    pub memory: MemoryLimit,
}

#[derive(Args)]
pub struct FrameArguments {
    /// Frames of one size, also pages of a TIFF: those of the first laser, if there are two
    #[arg(required = true)]
    pub frames: Vec<PathBuf>,
    /// Frames of the second laser
    #[arg(long, value_name = "FRAME", num_args = 1..)]
    pub second: Vec<PathBuf>,
    /// Divide by the sensitivity of the pixels: an image of even light, taken without the microlenses. Pixels with less
    /// than a fifth of its usual light are replaced like hot ones if they are alone, and otherwise left as they are
    #[arg(long, value_name = "IMAGE")]
    pub flat: Option<PathBuf>,
    /// Replace pixels that stand above their neighbours in every frame, by more than K robust standard deviations of
    /// all pixels, by the median of their neighbours. Needs five frames or more; 12 is a good K
    #[arg(long, value_name = "K", value_parser = limit)]
    pub hot: Option<f64>,
    /// Multiply the frames of the second laser, dark level included, so that both have the same light of particles.
    /// Needs two frames or more of each
    #[arg(long)]
    pub equalise: bool,
    #[command(flatten)]
    pub reading: ImageOptions,
    /// Folder for the corrected frames
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
}

/// Parses a limit in standard deviations.
fn limit(text: &str) -> Result<f64, String> {
    let typed = text.parse().ok().filter(|limit: &f64| (1.0..=1e6).contains(limit));
    typed.ok_or_else(|| "wanted 1 to 1000000".to_owned())
}

/// Parses the length of a window, frames.
fn odd(text: &str) -> Result<usize, String> {
    let typed = text.parse().ok().filter(|frames: &usize| frames % 2 == 1 && (3..=1001).contains(frames));
    typed.ok_or_else(|| "wanted an odd number from 3 to 1001".to_owned())
}
