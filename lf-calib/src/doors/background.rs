//! `lf-calib background`.

use lf_calib::Background;
use lf_core::camera::{Camera, Sensor};
use lf_core::cli::{Session, Verdict};
use lf_core::image::{self, Image, Stack};
use lf_core::{Error, Result, io};
use std::path::{Path, PathBuf};

/// Frames in, what stays in all of them out. With a camera, frames that cannot be read or are not its sensor's are left out.
pub fn background(
    frames: &[PathBuf],
    quantile: f64,
    camera: Option<&Path>,
    output: &Path,
    session: &mut Session,
) -> Result<Verdict> {
    if !(0.0..=0.5).contains(&quantile) {
        return Err(Error::new("--quantile", quantile.to_string(), "wanted 0 to 0.5"));
    }
    let mut inputs: Vec<&Path> = frames.iter().map(PathBuf::as_path).collect();
    inputs.extend(camera);
    session.keep_apart(output, &inputs)?;
    io::check_place(output)?;
    // A quantile must know the number of frames before it takes in the first. Pipes are read once and kept; files are
    // opened again, for a system has only so many maps.
    let sensor = camera.map(Camera::open).transpose()?.map(|camera| camera.sensor);
    let mut left_out: Vec<Error> = Vec::new();
    let mut count = 0;
    let mut kept = Vec::new();
    for path in frames {
        match Stack::open(path) {
            Ok(stack) => {
                count += stack.images();
                kept.push((path, Some(stack).filter(|stack| !stack.is_mapped())));
            }
            Err(error) => spare(error, sensor.as_ref(), &mut left_out)?,
        }
    }
    if count == 0 {
        return Err(left_out.pop().unwrap_or_else(|| Error::new("background", "no frame", "wanted at least one")));
    }
    let what = if quantile > 0.0 { format!("quantile {quantile}") } else { "minimum".to_string() };
    session.explain(format!("{what} of {count} frames, pixel by pixel"));
    let mut background = Background::new(count, quantile);
    let mut history = None;
    let mut used = 0;
    let progress = session.progress("frames", count as u64);
    for (path, kept) in kept {
        let stack = kept.map_or_else(|| Stack::open(path), Ok)?;
        for number in 0..stack.images() {
            let frame = session.phase("read", |_| frame(&stack, number, sensor.as_ref()));
            progress.add(1);
            let frame = match frame {
                Ok(frame) => frame,
                Err(error) => {
                    spare(error, sensor.as_ref(), &mut left_out)?;
                    continue;
                }
            };
            session.phase("sort", |_| {
                background.add(&frame.pixels).map_err(|refusal| refusal.about(stack.name(number)))
            })?;
            used += 1;
            history.get_or_insert(frame.history);
        }
    }
    drop(progress);
    let Some(pixels) = background.finish() else {
        let subject = format!("the {count} frames");
        return Err(left_out.pop().unwrap_or_else(|| Error::new(subject, "none was read", "wanted at least one")));
    };
    session.count("frames", used);
    session.count("left_out", left_out.len());
    let history = session.history(&history.unwrap_or_default());
    session.phase("write", |_| image::save(output, &pixels, &history))?;
    for error in left_out {
        session.warn(format!("left out: {error}"));
    }
    Ok(Verdict::Done)
}

/// Without a sensor nothing tells whose fault it is.
fn spare(error: Error, sensor: Option<&Sensor>, left_out: &mut Vec<Error>) -> Result<()> {
    if sensor.is_none() {
        return Err(error);
    }
    left_out.push(error);
    Ok(())
}

/// One frame; with a sensor, of its size.
fn frame(stack: &Stack, number: usize, sensor: Option<&Sensor>) -> Result<Image> {
    let frame = stack.read(number)?;
    let (height, width) = frame.pixels.dim();
    match sensor {
        Some(sensor) if (width, height) != (sensor.width, sensor.height) => {
            let wanted = format!("wanted {} x {} px, the camera's sensor", sensor.width, sensor.height);
            Err(Error::new(stack.name(number), format!("{width} x {height} px"), wanted))
        }
        _ => Ok(frame),
    }
}
