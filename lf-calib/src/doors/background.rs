//! `lf-calib background`.

use super::check_inputs;
use lf_calib::Background;
use lf_core::cli::{Session, Verdict};
use lf_core::image::{self, Stack};
use lf_core::{Error, Result, io};
use std::path::{Path, PathBuf};

/// Frames in, what stays in all of them out.
pub fn background(frames: &[PathBuf], quantile: f64, output: &Path, session: &mut Session) -> Result<Verdict> {
    if !(0.0..=0.5).contains(&quantile) {
        return Err(Error::new("--quantile", quantile.to_string(), "wanted 0 to 0.5"));
    }
    let inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).collect();
    check_inputs(&inputs)?;
    session.keep_apart(output, &inputs)?;
    io::check_place(output)?;
    // A quantile must know the number of frames before it takes in the first. Pipes are read once and kept; files are
    // opened again, for a system has only so many maps.
    let mut count = 0;
    let mut kept = Vec::new();
    for path in frames {
        let stack = Stack::open(path)?;
        count += stack.images();
        kept.push(Some(stack).filter(|stack| !stack.is_mapped()));
    }
    let what = if quantile > 0.0 { format!("quantile {quantile}") } else { "minimum".to_string() };
    session.explain(format!("{what} of {count} frames, pixel by pixel"));
    let mut background = Background::new(count, quantile);
    let mut history = None;
    let progress = session.progress("frames", count as u64);
    for (path, kept) in frames.iter().zip(kept) {
        let stack = kept.map_or_else(|| Stack::open(path), Ok)?;
        for number in 0..stack.images() {
            let frame = session.phase("read", |_| stack.read(number))?;
            session.phase("sort", |_| {
                background.add(&frame.pixels).map_err(|refusal| refusal.about(stack.name(number)))
            })?;
            history.get_or_insert(frame.history);
            progress.add(1);
        }
    }
    drop(progress);
    let pixels = background.finish().ok_or_else(|| Error::new("background", "no frame", "wanted at least one"))?;
    session.count("frames", count);
    let history = session.history(&history.unwrap_or_default());
    session.phase("write", |_| image::save(output, &pixels, &history))?;
    Ok(Verdict::Done)
}
