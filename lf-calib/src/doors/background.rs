//! `lf-calib background`.

use super::check_inputs;
use lf_calib::Background;
use lf_core::cli::{Session, Verdict};
use lf_core::{Error, Result, image, io};
use std::path::{Path, PathBuf};

/// Frames in, what stays in all of them out.
pub fn background(frames: &[PathBuf], quantile: f64, output: &Path, session: &mut Session) -> Result<Verdict> {
    if !(0.0..=0.5).contains(&quantile) {
        return Err(Error::new("--quantile", quantile.to_string(), "wanted 0 to 0.5"));
    }
    let inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).collect();
    check_inputs(&inputs)?;
    session.keep_apart(output, &inputs)?;
    let mut background = Background::new(frames.len(), quantile);
    let mut history = None;
    let progress = session.progress("frames", frames.len() as u64);
    for path in frames {
        let frame = session.phase("read", |_| image::open_counts(path))?;
        session.phase("sort", |_| background.add(&frame.pixels).map_err(|refusal| refusal.about(io::name(path))))?;
        history.get_or_insert(frame.history);
        progress.add(1);
    }
    drop(progress);
    let pixels = background.finish().ok_or_else(|| Error::new("background", "no frame", "wanted at least one"))?;
    session.count("frames", frames.len());
    let history = session.history(&history.unwrap_or_default());
    session.phase("write", |_| image::save(output, &pixels, &history))?;
    Ok(Verdict::Done)
}
