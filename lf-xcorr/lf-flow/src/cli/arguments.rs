//! The subcommands and their options.

use super::files::Files;
use clap::{Parser, Subcommand};
use lf_core::cli::{Common, MemoryLimit, numbers};
use lf_core::field::Cut;
use std::path::PathBuf;

/// Measured fields to flows and what follows from them
///
/// A stage between correlation and statistics. Its fields are read and written like those of lf-xcorr. The
/// uncertainties that vectors state are the weights of every task, and every result has uncertainties of its own.
#[derive(Parser)]
#[command(
    name = "lf-flow",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo:
  lf-flow solenoidal field-0000-0001.exr -o flow-0000-0001.exr
  lf-flow derive flow-0000-0001.exr -o vortices.vti"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
    #[command(flatten)]
    pub memory: MemoryLimit,
    #[command(flatten)]
    pub common: Common,
}

// Each subcommand's help stands above its own options.
#[derive(Subcommand)]
pub enum Command {
    Smooth(SmoothArguments),
    Solenoidal(SolenoidalArguments),
    Derive(DeriveArguments),
    Pressure(PressureArguments),
    Profile(ProfileArguments),
}

/// Smooth a field by its uncertainties
///
/// Penalised least squares: certain vectors stay, uncertain ones follow their neighbours. Each component gets the
/// strength with the smallest expected error, by its uncertainties and the errors that overlapping windows share.
/// Replaced and missing vectors are filled and flagged as replaced.
#[derive(clap::Args)]
#[command(after_help = "Examples, in out/ after scripts/demo:
  lf-flow smooth field-0000-0001.exr -o smooth.exr
  lf-flow smooth field-0000-0001.exr --strength 1,1,100 -o smooth.vti")]
pub struct SmoothArguments {
    #[command(flatten)]
    pub files: Files,
    /// Strengths for u, v and w instead of those with the smallest expected error; s smooths waves shorter than 2 pi
    /// s^(1/4) vectors
    #[arg(long, value_name = "U,V,W", value_parser = positive)]
    pub strength: Option<[f64; 3]>,
    #[command(flatten)]
    pub sigma: Sigma,
}

/// Make a field free of divergence
///
/// Finds the field without divergence that is nearest to the measured one by the stated uncertainties. In an
/// incompressible flow, continuity determines w from u and v, which are far more certain. The divergence is the one
/// that `lf-flow derive` prints: central differences, one-sided at the ends of an axis. Replaced and missing vectors
/// are filled and flagged as replaced.
#[derive(clap::Args)]
#[command(after_help = "Examples, in out/ after scripts/demo:
  lf-flow solenoidal field-0000-0001.exr -o flow.exr
  lf-xcorr volume-0000.lfv volume-0001.lfv | lf-flow solenoidal -o flow.vti")]
pub struct SolenoidalArguments {
    #[command(flatten)]
    pub files: Files,
    #[command(flatten)]
    pub sigma: Sigma,
}

/// Write vorticity, strain, divergence, Q, lambda-2, swirl and kinetic energy
///
/// The result is the field with further channels: vorticity, divergence, strain rates, shear (sqrt(2 S:S)),
/// q_criterion, lambda_2, swirl, energy (half the square, mm2), and the standard uncertainty of each, whose name begins
/// with s_. They are per frame, or per second if the time between the volumes is known (lf-xcorr --dt). Slopes are
/// central differences, one-sided at the ends of an axis and beside vectors without data.
#[derive(clap::Args)]
#[command(after_help = "Examples, in out/ after scripts/demo:
  lf-flow derive field-0000-0001.exr -o vortices.vti
  lf-flow solenoidal field-0000-0001.exr | lf-flow derive -o vortices.csv")]
pub struct DeriveArguments {
    #[command(flatten)]
    pub files: Files,
}

/// Pressure from the acceleration of the fluid
///
/// Adds the channels pressure_pa and s_pressure_pa, its standard uncertainty. The mean pressure is 0. With one field
/// the flow counts as steady. With two, the result holds the vectors of the first field and the pressure half way in
/// time, NaN where either has no data. Friction is left out.
#[derive(clap::Args)]
#[command(after_help = "Examples, in out/ after scripts/demo:
  lf-flow pressure field-0000-0001.exr --density 998 --dt 0.001 -o pressure.vti
  lf-flow solenoidal field-0000-0001.exr | lf-flow pressure --density 998 --dt 0.001 -o pressure.exr")]
pub struct PressureArguments {
    /// The field (.exr); `-` is standard input
    #[arg(default_value = "-")]
    pub field: PathBuf,
    /// A later field of the same flow, for its acceleration in place
    #[arg(requires = "interval")]
    pub next: Option<PathBuf>,
    /// Where the field with its pressure goes: .exr, .vti, .nc or .csv; `-` is EXR on standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
    /// Density of the fluid, kg/m3
    #[arg(long, value_name = "KG_M3", value_parser = above_zero)]
    pub density: f64,
    /// Time between the volumes of a field, seconds [default: the field's own]
    #[arg(long, value_name = "SECONDS", value_parser = above_zero)]
    pub dt: Option<f64>,
    /// Time from the first field to the second, seconds
    #[arg(long, value_name = "SECONDS", value_parser = above_zero, requires = "next")]
    pub interval: Option<f64>,
}

/// Values along a line, or the flux through a plane
///
/// A line gives a table (.csv): field, distance and place in mm, u, v, w and their uncertainties; values are trilinear
/// between the vectors, and NaN outside the field and beside vectors without data. A plane gives JSON on standard
/// output: area, mean displacement through the plane and flux, with its uncertainty, of the layer of vectors nearest to
/// it.
#[derive(clap::Args)]
#[command(after_help = "Examples, in out/ after scripts/demo:
  lf-flow profile field-0000-0001.exr --from -0.5,0,0 --to 0.5,0,0 -o line.csv
  lf-flow profile field-0000-0001.exr --plane z=0")]
pub struct ProfileArguments {
    /// Fields (.exr); `-` is standard input
    #[arg(default_value = "-")]
    pub fields: Vec<PathBuf>,
    /// Start of the line, mm
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, requires = "to")]
    pub from: Option<[f64; 3]>,
    /// End of the line, mm
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, requires = "from")]
    pub to: Option<[f64; 3]>,
    /// Places along the line, both ends included
    #[arg(long, value_name = "N", default_value_t = 101, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    pub points: u32,
    /// Plane across an axis, at a place in mm: z=0.5; without a place in the middle
    #[arg(long, value_name = "AXIS[=MM]", conflicts_with_all = ["from", "points"])]
    pub plane: Option<Cut>,
    /// Where the table or the JSON goes; `-` is standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub output: PathBuf,
}

/// Uncertainties of fields that state none.
#[derive(clap::Args)]
pub struct Sigma {
    /// Standard uncertainties of u, v and w in mm, for vectors that state none
    #[arg(long, value_name = "U,V,W", value_parser = positive)]
    pub sigma: Option<[f64; 3]>,
}

/// Three numbers above 0.
fn positive(text: &str) -> Result<[f64; 3], String> {
    let values = numbers(text).ok().filter(|values: &[f64; 3]| values.iter().all(|value| *value > 0.0));
    values.ok_or_else(|| "wanted three numbers above 0 between commas".into())
}

/// A finite number above 0.
fn above_zero(text: &str) -> Result<f64, String> {
    let value = text.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0);
    value.ok_or_else(|| "wanted a number above 0".into())
}
