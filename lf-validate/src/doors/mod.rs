//! What each score reads and writes.

pub mod curves;
pub mod depth;
pub mod displacement;
pub mod divergence;
pub mod elongation;
pub mod ensemble;
pub mod info;
pub mod line;
pub mod quality;
mod runs;
pub mod trade;
mod truth;

use lf_core::camera::Camera;
use lf_core::cli::{Session, Verdict};
use lf_core::volume::Volume;
use lf_core::volume::tile::Tile;
use lf_core::{Error, Result, io};
use lf_validate::json;
use lf_validate::plot::{self, Chart};
use lf_validate::quality::Light;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Refuses standard input asked for twice, and a standard output or `--stats` that is also an input.
fn check_inputs(inputs: &[&Path], session: &Session) -> Result<()> {
    session.keep_apart(Path::new("-"), inputs)
}

/// `--plot`, the same for every score.
#[derive(clap::Args)]
pub struct Picture {
    /// Draw it
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

impl Picture {
    /// Refuses a picture that is also an input, and standard output, which is the score's.
    fn check(&self, inputs: &[&Path], session: &Session) -> Result<()> {
        let Some(file) = &self.plot else { return Ok(()) };
        if io::is_standard(file) {
            return Err(Error::new("--plot", "-", "wanted a file: standard output is the score's"));
        }
        io::check_picture(file)?;
        session.keep_apart(file, inputs)
    }

    fn draw(&self, session: &mut Session, chart: impl FnOnce() -> Chart) -> Result<()> {
        let Some(file) = &self.plot else { return Ok(()) };
        session.phase("plot", |_| {
            let refused = |(found, wanted): (String, String)| Error::new(io::output_name(file), found, wanted);
            let svg = plot::draw(&chart()).map_err(refused)?;
            io::save_text(file, |out| out.write_all(svg.as_bytes()))
        })
    }
}

/// One score on standard output.
fn print(score: &impl Serialize) -> Result<()> {
    let text = json::text(score).map_err(|error| Error::new("-", error.to_string(), "wanted a score"))?;
    io::save_text(Path::new("-"), |out| out.write_all(text.as_bytes()))
}

fn verdict(is_yes: bool) -> Verdict {
    if is_yes { Verdict::Done } else { Verdict::No }
}

fn number(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "wanted a number".to_string())?;
    if value.is_finite() { Ok(value) } else { Err("wanted a finite number".to_string()) }
}

/// Whole numbers of voxels or boxes, as an option takes them.
fn counts(option: &str, typed: [f64; 3]) -> Result<[usize; 3]> {
    if typed.iter().all(|number| (0.0..=1e6).contains(number) && number.fract() == 0.0) {
        return Ok(typed.map(|number| number as usize));
    }
    let [x, y, z] = typed;
    Err(Error::new(option, format!("{x},{y},{z}"), "wanted three whole numbers from 0"))
}

/// Opens a volume that is no tile of one: of a tile, whose halo is another's, these scores would say nothing.
fn open_whole(path: &Path) -> Result<Volume> {
    let volume = Volume::open(path)?;
    match Tile::of(&volume)? {
        Some(tile) => {
            let found = format!("tile {} of {}", tile.index, tile.of);
            Err(Error::new(volume.name(), found, "wanted a whole volume (quality takes the tiles of one)"))
        }
        None => Ok(volume),
    }
}

/// The light of a volume.
fn light(volume: &Volume) -> Result<Light<'_>> {
    Ok(Light { grid: volume.grid(), indices: volume.indices(), intensity: volume.require("intensity")? })
}

fn share(text: &str) -> std::result::Result<f64, String> {
    let share = number(text)?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err("wanted a share, 0 to 1".to_string()) }
}

/// Limits of u, v, w from one number or three; none from nothing.
fn components(option: &str, limits: &[f64]) -> Result<Option<[f64; 3]>> {
    match *limits {
        [] => Ok(None),
        [all] => Ok(Some([all; 3])),
        [u, v, w] => Ok(Some([u, v, w])),
        _ => Err(Error::new(option, format!("{} numbers", limits.len()), "wanted one, or three for u,v,w")),
    }
}

/// Whether every component is within its limit, where there are limits; a number that does not exist is not.
fn at_most(found: Option<[f64; 3]>, limits: Option<[f64; 3]>) -> bool {
    let Some(limits) = limits else { return true };
    found.is_some_and(|found| found.iter().zip(limits).all(|(found, limit)| *found <= limit))
}

/// The same of one number.
fn is_at_most(found: Option<f64>, limit: Option<f64>) -> bool {
    limit.is_none_or(|limit| found.is_some_and(|found| found <= limit))
}

/// A pixel at the focal plane of a camera, where there is one, mm.
fn pixel_mm(camera: Option<&Path>) -> Result<Option<f64>> {
    let camera = camera.map(Camera::open).transpose()?;
    Ok(camera.as_ref().map(Camera::pixel_in_focus_mm))
}
