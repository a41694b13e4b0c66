//! `export`: volumes, fields and particles for other programs.

use lf_core::cli::{MemoryLimit, numbers};
use lf_core::field::{Cut, Time, VectorGrid, save_series};
use lf_core::volume::together;
use lf_core::{Error, Field, JoinedVolume, Result, Session, Verdict, io, particles};
use lf_plot::{FieldPicture, Scalar};
use lf_validate::export::{self, Cutout, Samples};
use lf_validate::info::FileKind;
use std::path::{Path, PathBuf};

/// Volumes, fields and particles in the forms of other programs
///
/// The name of the output chooses the form
///   volume     .vti (ParaView), .tif (a stack: ImageJ), .csv (the voxels that are stored); one slice
///              is in memory at a time. All tiles of a volume are one volume
///   field      .nc (NetCDF, CF conventions: xarray, Matlab), .vti, .csv
///              .svg, .png, .pdf: a picture of one layer
///   fields     .nc with the dimension t; .vti.series with a .vti each, for ParaView's time slider
///   particles  .vtp (ParaView); particles of one number in several frames are a track
///
/// Every form but the .csv of a field names the commands that made the data.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate export volume-0000.lfv -o volume.tif --bits 16 --slab -2,2
  lf-validate export field-0000-0001.exr -o field.nc"
)]
pub struct ExportArguments {
    /// A volume or all its tiles, fields in the order of time, or tables of particles
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Where the result goes
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Volumes: the column to write, such as `score` of a support [default: intensity]
    #[arg(long, value_name = "NAME")]
    column: Option<String>,
    /// Volumes: only voxels between these depths, mm
    #[arg(long, value_name = "Z0,Z1", value_parser = numbers::<2>, allow_hyphen_values = true)]
    slab: Option<[f64; 2]>,
    /// Volumes: only voxels in this box, mm
    #[arg(long = "box", value_name = "X0,X1,Y0,Y1,Z0,Z1", value_parser = numbers::<6>, allow_hyphen_values = true)]
    #[arg(conflicts_with = "slab")]
    part: Option<[f64; 6]>,
    /// .tif: 32 stores values as they are, 16 as whole numbers, the largest as 65535
    #[arg(long, value_name = "16|32", value_parser = ["16", "32"])]
    bits: Option<String>,
    /// .nc and .vti.series: seconds from one field to the next; otherwise fields are numbered
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    every: Option<f64>,
    /// Pictures: the axis across the layer and its place in mm, as in z=0.5. Without a place, the layer with the
    /// strongest signal for its uncertainty is drawn [default: z]
    #[arg(long, value_name = "AXIS[=MM]")]
    slice: Option<Cut>,
    /// Pictures: the quantity in colour: u, v, w, speed, vorticity or uncertainty [default: the component across the
    /// layer]
    #[arg(long, value_name = "NAME")]
    scalar: Option<Scalar>,
    /// Pictures: the ends of the colours, in the unit drawn [default: the range of the field]
    #[arg(long, value_name = "LOW,HIGH", value_parser = numbers::<2>, allow_hyphen_values = true)]
    range: Option<[f64; 2]>,
    /// Particles: seconds from one frame to the next
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    dt: Option<f64>,
}

fn seconds(text: &str) -> std::result::Result<f64, String> {
    let typed = text.parse().ok().filter(|time: &f64| time.is_finite() && *time > 0.0);
    typed.ok_or_else(|| "wanted a positive number".to_owned())
}

/// Writes a file for other programs.
pub fn write(arguments: &ExportArguments, limit: MemoryLimit, session: &mut Session) -> Result<Verdict> {
    let files: Vec<&Path> = arguments.files.iter().map(PathBuf::as_path).collect();
    session.keep_apart(&arguments.output, &files)?;
    io::check_place(&arguments.output)?;
    let name = io::name(files[0]);
    if io::is_standard(files[0]) {
        return Err(Error::new(name, "a stream", "wanted the name of a file: its kind decides what is read"));
    }
    let kind = FileKind::of(&io::open(files[0])?).map_err(|refusal| refusal.about(&name))?;
    refuse_ignored(kind, arguments)?;
    match kind {
        FileKind::Volume => volume(arguments, &files, limit, session),
        FileKind::Field => fields(arguments, &files, session),
        FileKind::Particles => table(arguments, &files, session),
        _ => Err(Error::new(name, "another kind of file", "wanted a volume, a field or particles")),
    }?;
    Ok(Verdict::Done)
}

/// Refuses options that would change nothing.
fn refuse_ignored(kind: FileKind, arguments: &ExportArguments) -> Result<()> {
    let end = extension(&arguments.output);
    let is_field = |ends: &[&str]| kind == FileKind::Field && ends.contains(&end.as_str());
    let (is_volume, is_picture) = (kind == FileKind::Volume, is_field(&["svg", "png", "pdf"]));
    let is_stack = is_volume && end.starts_with("tif");
    for (option, is_given, has_effect, what) in [
        ("--column", arguments.column.is_some(), is_volume, "a volume"),
        ("--slab", arguments.slab.is_some(), is_volume, "a volume"),
        ("--box", arguments.part.is_some(), is_volume, "a volume"),
        ("--bits", arguments.bits.is_some(), is_stack, "a .tif"),
        ("--every", arguments.every.is_some(), is_field(&["nc", "series"]), "fields in a .nc or a .vti.series"),
        ("--dt", arguments.dt.is_some(), kind == FileKind::Particles, "particles"),
        ("--slice", arguments.slice.is_some(), is_picture, "a picture of a field"),
        ("--scalar", arguments.scalar.is_some(), is_picture, "a picture of a field"),
        ("--range", arguments.range.is_some(), is_picture, "a picture of a field"),
    ] {
        if is_given && !has_effect {
            return Err(Error::new(option, "changes nothing here", format!("wanted it for {what} only")));
        }
    }
    Ok(())
}

/// The extension of a name, in small letters.
fn extension(path: &Path) -> String {
    path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// The refusal of an extension.
fn unknown(output: &Path, wanted: &str) -> Error {
    let end = extension(output);
    let found = if end.is_empty() { "a name without extension".to_owned() } else { format!("the extension .{end}") };
    Error::new(io::output_name(output), found, format!("wanted {wanted}"))
}

fn volume(arguments: &ExportArguments, files: &[&Path], limit: MemoryLimit, session: &mut Session) -> Result<()> {
    let (output, column) = (&arguments.output, arguments.column.as_deref().unwrap_or("intensity"));
    let end = extension(output);
    if !["vti", "tif", "tiff", "csv"].contains(&end.as_str()) {
        return Err(unknown(output, "the name of a .vti, .tif or .csv for a volume"));
    }
    let volumes = session.phase("read", |_| JoinedVolume::open_all(files.iter().copied(), column))?;
    if let Some(other) = volumes.get(1) {
        return Err(Error::new(other.name(), "another volume", "wanted one volume at a time, or its tiles"));
    }
    let whole = &volumes[0];
    let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
    let [z0, z1] = arguments.slab.unwrap_or([low, high]);
    let part = Cutout::new(whole, arguments.part.unwrap_or([low, high, low, high, z0, z1]));
    let part = part.map_err(|refusal| refusal.about(whole.name()))?;
    session.count("voxels", part.grid().len());
    let bytes = if end == "csv" { 0.0 } else { part.bytes() };
    session.allow_memory(limit, bytes, whole.name(), || format!("slices of a {}", part.grid()))?;
    session.phase("write", |session| match end.as_str() {
        "vti" => io::save(output, |out| export::write_vti(&part, column, out)),
        "csv" => io::save_text(output, |out| export::write_csv(&part, column, out)),
        _ => {
            let samples = samples(arguments, &part, session);
            io::save(output, |out| export::write_tiff(&part, samples, out))
        }
    })
}

/// How a stack stores its values. Prints the factor of whole numbers.
fn samples(arguments: &ExportArguments, part: &Cutout, session: &Session) -> Samples {
    if arguments.bits.as_deref() != Some("16") {
        return Samples::Float;
    }
    let largest = part.largest();
    let factor = if largest > 0.0 { f32::from(u16::MAX) / largest } else { 1.0 };
    session.say(format!("a value is the stored number divided by {factor}"));
    Samples::Whole(factor)
}

fn fields(arguments: &ExportArguments, files: &[&Path], session: &mut Session) -> Result<()> {
    let output = &arguments.output;
    let end = extension(output);
    match (end.as_str(), files) {
        ("series", files) => series(arguments, files, session),
        ("nc", files) if files.len() > 1 || arguments.every.is_some() => {
            let time = match arguments.every {
                Some(every) => Time::Seconds(files.iter().zip(0..).map(|(_, n)| f64::from(n) * every).collect()),
                None => Time::Numbers(files.len()),
            };
            session.count("fields", files.len());
            save_series(output, &time, |n| Field::open(files[n]))
        }
        ("nc" | "vti" | "csv", [one]) => {
            let field = session.phase("read", |_| Field::open(one))?;
            session.count("vectors", field.len());
            session.phase("write", |_| field.save(output))
        }
        ("svg" | "png" | "pdf", [one]) => {
            let field = session.phase("read", |_| Field::open(one))?;
            let shown = FieldPicture {
                cut: arguments.slice.unwrap_or_default(),
                scalar: arguments.scalar,
                range: arguments.range,
            };
            let drawing = session.phase("plot", |_| {
                lf_plot::field(&field, &shown).map_err(|refusal| refusal.about(io::output_name(output)))
            })?;
            lf_plot::save(output, &drawing)
        }
        ("nc" | "vti" | "csv" | "svg" | "png" | "pdf", _) => {
            Err(unknown(output, "a .nc or a .vti.series for several fields"))
        }
        _ => Err(unknown(output, "the name of a .nc, .vti, .csv, .vti.series, .svg, .png or .pdf for a field")),
    }
}

/// Writes a `.vti` for every field, NAME-0000.vti and so on, and NAME.vti.series, which lists them with their times.
fn series(arguments: &ExportArguments, files: &[&Path], session: &mut Session) -> Result<()> {
    let output = &arguments.output;
    let name = output.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let Some(stem) = name.strip_suffix(".vti.series") else {
        return Err(unknown(output, "NAME.vti.series, a list of .vti"));
    };
    let names: Vec<String> = (0..files.len()).map(|n| format!("{stem}-{n:04}.vti")).collect();
    // Refusals come before the first file is written. A pipe can be read only once.
    for (name, file) in names.iter().zip(files) {
        let place = output.with_file_name(name);
        session.keep_apart(&place, files)?;
        io::check_place(&place)?;
        if file.is_file() {
            VectorGrid::open(file)?;
        }
    }
    let mut list = Vec::new();
    for (n, (name, file)) in names.iter().zip(files).enumerate() {
        Field::open(file)?.save(&output.with_file_name(name))?;
        list.push(serde_json::json!({"name": name, "time": arguments.every.unwrap_or(1.0) * n as f64}));
    }
    session.count("fields", files.len());
    let text = serde_json::json!({"file-series-version": "1.0", "files": list});
    io::save_text(output, |out| writeln!(out, "{text:#}"))
}

fn table(arguments: &ExportArguments, files: &[&Path], session: &mut Session) -> Result<()> {
    let output = &arguments.output;
    if extension(output) != "vtp" {
        return Err(unknown(output, "the name of a .vtp for particles"));
    }
    let mut all = Vec::new();
    let mut histories = Vec::new();
    for file in files {
        let (text, name) = (io::open_text(file)?, io::name(file));
        all.extend(session.phase("read", |_| particles::read(&text).map_err(|refusal| refusal.about(&name)))?);
        particles::warn_unmarked(&text, &name, session);
        histories.push(particles::history(&text));
    }
    if all.is_empty() {
        return Err(Error::new(io::name(files[0]), "no particle", "wanted one or more"));
    }
    session.count("particles", all.len());
    let history = session.history(&together(&histories));
    session.phase("write", |_| io::save(output, |out| export::write_polydata(&all, &history, arguments.dt, out)))
}
