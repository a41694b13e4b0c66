//! `lf-calib frame`: frames in, corrected frames and a table of what changed out.

use super::{arguments::FrameArguments, files::named_in};
use lf_calib::{Change, Correction, HotPixels, Lasers};
use lf_core::image::{self, Image};
use lf_core::{Error, Result, Session, Verdict, io};
use std::path::{Path, PathBuf};

pub fn frame(arguments: &FrameArguments, session: &mut Session) -> Result<Verdict> {
    let FrameArguments { frames, second, flat, hot, equalise, output, .. } = arguments;
    if flat.is_none() && hot.is_none() && !equalise {
        return Err(Error::new("frame", "no correction", "wanted --flat, --hot or --equalise"));
    }
    if *equalise && second.is_empty() {
        let wanted = "wanted the frames of the second laser, --second";
        return Err(Error::new("--equalise", "frames of one laser only", wanted));
    }
    let frames = [image::frames(frames), image::frames(second)];
    let all: Vec<(usize, &PathBuf)> =
        (0..2).flat_map(|laser| frames[laser].iter().map(move |file| (laser, file))).collect();
    let places = named_in(output, all.iter().map(|(_, file)| *file))?;
    let inputs: Vec<&Path> = all.iter().map(|(_, file)| file.as_path()).chain(flat.as_deref()).collect();
    for place in &places {
        session.keep_apart(place, &inputs)?;
        io::check_place(place)?;
    }
    let correction = correction(arguments, &all, session)?;
    let progress = session.progress("frames", all.len() as u64);
    let mut rows = vec![row(["frame", "mean", "", "noise", "", "brightest", ""].map(str::to_owned))];
    for ((laser, file), place) in all.iter().zip(&places) {
        let mut frame = read(arguments, file)?;
        let change = session.phase("correct", |_| Ok(correction.apply(&mut frame.pixels, *laser)))?;
        let history = session.history(&frame.history);
        session.phase("write", |_| image::save(place, &frame.pixels, &history))?;
        rows.push(row(cells(file, &change)));
        progress.add(1);
    }
    drop(progress);
    session.count("frames", all.len());
    session.count("hot_pixels", correction.hot.len());
    io::save_text(Path::new("-"), |out| rows.iter().try_for_each(|row| writeln!(out, "{row}")))?;
    Ok(Verdict::Done)
}

fn read(arguments: &FrameArguments, file: &Path) -> Result<Image> {
    image::open_counts(file, arguments.reading.channel)
}

/// Finds what is to be corrected, by a first look at all frames. Tells what it found.
fn correction(arguments: &FrameArguments, all: &[(usize, &PathBuf)], session: &mut Session) -> Result<Correction> {
    let mut correction = Correction::default();
    let (mut hot, mut lasers, mut shape) = (HotPixels::default(), Lasers::default(), None);
    let progress = session.progress("looks", all.len() as u64);
    let mut sized = |file: &Path| -> Result<Image> {
        let image = read(arguments, file)?;
        let (height, width) = image.pixels.dim();
        let (wanted_height, wanted_width) = *shape.get_or_insert((height, width));
        if (height, width) != (wanted_height, wanted_width) {
            let wanted = format!("wanted {wanted_width} x {wanted_height} px like the first frame");
            return Err(Error::new(io::name(file), format!("{width} x {height} px"), wanted));
        }
        Ok(image)
    };
    for (laser, file) in all {
        let frame = session.phase("read", |_| sized(file))?;
        session.phase("look", |_| {
            if arguments.hot.is_some() {
                hot.add(&frame.pixels);
            }
            if arguments.equalise {
                lasers.add(*laser, &frame.pixels);
            }
            Ok(())
        })?;
        progress.add(1);
    }
    drop(progress);
    if let Some(flat) = &arguments.flat {
        correction.sensitivity = Some(Correction::sensitivity(&sized(flat)?.pixels));
    }
    if let Some(limit) = arguments.hot {
        let few = || {
            let wanted =
                format!("wanted {} or more, so that particles are told from hot pixels", HotPixels::LEAST_FRAMES);
            Error::new("--hot", format!("{} frames", all.len()), wanted)
        };
        correction.hot = hot.find(limit).ok_or_else(few)?;
        session.say(format!("{} hot pixels", correction.hot.len()));
    }
    if arguments.equalise {
        let wanted = "wanted two or more of each laser with particles that move";
        let factor =
            lasers.factor().ok_or_else(|| Error::new("--equalise", "frames without light to compare", wanted))?;
        session.say(format!("frames of the second laser are multiplied by {factor:.4}"));
        correction.factors = Some([1.0, factor]);
    }
    Ok(correction)
}

/// Cells of the table, before and after.
fn cells(file: &Path, change: &Change) -> [String; 7] {
    let [mean, noise] = [change.mean, change.noise].map(|pair| pair.map(|value| format!("{value:.2}")));
    let brightest = change.brightest.map(|value| format!("{value:.0}"));
    let [[m0, m1], [n0, n1], [b0, b1]] = [mean, noise, brightest];
    [io::name(file), m0, m1, n0, n1, b0, b1]
}

fn row(cells: [String; 7]) -> String {
    let [name, rest @ ..] = cells;
    let rest: String = rest.iter().map(|cell| format!("{cell:>12}")).collect();
    format!("{name:<32}{rest}").trim_end().to_owned()
}
