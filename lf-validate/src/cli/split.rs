//! `split`: a frame and its camera, into two parts that are fitted apart.

use super::limits::share;
use lf_core::camera::SensorNoise;
use lf_core::cli::ImageOptions;
use lf_core::{Camera, Error, Result, Session, Verdict, image, io};
use lf_validate::split::{held_out, pupil_halves, thinned};
use ndarray::Array2;
use std::path::{Path, PathBuf};

/// Parts of a real frame that are fitted apart, to check a fit without a truth
///
/// Writes two cameras, a.json and b.json, and two images, a.exr and b.exr, into the folder -o. Fit
/// with each camera, and compare by `lf-validate self`.
///
///   noise    a.exr and b.exr are frames of half the light: each electron goes into one of the two.
///            Their noise is independent, so two fits differ by it alone. Fit them in place of the
///            frame, with the same background
///   pupil    the cameras are blind to the left and to the right half of each lenslet's pixels, by
///            their flat fields a.exr and b.exr. Two fits to the frame look through two halves of
///            the stop, so they differ by the camera's error too
///   pixels   the first camera is blind to a random --hold of the pixels, the second to all others.
///            Fit with the first, and test the fit with the second
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate split scene/frame-0000.exr -c camera.json --by pupil -o .
  lf-validate split scene/frame-0000.exr -c camera.json --by pixels --hold 0.05 -o ."
)]
pub struct SplitArguments {
    /// Frame (EXR, TIFF, PNG)
    #[arg(default_value = "-")]
    frame: PathBuf,
    /// Camera (camera.json)
    #[arg(short, long, value_name = "FILE")]
    camera: PathBuf,
    /// Whether the two parts share the electrons, the stop or the pixels
    #[arg(long, value_enum, value_name = "noise|pupil|pixels", hide_possible_values = true)]
    by: By,
    /// Background of the frame, which is not thinned
    #[arg(short, long, value_name = "FILE")]
    background: Option<PathBuf>,
    #[command(flatten)]
    noise: NoiseOptions,
    /// Share of the pixels that are held out
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, value_parser = share)]
    hold: f64,
    /// Seed of the random parts
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Existing folder for a.json, b.json, a.exr and b.exr
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    reading: ImageOptions,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum By {
    Noise,
    Pupil,
    Pixels,
}

/// The noise of a sensor.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct NoiseOptions {
    /// Counts of an electron [default: 'sensor_noise' of the camera]
    #[arg(long, value_name = "COUNTS")]
    gain: Option<f64>,
    /// Standard deviation of a pixel without light, counts [default: 'sensor_noise' of the camera]
    #[arg(long, value_name = "COUNTS")]
    read_noise: Option<f64>,
}

impl NoiseOptions {
    /// The noise by these options and the camera. Refuses what neither knows, and what no sensor has.
    pub fn of(&self, camera: &Camera, file: &Path) -> Result<SensorNoise> {
        let known = |option: &str, typed: Option<f64>, own: Option<f64>, least: f64| {
            let wanted = format!("wanted {option}, or a camera by lf-calib noise");
            let value = typed.or(own).ok_or_else(|| Error::new(io::name(file), "no 'sensor_noise'", wanted))?;
            let is_right = (least..=1e6).contains(&value);
            is_right
                .then_some(value)
                .ok_or_else(|| Error::new(option, value.to_string(), format!("wanted {least} to 1e6")))
        };
        let own = camera.sensor_noise;
        Ok(SensorNoise {
            gain_counts: known("--gain", self.gain, own.map(|noise| noise.gain_counts), 1e-3)?,
            read_noise_counts: known("--read-noise", self.read_noise, own.map(|noise| noise.read_noise_counts), 1e-3)?,
        })
    }
}

/// Names of the parts.
const PARTS: [&str; 2] = ["a", "b"];

/// Writes two cameras and two images.
pub fn write(arguments: &SplitArguments, session: &mut Session) -> Result<Verdict> {
    let SplitArguments { frame, camera: file, by, background, output: folder, .. } = arguments;
    if !folder.is_dir() {
        return Err(Error::new(io::output_name(folder), "no such folder", "wanted an existing folder"));
    }
    let camera = Camera::open(file)?;
    let flat = camera.flat_field(file);
    let inputs: Vec<&Path> = [Some(frame), Some(file), background.as_ref(), flat.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    for part in PARTS {
        for end in ["json", "exr"] {
            session.keep_apart(&folder.join(format!("{part}.{end}")), &inputs)?;
        }
    }
    let read = |path: &Path| -> Result<image::Image> {
        let image = image::open_counts(path, arguments.reading.channel)?;
        camera.check_image(&io::name(path), image.pixels.ncols(), image.pixels.nrows())?;
        Ok(image)
    };
    let frame = session.phase("read", |_| read(frame))?;
    let history = session.history(&frame.history);
    let ones = || Array2::ones(frame.pixels.dim());
    let flat_field = || flat.as_deref().map_or_else(|| Ok(ones()), |file| Ok(read(file)?.pixels));
    let mut part_camera = camera.clone();
    let images = match by {
        By::Noise => {
            let noise = arguments.noise.of(&camera, file)?;
            let dark = background.as_deref().map(read).transpose()?.map(|dark| dark.pixels);
            part_camera.sensor_noise = Some(SensorNoise {
                read_noise_counts: noise.read_noise_counts * std::f64::consts::FRAC_1_SQRT_2,
                ..noise
            });
            session.phase("split", |_| Ok(frames(&frame.pixels, dark.as_ref(), &noise, arguments.seed)))?
        }
        By::Pupil => pupil_halves(&flat_field()?, &camera),
        By::Pixels => held_out(&flat_field()?, arguments.hold, arguments.seed),
    };
    session.phase("write", |_| {
        PARTS.iter().zip(&images).try_for_each(|(part, pixels)| {
            part_camera.vignetting = match by {
                By::Noise => flat.as_deref().map(whole).transpose()?,
                By::Pupil | By::Pixels => Some(format!("{part}.exr").into()),
            };
            image::save(&folder.join(format!("{part}.exr")), pixels, &history)?;
            let place = folder.join(format!("{part}.json"));
            io::save_text(&place, |out| out.write_all(part_camera.to_json().as_bytes()))
        })
    })?;
    Ok(Verdict::Done)
}

/// Two frames of half the light over the whole background.
fn frames(frame: &Array2<f32>, dark: Option<&Array2<f32>>, noise: &SensorNoise, seed: u64) -> [Array2<f32>; 2] {
    let light = dark.map_or_else(|| frame.clone(), |dark| frame - dark);
    // Frames have no negative counts.
    let lit = |half: Array2<f32>| dark.map_or_else(|| half.clone(), |dark| &half + dark).mapv(|counts| counts.max(0.0));
    thinned(&light, noise, seed).map(lit)
}

fn whole(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(|error| io::writing(&io::output_name(path), &error))
}
