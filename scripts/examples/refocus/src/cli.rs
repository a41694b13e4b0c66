//! The command line of the stage: words, files in, one call, files out.

use clap::Parser;
use lf_core::cli::{self, Common, ImageOptions};
use lf_core::image::{self, FrameFiles};
use lf_core::{Camera, Result, Session, Verdict, Volume, io, volume};
use lf_refocus::refocus;
use std::path::PathBuf;
use std::process::ExitCode;

/// Image, camera and voxels to a refocused volume: the mean of the pixels that see each voxel
#[derive(Parser)]
#[command(name = "lf-refocus", version)]
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
    /// Image to subtract first; negative counts become zero
    #[arg(short, long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Image of the frame's size that is 0 where pixels are not used
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// Accepted because lf-mart has it; refocusing repeats nothing
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// Volume (.lfv), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    #[command(flatten)]
    reading: ImageOptions,
    #[command(flatten)]
    common: Common,
}

pub fn main() -> ExitCode {
    cli::run("lf-refocus", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let mut inputs = vec![arguments.support.as_path(), arguments.image.as_path(), arguments.camera.as_path()];
    inputs.extend(arguments.background.as_deref().into_iter().chain(arguments.mask.as_deref()));
    session.keep_apart(&arguments.output, &inputs)?;
    let (camera, image, support) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        let files = FrameFiles { background: arguments.background.as_deref(), mask: arguments.mask.as_deref() };
        let channel = arguments.reading.channel;
        let image = image::open_frame(&arguments.image, files, &camera, &arguments.camera, channel)?;
        Ok((camera, image.pixels, Volume::open(&arguments.support)?))
    })?;
    let means = session.phase("refocus", |_| Ok(refocus(image.view(), &camera, support.grid(), support.indices())))?;
    session.count("voxels", support.count());
    if arguments.iterations.is_some() {
        session.explain("--iterations has no effect: refocusing repeats nothing");
    }
    session.phase("write", |session| {
        let history = session.history(support.history());
        io::save(&arguments.output, |out| {
            volume::write(out, support.grid(), support.indices(), &[("intensity", &means)], &history)
        })
    })?;
    Ok(Verdict::Done)
}
