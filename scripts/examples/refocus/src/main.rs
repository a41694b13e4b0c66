//! lf-refocus: a stage of one's own, to be copied. It stands in for lf-mart:
//!
//! ```text
//! cargo build --release -p lf-refocus
//! make -f scripts/pipeline.mk MART=target/release/lf-refocus
//! ```
//!
//! How to begin with it:
//!
//! 1. Copy this folder, change the `name` in its `Cargo.toml`, and add it to `members` in the workspace's. Outside the
//!    workspace, name lf-core by its path (`lf-core = { path = "../lf/lf-core" }`) and the other crates by their versions.
//! 2. Keep `main.rs` the door: words, files in, one call, files out. [`cli::run`] brings exit codes, errors of one line,
//!    `--threads`, `--stats`, `--quiet`, `--verbose`; [`volume::write`] and [`io::save`] a file whole or not at all, and the
//!    history of how it was made.
//! 3. Put the work into `lib.rs`, where a test can reach it: slices and arrays in, owned values out.
//!
//! What it must take is what `scripts/pipeline.mk` says to the tool whose place it takes.

use clap::Parser;
use lf_core::camera::Camera;
use lf_core::cli::{self, Common, Session, Verdict};
use lf_core::volume::{self, Volume};
use lf_core::{Result, image, io};
use lf_refocus::refocus;
use std::path::PathBuf;
use std::process::ExitCode;

/// Image, camera and voxels to what is seen of each voxel on average, by synthetic refocusing
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
    /// Image to subtract first; what falls below zero becomes zero
    #[arg(short, long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Taken as lf-mart takes it, and not needed: nothing is repeated
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,
    /// Volume (.lfv), - for standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    #[command(flatten)]
    common: Common,
}

fn main() -> ExitCode {
    cli::run("lf-refocus", |arguments: &Arguments| &arguments.common, run)
}

fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    let mut inputs = vec![arguments.support.as_path(), arguments.image.as_path(), arguments.camera.as_path()];
    inputs.extend(arguments.background.as_deref());
    session.keep_apart(&arguments.output, &inputs)?;
    let (camera, image, support) = session.phase("read", |_| {
        let camera = Camera::open(&arguments.camera)?;
        let background = arguments.background.as_deref();
        let image = image::open_frame(&arguments.image, background, &camera, &arguments.camera)?;
        Ok((camera, image.pixels, Volume::open(&arguments.support)?))
    })?;
    let means = session.phase("refocus", |_| Ok(refocus(image.view(), &camera, support.grid(), support.indices())))?;
    session.count("voxels", support.count());
    if arguments.iterations.is_some() {
        session.explain("--iterations is not needed: nothing is repeated");
    }
    session.phase("write", |session| {
        let history = session.history(support.history());
        io::save(&arguments.output, |out| {
            volume::write(out, support.grid(), support.indices(), &[("intensity", &means)], &history)
        })
    })?;
    Ok(Verdict::Done)
}
