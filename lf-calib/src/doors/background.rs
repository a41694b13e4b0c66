//! `lf-calib background`.

use super::check_inputs;
use lf_calib::Background;
use lf_core::cli::{Session, Verdict};
use lf_core::image::{self, Stack};
use lf_core::{Error, Result};
use std::path::{Path, PathBuf};

/// Frames in, what stays in all of them out.
pub fn background(frames: &[PathBuf], quantile: f64, output: &Path, session: &mut Session) -> Result<Verdict> {
    if !(0.0..=0.5).contains(&quantile) {
        return Err(Error::new("--quantile", quantile.to_string(), "wanted 0 to 0.5"));
    }
    let inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).collect();
    check_inputs(&inputs)?;
    session.keep_apart(output, &inputs)?;
    // A quantile must know the number of frames before it takes in the first.
    let stacks = frames.iter().map(|path| Stack::open(path)).collect::<Result<Vec<Stack>>>()?;
    let count = stacks.iter().map(Stack::images).sum();
    let mut background = Background::new(count, quantile);
    let mut history = None;
    let progress = session.progress("frames", count as u64);
    for (stack, number) in stacks.iter().flat_map(|stack| (0..stack.images()).map(move |number| (stack, number))) {
        let frame = session.phase("read", |_| stack.read(number))?;
        session
            .phase("sort", |_| background.add(&frame.pixels).map_err(|refusal| refusal.about(stack.name(number))))?;
        history.get_or_insert(frame.history);
        progress.add(1);
    }
    drop(progress);
    let pixels = background.finish().ok_or_else(|| Error::new("background", "no frame", "wanted at least one"))?;
    session.count("frames", count);
    let history = session.history(&history.unwrap_or_default());
    session.phase("write", |_| image::save(output, &pixels, &history))?;
    Ok(Verdict::Done)
}
