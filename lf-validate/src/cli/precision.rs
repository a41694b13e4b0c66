//! `precision`: how well the image of a camera determines places.

use super::output::{Picture, print};
use lf_core::cli::numbers;
use lf_core::{Camera, Error, Result, Session, Verdict, io};
use lf_validate::scores::precision::{Experiment, Noise, precision};
use std::path::PathBuf;

/// The bound of a camera's precision, to plan an experiment with
///
/// The Cramer-Rao bound: no unbiased method has smaller standard deviations. Particles of one size
/// and light lie at random places; place and light of all are unknown. The noise is the same in all
/// pixels, or with --light that of photons and reading.
///
///   by_depth  medians of the standard deviations of x, y and z of a particle, in ten slabs of equal
///             depth, at z_mm; px are pixels of the focal plane
///   windows   root mean squares of the standard deviations of the displacement (u, v, w) of a cubic
///             window between two frames, by least squares over its particles; windows of three
///             particles or more
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate precision camera.json --density 0.5 --noise 0.01
  lf-validate precision camera.json --density 1 --noise 0.02 --depth -3,3 --window-mm 0.5"
)]
pub struct PrecisionArguments {
    /// Camera (camera.json)
    #[arg(default_value = "-")]
    camera: PathBuf,
    /// Particles for each lenslet that the lit volume covers at the focal plane
    #[arg(long, value_name = "N", default_value_t = 0.5)]
    density: f64,
    /// Standard deviation of a pixel's noise, as a share of the brightest pixel
    #[arg(long, value_name = "SHARE", default_value_t = 0.01)]
    noise: f64,
    /// Counts of a particle in all pixels: noise of photons and reading in place of --noise
    #[arg(long, value_name = "COUNTS", requires = "gain", conflicts_with = "noise")]
    light: Option<f64>,
    /// With --light: counts of an electron
    #[arg(long, value_name = "COUNTS", requires = "light")]
    gain: Option<f64>,
    /// With --light: standard deviation of a pixel without light, counts
    #[arg(long, value_name = "COUNTS", default_value_t = 1.0)]
    read_noise: f64,
    /// Standard deviation of a particle, pixels at the focal plane
    #[arg(long, value_name = "PX", default_value_t = 0.75)]
    size: f64,
    /// First and last lit depth, mm
    #[arg(long, value_name = "FROM,TO", default_value = "-5,5", value_parser = numbers::<2>, allow_hyphen_values = true)]
    depth: [f64; 2],
    /// Side of a window, mm [default: 160 pixels at the focal plane]
    #[arg(long, value_name = "W")]
    window_mm: Option<f64>,
    /// Seed of the random places
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Pixels of the focal plane in a window by default.
const WINDOW_PX: f64 = 160.0;

/// Prints the bound.
pub fn judge(arguments: &PrecisionArguments, session: &mut Session) -> Result<Verdict> {
    let name = io::name(&arguments.camera);
    Picture::default().check([&arguments.camera], session)?;
    let camera = session.phase("read", |_| Camera::open(&arguments.camera))?;
    let window_mm = arguments.window_mm.unwrap_or(WINDOW_PX * camera.pixel_in_focus_mm());
    let [low, high] = arguments.depth;
    for (option, value, least, most) in [
        ("--density", arguments.density, 1e-3, 10.0),
        ("--noise", arguments.noise, 1e-6, 1.0),
        ("--light", arguments.light.unwrap_or(1.0), 1e-6, 1e12),
        ("--gain", arguments.gain.unwrap_or(1.0), 1e-6, 1e6),
        ("--read-noise", arguments.read_noise, 1e-3, 1e6),
        ("--size", arguments.size, 0.05, 10.0),
        ("--window-mm", window_mm, 1e-6, 1e6),
        ("--depth", high - low, 1e-6, 1e6),
    ] {
        if !(least..=most).contains(&value) {
            return Err(Error::new(option, format!("{value}"), format!("wanted {least} to {most}")));
        }
    }
    let experiment = Experiment {
        per_lenslet: arguments.density,
        noise: match (arguments.light, arguments.gain) {
            (Some(light), Some(gain)) => Noise::Counts { light, gain, read: arguments.read_noise },
            _ => Noise::Share(arguments.noise),
        },
        sigma_px: arguments.size,
        depth_mm: arguments.depth,
        window_mm,
        seed: arguments.seed,
    };
    let score =
        session.phase("score", |_| precision(&camera, &experiment).map_err(|refusal| refusal.about(name.as_str())))?;
    session.count("particles", score.particles);
    print(&score)?;
    Ok(Verdict::Done)
}
