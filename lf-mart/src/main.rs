//! The door of lf-mart: what was typed, image, camera and support in, one call, a volume out.

use clap::{Parser, ValueEnum};
use lf_core::camera::Camera;
use lf_core::cli::{self, Common, Session, Verdict};
use lf_core::footprint::{Basis, Model};
use lf_core::volume::{self, Volume};
use lf_core::{Error, Result, image, io};
use lf_mart::{Method, Options, reconstruct};
use std::path::PathBuf;
use std::process::ExitCode;

/// Image, camera and voxels to intensities, by multiplicative algebraic reconstruction
#[derive(Parser)]
#[command(
    name = "lf-mart",
    version,
    max_term_width = 100,
    after_help = "Examples:
  lf-mart support.lfv -i frame.exr -c camera.json -o volume.lfv
  lf-mart support.lfv -i frame.exr -c camera.json --weights drt --method mart --relaxation 2.5 \\
          --iterations 30 -o paper.lfv      (the paper's DRT-MART)"
)]
struct Arguments {
    /// Support (.lfv), - for standard input
    #[arg(default_value = "-")]
    support: PathBuf,
    /// Light-field image (EXR, TIFF, PNG)
    #[arg(short, long, value_name = "FILE")]
    image: PathBuf,
    /// camera.json
    #[arg(short, long, value_name = "FILE")]
    camera: PathBuf,
    /// Image to subtract first; what falls below zero becomes zero
    #[arg(short, long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = WeightsName::Exact)]
    weights: WeightsName,
    /// What a voxel stands for, seen sideways [default: blob with exact weights, point with drt]
    #[arg(long, value_enum)]
    basis: Option<BasisName>,
    /// Standard deviation of a blob, voxels
    #[arg(long, value_name = "VOXELS", default_value_t = 0.65)]
    blob: f64,
    /// How intensities are found
    #[arg(long, value_enum, default_value_t = MethodName::Subsets)]
    method: MethodName,
    /// Sweeps over all pixels [default: 60, with --method mart 30]
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// Factor of the exponent; the paper takes 2 to 2.5 with --method mart [default: 1.5, with --method mart 2.5]
    #[arg(long, value_name = "MU")]
    relaxation: Option<f64>,
    /// Most memory that --method mart may store weights in, GB
    #[arg(long, value_name = "GB", default_value_t = 12.0)]
    max_memory: f64,
    /// Volume (.lfv), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    #[command(flatten)]
    common: Common,
}

#[derive(Clone, Copy, ValueEnum)]
enum WeightsName {
    /// Geometric optics without sampling
    Exact,
    /// The paper's dense ray tracing: n x n sections of the aperture, one beam and one chief ray each
    Drt,
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
    /// Ordered subsets of simultaneous MART, weights made from profiles
    Subsets,
    /// The paper's row action, pixel after pixel, weights stored
    Mart,
}

impl Arguments {
    fn options(&self) -> Result<Options> {
        let blob = Basis::Blob { sigma_vox: self.blob };
        let basis = match (self.basis, self.weights) {
            (Some(BasisName::Point), _) | (None, WeightsName::Drt) => Basis::Point,
            (Some(BasisName::Box), _) => Basis::Box,
            (Some(BasisName::Blob), _) | (None, WeightsName::Exact) => blob,
        };
        let mart = self.method == MethodName::Mart;
        let options = Options {
            weights: match self.weights {
                WeightsName::Exact => Model::Exact,
                WeightsName::Drt => Model::Drt,
            },
            basis,
            method: if mart { Method::Mart } else { Method::Subsets },
            iterations: self.iterations.unwrap_or(if mart { 30 } else { 60 }),
            relaxation: self.relaxation.unwrap_or(if mart { 2.5 } else { 1.5 }),
            max_bytes: (self.max_memory * 1e9) as u64,
        };
        for (option, value, least, most) in [
            ("--blob", self.blob, 0.05, 10.0),
            ("--relaxation", options.relaxation, 1e-6, 100.0),
            ("--iterations", options.iterations as f64, 1.0, 1e6),
            ("--max-memory", self.max_memory, 1e-3, 1e6),
        ] {
            if !(least..=most).contains(&value) {
                return Err(Error::new(option, format!("{value}"), format!("wanted {least} to {most}")));
            }
        }
        Ok(options)
    }
}

fn main() -> ExitCode {
    cli::run("lf-mart", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let options = arguments.options()?;
    let mut inputs = vec![arguments.support.as_path(), arguments.image.as_path(), arguments.camera.as_path()];
    inputs.extend(arguments.background.as_deref());
    session.keep_apart(&arguments.output, &inputs)?;
    let name = io::name(&arguments.support);
    let (camera, image, support) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        if let Some(key) = camera.beyond_weights() {
            let found = format!("has '{key}', which weights do not follow yet");
            return Err(Error::new(io::name(&arguments.camera), found, "wanted a camera without it"));
        }
        let image = image::open_frame(&arguments.image, arguments.background.as_deref())?;
        let (height, width) = image.pixels.dim();
        camera.check_image(&io::name(&arguments.image), width, height)?;
        Ok((camera, image, Volume::open(&arguments.support)?))
    })?;
    if support.count() == 0 {
        return Err(Error::new(name, "holds no voxel", "wanted a support with voxels"));
    }
    let volume = session.phase("reconstruct", |session| {
        let progress = session.progress("sweeps", options.iterations as u64);
        let wanted = "wanted a support that fits the camera and --max-memory";
        reconstruct(image.pixels.view(), &camera, support.grid(), support.indices(), &options, |n| progress.add(n))
            .map_err(|found| Error::new(name.clone(), found, wanted))
    })?;
    if volume.indices.is_empty() {
        let wanted = format!("wanted a support that {} can light", io::name(&arguments.image));
        return Err(Error::new(name, "no voxel has light", wanted));
    }
    session.count("support_voxels", support.count());
    session.count("unseen_voxels", volume.unseen);
    session.count("lit_voxels", volume.indices.len());
    session.count("sweeps", options.iterations);
    let misfit = volume.misfit.last().copied().unwrap_or(0.0);
    session.count("misfit", misfit);
    session.explain(format!(
        "{} voxels, {} unseen; misfit before the last of {} sweeps {misfit:.4}; {} voxels lit",
        support.count(),
        volume.unseen,
        options.iterations,
        volume.indices.len()
    ));
    session.phase("write", |session| {
        let history = session.history(support.history());
        io::save(&arguments.output, |out| {
            volume::write(out, support.grid(), &volume.indices, &[("intensity", &volume.intensity)], &history)
        })
    })?;
    Ok(Verdict::Done)
}
