//! The door of lf-validate.

use clap::{Parser, Subcommand};
use lf_core::camera::Camera;
use lf_core::cli::{self, Common, Session, Verdict};
use lf_core::field::Field;
use lf_core::volume::Volume;
use lf_core::{Error, Result, image, io};
use lf_validate::displacement::{Displacement, displacement};
use lf_validate::info::{self, Kind, Sheet};
use lf_validate::quality::{Light, Quality, quality};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Result and truth to scores
///
/// Scores are one JSON object on standard output; a number that does not exist, such as an error without vectors, is
/// null. Exit codes: 0 done, 1 judged and the answer is no, 2 could not do the work.
#[derive(Parser)]
#[command(name = "lf-validate", version, propagate_version = true, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: Common,
}

#[derive(Subcommand)]
enum Command {
    /// Q factor, ghosts and missed light of a volume
    ///
    /// q = sum E1 E0 / sqrt(sum E1^2 sum E0^2) over all voxels, 0 where either volume is dark. scale: the factor on the
    /// volume that brings it closest to the truth. ghost_share: share of the volume's light in voxels where the truth is
    /// zero. missed_share: share of the truth's light in voxels that the volume leaves zero. *_voxels: voxels that are
    /// not zero. Both files need the column `intensity` and the same grid.
    Quality(QualityArguments),
    /// Error of a vector field: bias, RMS, standard deviation and median per component
    ///
    /// error = measured - true; the truth is interpolated to the places of the measured vectors, and vectors outside it
    /// are counted (outside_truth) and not scored, nor are places without data (no_data). Units: mm; vox, the voxels
    /// correlated; px, pixels at the focal plane, only with --camera. outliers: vectors more than 5 robust standard
    /// deviations and 0.1 voxel from the median error; they stay in every number. The object measured_only leaves out the
    /// replaced vectors.
    Displacement(DisplacementArguments),
    /// What any of the chain's files is, in one screen
    Info(InfoArguments),
}

#[derive(clap::Args)]
struct QualityArguments {
    /// The true volume
    truth: PathBuf,
    /// The volume to score
    #[arg(default_value = "-")]
    volume: PathBuf,
    /// Exit code 1 when q is below Q
    #[arg(long, value_name = "Q", value_parser = number, allow_negative_numbers = true)]
    min_q: Option<f64>,
}

#[derive(clap::Args)]
struct DisplacementArguments {
    /// The true field; it may have another layout
    truth: PathBuf,
    /// The field to score
    #[arg(default_value = "-")]
    field: PathBuf,
    /// Camera that gives the size of a pixel
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Exit code 1 when an RMS error is above PX pixels: one number, or three for u,v,w
    #[arg(long, value_name = "PX", value_parser = number, value_delimiter = ',', requires = "camera")]
    max_rms: Vec<f64>,
}

#[derive(clap::Args)]
struct InfoArguments {
    /// The file
    #[arg(default_value = "-")]
    file: PathBuf,
}

fn main() -> ExitCode {
    cli::run(
        "lf-validate",
        |arguments: &Arguments| &arguments.common,
        |arguments, session| match &arguments.command {
            Command::Quality(arguments) => judge_quality(arguments, session),
            Command::Displacement(arguments) => judge_displacement(arguments, session),
            Command::Info(arguments) => describe(&arguments.file, session),
        },
    )
}

fn judge_quality(arguments: &QualityArguments, session: &mut Session) -> Result<Verdict> {
    check_inputs(&[&arguments.truth, &arguments.volume], session)?;
    let (truth, volume) =
        session.phase("read", |_| Ok((Volume::open(&arguments.truth)?, Volume::open(&arguments.volume)?)))?;
    let (true_light, light) = (light(&truth)?, light(&volume)?);
    let score = session.phase("score", |_| {
        quality(true_light, light).map_err(|(found, wanted)| Error::new(volume.name(), found, wanted))
    })?;
    for (name, voxels) in [(truth.name(), score.truth_voxels), (volume.name(), score.volume_voxels)] {
        if voxels == 0 {
            session.warn(format!("{name}: every voxel is dark; q is 0"));
        }
    }
    session.count("truth_voxels", score.truth_voxels);
    session.count("volume_voxels", score.volume_voxels);
    print(&score)?;
    Ok(verdict(arguments.min_q.is_none_or(|min_q| is_met(&score, min_q))))
}

fn is_met(score: &Quality, min_q: f64) -> bool {
    score.q >= min_q
}

fn light(volume: &Volume) -> Result<Light<'_>> {
    Ok(Light { grid: volume.grid(), indices: volume.indices(), intensity: volume.require("intensity")? })
}

fn judge_displacement(arguments: &DisplacementArguments, session: &mut Session) -> Result<Verdict> {
    let mut inputs: Vec<&Path> = vec![&arguments.truth, &arguments.field];
    inputs.extend(arguments.camera.as_deref());
    check_inputs(&inputs, session)?;
    let limits_px = limits_px(&arguments.max_rms)?;
    let (truth, field, camera) = session.phase("read", |_| {
        let camera = arguments.camera.as_deref().map(Camera::open).transpose()?;
        Ok((Field::open(&arguments.truth)?, Field::open(&arguments.field)?, camera))
    })?;
    let pixel_mm = camera.map(|camera| camera.voxel_spacing_mm([1.0; 3])[0]);
    let score = session.phase("score", |_| Ok(displacement(&truth, &field, pixel_mm)))?;
    if score.all.vectors == 0 {
        session.warn(format!("{}: no vector could be scored: {}", io::name(&arguments.field), reasons(&score)));
    }
    session.count("vectors", score.all.vectors);
    print(&score)?;
    Ok(verdict(limits_px.is_none_or(|limits| keeps(&score, limits))))
}

fn limits_px(max_rms: &[f64]) -> Result<Option<[f64; 3]>> {
    match *max_rms {
        [] => Ok(None),
        [all] => Ok(Some([all; 3])),
        [u, v, w] => Ok(Some([u, v, w])),
        _ => Err(Error::new("--max-rms", format!("{} numbers", max_rms.len()), "wanted one, or three for u,v,w")),
    }
}

/// Whether every RMS error is within its limit; a field without a scored vector keeps none.
fn keeps(score: &Displacement, limits_px: [f64; 3]) -> bool {
    let rms = score.all.rms_px().unwrap_or([f64::NAN; 3]);
    (0..3).all(|axis| rms[axis] <= limits_px[axis])
}

fn reasons(score: &Displacement) -> String {
    let Displacement { places, no_data, outside_truth, .. } = score;
    format!("of {places}, {no_data} without data, {outside_truth} outside the truth")
}

fn describe(file: &Path, session: &mut Session) -> Result<Verdict> {
    check_inputs(&[file], session)?;
    let sheet = session.phase("read", |_| sheet(io::open(file)?, &io::name(file)))?;
    io::save_text(Path::new("-"), |out| write!(out, "{sheet}"))?;
    Ok(Verdict::Done)
}

fn sheet(bytes: io::Bytes, name: &str) -> Result<Sheet> {
    const WANTED: &str = "wanted a .lfv, EXR, TIFF, PNG, camera.json, scene.json or particles.csv";
    let refused = |found: String| Error::new(name, found, WANTED);
    let text = |bytes: &io::Bytes| match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.trim_start_matches('\u{feff}').to_owned()),
        Err(error) => Err(refused(format!("byte {} is not part of UTF-8 text", error.valid_up_to()))),
    };
    match Kind::of(&bytes).map_err(refused)? {
        Kind::Volume => {
            let volume = Volume::from_bytes(bytes, name)?;
            let names = volume.columns();
            let columns: Vec<_> = names.iter().filter_map(|name| Some((*name, volume.column(name)?))).collect();
            Ok(info::volume(volume.grid(), volume.count(), &columns, volume.history()))
        }
        Kind::Field => Ok(info::field(&Field::from_bytes(&bytes, name)?)),
        Kind::Image => {
            let image = image::from_bytes(&bytes, name)?;
            let (height, width) = image.pixels.dim();
            Ok(info::image(width, height, &image.pixels, &image.history))
        }
        Kind::Json => {
            let text = text(&bytes)?;
            let value: serde_json::Value =
                serde_json::from_str(&text).map_err(|error| refused(format!("not JSON ({error})")))?;
            if value.get("sensor").is_some() || value.get("main_lens").is_some() {
                let camera = Camera::from_json(&text).map_err(|(found, wanted)| Error::new(name, found, wanted))?;
                return Ok(info::camera(&camera));
            }
            info::json(&value).map_err(refused)
        }
        Kind::Particles => info::particles(&text(&bytes)?).map_err(refused),
        Kind::Table => Ok(info::table(&text(&bytes)?)),
        Kind::Vti => Ok(info::vti()),
    }
}

/// Refuses standard input asked for twice, and a standard output or `--stats` that is also an input.
fn check_inputs(inputs: &[&Path], session: &Session) -> Result<()> {
    if inputs.iter().filter(|input| io::is_standard(input)).count() > 1 {
        return Err(Error::new("-", "standard input is asked for twice", "wanted a file for all inputs but one"));
    }
    session.keep_apart(Path::new("-"), inputs)
}

fn print(score: &impl Serialize) -> Result<()> {
    io::save_text(Path::new("-"), |out| {
        serde_json::to_writer_pretty(&mut *out, score)?;
        writeln!(out)
    })
}

fn verdict(is_yes: bool) -> Verdict {
    if is_yes { Verdict::Done } else { Verdict::No }
}

fn number(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "wanted a number".to_string())?;
    if value.is_finite() { Ok(value) } else { Err("wanted a finite number".to_string()) }
}
