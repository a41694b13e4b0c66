//! The door of lf-mart: what was typed, image, camera and support in, one call, a volume out.

mod preset;

use clap::{Parser, ValueEnum};
use lf_core::camera::Camera;
use lf_core::cli::{self, Common, Preset, Session, Verdict};
use lf_core::grid::Grid;
use lf_core::volume::tile::Tile;
use lf_core::volume::{self, Volume};
use lf_core::weights::{Basis, Model, SECTIONS, aperture_sections};
use lf_core::{Error, Result, image, io};
use lf_mart::{Ended, Method, Options, Part, Start, Sweep, Until, estimate_bytes, reconstruct, route};
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Image, camera and voxels to intensities, by multiplicative algebraic reconstruction
#[derive(Parser)]
#[command(
    name = "lf-mart",
    version,
    max_term_width = 100,
    after_help = "Examples, in out/ after scripts/demo; the second is the paper's DRT-MART, on coarse voxels:
  lf-mart support-0000.lfv -i scene/frame-0000.exr -c camera.json --log sweeps.jsonl -o volume.lfv
  lf-prune scene/frame-0000.exr -c camera.json --pvr 8,8,80 --depth -5,5 |
      lf-mart -i scene/frame-0000.exr -c camera.json --method mart --weights drt -o paper.lfv"
)]
struct Arguments {
    /// Voxels to solve for (.lfv), as lf-prune writes them; - for standard input
    #[arg(default_value = "-")]
    support: PathBuf,
    /// Light-field image (EXR, TIFF, PNG)
    #[arg(short, long, value_name = "FILE")]
    image: PathBuf,
    /// Camera (camera.json), as lf-calib writes it
    #[arg(short, long, value_name = "FILE")]
    camera: PathBuf,
    /// Image to subtract first; what falls below zero becomes zero
    #[arg(short, long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Defaults between speed and accuracy, for the whole chain, with --method subsets; what is typed comes before them
    #[arg(long, value_parser = Preset::parser(preset::help))]
    preset: Option<Preset>,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = WeightsName::Exact)]
    weights: WeightsName,
    /// Sections of the aperture a side with --weights drt, 2 to 64; many come near the exact weights, fewer than pixels under
    /// a lenslet stray far from them [default: pixels under a lenslet]
    #[arg(long, value_name = "N")]
    sections: Option<usize>,
    /// What a voxel stands for, seen sideways [default: blob with exact weights, point with drt]
    #[arg(long, value_enum)]
    basis: Option<BasisName>,
    /// Standard deviation of a blob, voxels [default: 0.65]
    #[arg(long, value_name = "VOXELS")]
    blob: Option<f64>,
    /// How intensities are found
    #[arg(long, value_enum, default_value_t = MethodName::Subsets)]
    method: MethodName,
    /// Sweeps over all pixels, at most [default: 60, of a tile 20, with smart and mlem 100, with mart 30]
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// End sooner: when the misfit stalls, at the image's noise, at this misfit, or never [default: stall, with smart,
    /// mlem and mart never; of a tile never, since each would end by its own misfit]
    #[arg(long, value_name = "stall|noise|MISFIT|never")]
    until: Option<String>,
    /// Factor of the exponent; the paper takes 2 to 2.5 with mart [default: 1.5, with smart and mlem 1, with mart 2.5]
    #[arg(long, value_name = "MU")]
    relaxation: Option<f64>,
    /// What a dark pixel counts as, as a share of the brightest
    #[arg(long, value_name = "SHARE", default_value_t = 1e-4)]
    floor: f64,
    /// Most that one step multiplies or divides an intensity by [default: 20, with mart 1e6]
    #[arg(long, value_name = "FACTOR")]
    clamp: Option<f64>,
    /// Volume (.lfv) to begin with, on the same grid
    #[arg(long, value_name = "FILE")]
    start: Option<PathBuf>,
    /// Write one line of JSON for each sweep: misfit, change, voxels held, weights touched, seconds since the beginning
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Refuse what would take more memory than this, GB
    #[arg(long, value_name = "GB", default_value_t = 8.0)]
    max_memory: f64,
    /// Only tell what it would take: {"memory_bytes", "voxels"} as JSON on standard output
    #[arg(long)]
    estimate: bool,
    /// Volume (.lfv), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    #[command(flatten)]
    common: Common,
}

/// What the volume of blobs takes while the solution is still held, bytes a voxel of the support.
const BLOB_BYTES: u64 = 12;

/// Sweeps of a tile where nothing sets them: all tiles of a volume need as many, and none knows when the whole stalls.
const TILE_ITERATIONS: usize = 20;

/// Standard deviation of a blob where neither an option nor a preset sets it, voxels.
const BLOB: f64 = 0.65;

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum WeightsName {
    /// Geometric optics without sampling
    Exact,
    /// The paper's dense ray tracing: n x n sections of the aperture, one beam and one chief ray each
    Drt,
    /// Tomographic PIV's: a sphere for the voxel, a cylinder for the pixel's line of sight
    Sphere,
}

#[derive(Clone, Copy, ValueEnum)]
enum BasisName {
    /// Its centre
    Point,
    /// Its width in x and y
    Box,
    /// A Gaussian particle image; the volume written is the sum of the blobs
    Blob,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum MethodName {
    /// Ordered subsets of simultaneous MART, with momentum
    Subsets,
    /// Simultaneous MART
    Smart,
    /// Maximum likelihood by expectation maximisation
    Mlem,
    /// The paper's row action, pixel after pixel, weights stored
    Mart,
}

impl Arguments {
    /// What is typed; with exact weights what the preset sets; else what the weights are used with.
    fn basis(&self) -> Basis {
        let preset = self.preset.map(preset::values);
        let is_exact = self.weights == WeightsName::Exact;
        let preset_basis = preset.filter(|_| is_exact).map(|preset| preset.basis);
        let usual = if is_exact { BasisName::Blob } else { BasisName::Point };
        match self.basis.or(preset_basis).unwrap_or(usual) {
            BasisName::Point => Basis::Point,
            BasisName::Box => Basis::Box,
            BasisName::Blob => Basis::Blob { sigma_vox: self.blob.unwrap_or(BLOB) },
        }
    }

    /// Of a whole volume, or of a tile; `sigma` is asked for the noise of the image, counts.
    fn options(&self, part: Option<Part>, sigma: impl FnOnce() -> f64) -> Result<Options> {
        let (preset, basis) = (self.preset.map(preset::values), self.basis());
        if self.weights == WeightsName::Sphere && basis != Basis::Point {
            return Err(Error::new(
                "--basis",
                "box or blob with --weights sphere",
                "wanted point, which is its default",
            ));
        }
        if let (Some(sections), false) = (self.sections, self.weights == WeightsName::Drt) {
            let found = format!("{sections} with other weights, which do not sample the aperture");
            return Err(Error::new("--sections", found, "wanted --weights drt"));
        }
        if let (Some(preset), false) = (self.preset, self.method == MethodName::Subsets) {
            let found = format!("{} with another --method", cli::word(&preset));
            return Err(Error::new("--preset", found, "wanted --method subsets, which is its default"));
        }
        let (method, iterations, until, relaxation, clamp) = match self.method {
            MethodName::Subsets => (Method::Subsets, 60, "stall", 1.5, 20.0),
            MethodName::Smart => (Method::Smart, 100, "never", 1.0, 20.0),
            MethodName::Mlem => (Method::Mlem, 100, "never", 1.0, 20.0),
            MethodName::Mart => (Method::Mart, 30, "never", 2.5, 1e6),
        };
        let (iterations, until) = preset.map_or((iterations, until), |preset| (preset.iterations, preset.until));
        let (iterations, until) = match part {
            Some(_) if preset.is_none() && self.method == MethodName::Subsets => (TILE_ITERATIONS, "never"),
            Some(_) => (iterations, "never"),
            None => (iterations, until),
        };
        let until = self.until.as_deref().unwrap_or(until);
        let options = Options {
            weights: match self.weights {
                WeightsName::Exact => Model::Exact,
                WeightsName::Drt => Model::Drt { sections: self.sections },
                WeightsName::Sphere => Model::Sphere,
            },
            basis,
            method,
            iterations: self.iterations.unwrap_or(iterations),
            until: match until {
                "stall" => Until::Stall,
                "never" => Until::Never,
                "noise" => Until::Noise(sigma()),
                typed => match typed.parse::<f64>() {
                    Ok(misfit) if misfit > 0.0 && misfit < 1.0 => Until::Misfit(misfit),
                    _ => return Err(Error::new("--until", typed, "wanted stall, noise, never, or a misfit in 0 to 1")),
                },
            },
            relaxation: self.relaxation.unwrap_or(relaxation),
            floor: self.floor,
            clamp: self.clamp.unwrap_or(clamp),
            max_bytes: (self.max_memory * 1e9) as u64,
            part,
        };
        for (option, value, least, most) in [
            ("--blob", self.blob.unwrap_or(BLOB), 0.05, 10.0),
            (
                "--sections",
                self.sections.unwrap_or(*SECTIONS.start()) as f64,
                *SECTIONS.start() as f64,
                *SECTIONS.end() as f64,
            ),
            ("--relaxation", options.relaxation, 1e-6, 100.0),
            ("--iterations", options.iterations as f64, 1.0, 1e6),
            ("--floor", options.floor, 1e-12, 0.1),
            ("--clamp", options.clamp, 1.001, 1e6),
            ("--max-memory", self.max_memory, 1e-3, 1e6),
        ] {
            if !(least..=most).contains(&value) {
                return Err(Error::new(option, format!("{value}"), format!("wanted {least} to {most}")));
            }
        }
        Ok(options)
    }

    /// Tells what the preset sets.
    fn explain_preset(&self, session: &Session) {
        let Some(preset) = self.preset else { return };
        let is_exact = self.weights == WeightsName::Exact;
        let heeded = [self.iterations.is_none(), self.until.is_none(), self.basis.is_none() && is_exact];
        session.explain_preset(preset, preset::values(preset).typed().into_iter().zip(heeded));
    }

    /// The volume to begin with.
    fn first(&self, grid: &Grid) -> Result<Option<Volume>> {
        let Some(file) = &self.start else { return Ok(None) };
        let start = Volume::open(file)?;
        start.require("intensity")?;
        if !start.grid().agrees_with(grid) {
            return Err(Error::new(io::name(file), start.grid().to_string(), format!("wanted the support's {grid}")));
        }
        Ok(Some(start))
    }
}

fn main() -> ExitCode {
    cli::run("lf-mart", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    arguments.options(None, || 0.0)?;
    arguments.explain_preset(session);
    let mut inputs = vec![arguments.support.as_path(), arguments.image.as_path(), arguments.camera.as_path()];
    inputs.extend(arguments.background.as_deref().into_iter().chain(arguments.start.as_deref()));
    session.keep_apart(&arguments.output, &inputs)?;
    io::check_place(&arguments.output)?;
    if let Some(log) = &arguments.log {
        if io::is_standard(log) && io::is_standard(&arguments.output) {
            return Err(Error::new("standard output", "asked for by --log and by -o", "wanted a file for one of them"));
        }
        session.keep_apart(log, &inputs)?;
        session.keep_apart(log, &[&arguments.output])?;
        io::check_place(log)?;
    }
    let name = io::name(&arguments.support);
    let (camera, image, support) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        let background = arguments.background.as_deref();
        let image = image::open_frame(&arguments.image, background, &camera, &arguments.camera)?;
        Ok((camera, image, Volume::open(&arguments.support)?))
    })?;
    if support.count() == 0 {
        return Err(Error::new(name, "holds no voxel", "wanted a support with voxels"));
    }
    let start = arguments.first(support.grid())?;
    let part = Tile::of(&support)?.map(|tile| Part { pixels: tile.pixels, core_vox: tile.core_vox });
    let options = arguments.options(part, || {
        let sigma = image::noise(image.pixels.view());
        session.explain(format!("noise {sigma:.3} counts"));
        session.count("noise_counts", sigma);
        sigma
    })?;
    if part.is_some() {
        session.explain(format!(
            "a tile: {} sweeps at most, momentum is not taken back, voxels are dropped by the strongest near them",
            options.iterations
        ));
    }
    if arguments.weights == WeightsName::Drt {
        let sections = arguments.sections.unwrap_or_else(|| aperture_sections(&camera));
        session.count("sections", sections);
        session.explain(format!("{sections} x {sections} sections of the aperture"));
    }
    let wanted = "wanted a support that fits the camera and --max-memory";
    let refuse = |found: String| Error::new(name.clone(), found, wanted);
    let bytes = estimate_bytes(&camera, support.grid(), support.indices(), &options).map_err(refuse)?;
    let (route, is_kept) = route(&camera, support.grid(), support.indices(), &options).map_err(refuse)?;
    if arguments.estimate {
        // The image in units of its brightest pixel, and the volume that is written.
        let written = match options.basis {
            Basis::Blob { .. } => BLOB_BYTES,
            _ => 0,
        };
        // A sample foretells how many weights are kept, to a few per cent, and lists grow ahead of what they hold.
        let bytes = if is_kept { bytes / 4 * 5 } else { bytes };
        let more = 4 * image.pixels.len() as u64 + written * support.count() as u64;
        session.tell_estimate(bytes + more, &[("voxels", support.count() as u64)])?;
        return Ok(Verdict::Done);
    }
    session.explain(format!("camera: {}", camera.about()));
    session.explain(route.about(&camera, options.weights, is_kept));
    session.count("estimated_bytes", bytes);
    session.explain(format!(
        "about {:.2} GB of memory for {} voxels, of {} GB allowed",
        bytes as f64 * 1e-9,
        support.count(),
        arguments.max_memory
    ));
    let mut log = String::new();
    let volume = session.phase("reconstruct", |session| {
        let what = if options.until == Until::Never { "sweeps" } else { "sweeps at most" };
        let progress = session.progress(what, options.iterations as u64);
        let began = Instant::now();
        let done = |sweep: &Sweep| {
            progress.add(1);
            let Sweep { number, misfit, change, voxels, weights } = *sweep;
            let seconds = began.elapsed().as_secs_f64();
            session.explain(format!("sweep {number}: misfit {misfit:.4}, change {change:.4}, {voxels} voxels held"));
            log += &json!({"iteration": number, "misfit": misfit, "change": change, "voxels": voxels,
                "weights": weights, "seconds": seconds})
            .to_string();
            log.push('\n');
        };
        let begin = start
            .as_ref()
            .and_then(|start| start.column("intensity").map(|intensity| Start { indices: start.indices(), intensity }));
        reconstruct(image.pixels.view(), &camera, support.grid(), support.indices(), begin, &options, done)
            .map_err(refuse)
    })?;
    if volume.indices.is_empty() {
        let wanted = format!("wanted a support that {} can light", io::name(&arguments.image));
        return Err(Error::new(name, "no voxel has light", wanted));
    }
    let (sweeps, misfit) = volume.sweeps.last().map_or((0, 0.0), |sweep| (sweep.number, sweep.misfit));
    session.explain(match options.ended(&volume.sweeps) {
        Ended::Most => format!("ended after {sweeps} sweeps, the most of --iterations"),
        Ended::Stalled => {
            format!("ended after {sweeps} sweeps: the last two lowered the misfit by less than a hundredth")
        }
        Ended::Reached => format!("ended after {sweeps} sweeps: the misfit is what --until asks for"),
    });
    session.count("support_voxels", support.count());
    session.count("unseen_voxels", volume.unseen);
    session.count("lit_voxels", volume.indices.len());
    session.count("sweeps", sweeps);
    session.count("misfit", misfit);
    session.count("weights_touched", volume.sweeps.iter().map(|sweep| sweep.weights).sum::<u64>());
    session.explain(format!(
        "{} voxels, {} unseen; misfit {misfit:.4} in the last of {sweeps} sweeps; {} voxels lit",
        support.count(),
        volume.unseen,
        volume.indices.len()
    ));
    session.phase("write", |session| {
        let history = session.history(support.history());
        io::save(&arguments.output, |out| {
            let column = ("intensity", volume.intensity.as_slice());
            volume::write_with(out, support.grid(), &volume.indices, &[column], &history, support.extra())
        })?;
        match &arguments.log {
            Some(file) => io::save_text(file, |out| out.write_all(log.as_bytes())),
            None => Ok(()),
        }
    })?;
    Ok(Verdict::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact weights do not sample the aperture: sections with them would say nothing.
    #[test]
    fn sections_are_for_sampled_weights_and_within_their_range() {
        let options = |words: &[&str]| {
            let all = ["lf-mart", "-i", "frame.exr", "-c", "camera.json"].iter().chain(words);
            Arguments::try_parse_from(all).expect("known words").options(None, || 0.0)
        };
        let drt = options(&["--weights", "drt", "--sections", "7"]).unwrap();
        assert_eq!(drt.weights, Model::Drt { sections: Some(7) });
        assert_eq!(options(&["--weights", "drt"]).unwrap().weights, Model::Drt { sections: None });
        for typed in ["0", "1", "65"] {
            let text = options(&["--weights", "drt", "--sections", typed]).unwrap_err().to_string();
            assert_eq!(text, format!("--sections: {typed}; wanted 2 to 64"));
        }
        for words in [
            &["--sections", "7"][..],
            &["--weights", "exact", "--sections", "7"],
            &["--weights", "sphere", "--sections", "14"],
        ] {
            let text = options(words).unwrap_err().to_string();
            assert!(text.starts_with("--sections: ") && text.contains("wanted --weights drt"), "{text}");
        }
    }
}
