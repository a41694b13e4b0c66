//! `lf-calib frame`: frames in, corrected frames and a table of what changed out.

use super::arguments::FrameArguments;
use super::files::{Sizes, named_in};
use lf_calib::{Change, Correction, Factor, HotPixels, Lasers, Sensitivity};
use lf_core::image::{self, Image};
use lf_core::{Error, Result, Session, Verdict, io};
use std::path::{Path, PathBuf};

/// Warn from this share of clipped pixels in a frame on, like lf-prune and lf-mart.
const CLIPPED: f64 = 1e-3;

/// Warn if a larger share of the pixels is hot. Sensors at room temperature have less than a thousandth.
const MOST_HOT: f64 = 2e-3;

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
    let mut sizes = Sizes::of(all.iter().map(|(_, file)| *file).chain(flat))?;
    let correction = correction(arguments, &all, &mut sizes, session)?;
    let progress = session.progress("frames", all.len() as u64);
    let mut rows = vec![row(["frame", "mean", "", "noise", "", "brightest", ""].map(str::to_owned))];
    let mut clipped = Vec::new();
    for ((laser, file), place) in all.iter().zip(&places) {
        let mut frame = session.phase("read", |_| read(arguments, file, &mut sizes))?;
        let change = session.phase("correct", |_| Ok(correction.apply(&mut frame.pixels, *laser)))?;
        let share = change.clipped.filter(|(_, share)| *share >= CLIPPED);
        clipped.extend(share.map(|(level, share)| (io::name(file), level, share)));
        let history = session.history(&frame.history);
        session.phase("write", |_| image::save(place, &frame.pixels, &history))?;
        rows.push(row(cells(file, &change)));
        progress.add(1);
    }
    drop(progress);
    warn_of_clipped(&clipped, session);
    session.count("frames", all.len());
    session.count("replaced_pixels", correction.replaced.len());
    io::save_text(Path::new("-"), |out| rows.iter().try_for_each(|row| writeln!(out, "{row}")))?;
    Ok(Verdict::Done)
}

fn read(arguments: &FrameArguments, file: &Path, sizes: &mut Sizes) -> Result<Image> {
    let image = image::open_counts(file, arguments.reading.channel)?;
    sizes.check(file, [image.pixels.ncols(), image.pixels.nrows()])?;
    Ok(image)
}

/// Warns of clipped frames: name, level in counts and share of the pixels.
fn warn_of_clipped(frames: &[(String, f32, f64)], session: &mut Session) {
    // The first of the worst.
    let Some((name, level, share)) = frames.iter().rev().max_by(|a, b| a.2.total_cmp(&b.2)) else { return };
    session.count("clipped_frames", frames.len());
    session.warn(format!(
        "{name}: {:.1} % of the pixels are clipped, at {level} counts; {} frames in all: the brightest light is lost; \
         corrected frames have their largest count there, for lf-fit to leave it out; expose less or lower the gain",
        100.0 * share,
        frames.len()
    ));
}

/// Finds what is to be corrected. Reads all frames first if --hot or --equalise needs it. Says what it found.
fn correction(
    arguments: &FrameArguments,
    all: &[(usize, &PathBuf)],
    sizes: &mut Sizes,
    session: &mut Session,
) -> Result<Correction> {
    let mut correction = Correction::default();
    if let Some(flat) = &arguments.flat {
        let pixels = read(arguments, flat, sizes)?.pixels;
        let sensitivity = Sensitivity::new(&pixels).map_err(|refusal| refusal.about(io::name(flat)))?;
        session.say(format!("{} dead pixels", sensitivity.dead.len()));
        correction.replaced = sensitivity.dead.clone();
        if sensitivity.left > 0 {
            let share = 100.0 * sensitivity.left as f64 / pixels.len() as f64;
            let what = format!("{} pixels ({share:.2} %) are left as they are", sensitivity.left);
            session.say(format!("{what}: --flat has less than a fifth of its usual light there"));
        }
        correction.sensitivity = Some(sensitivity);
    }
    if arguments.hot.is_none() && !arguments.equalise {
        return Ok(correction);
    }
    let (hot, lasers) = first_pass(arguments, all, sizes, session)?;
    if let Some(limit) = arguments.hot {
        let few = || {
            let wanted = format!(
                "wanted {} or more, so that particles and hot pixels can be separated",
                HotPixels::LEAST_FRAMES
            );
            Error::new("--hot", format!("{} frames", all.len()), wanted)
        };
        let hot = hot.find(limit).ok_or_else(few)?;
        session.say(format!("{} hot pixels", hot.len()));
        warn_of_hot(hot.len(), sizes, session);
        correction.replaced.extend(hot);
        correction.replaced.sort_unstable();
        correction.replaced.dedup();
    }
    if arguments.equalise {
        let wanted = "wanted two or more of each laser with particles that move";
        let none = || Error::new("--equalise", "frames without light to compare", wanted);
        let Factor { value, uncertainty } = lasers.factor().ok_or_else(none)?;
        session.say(format!(
            "frames of the second laser are multiplied by {value:.4}, standard uncertainty {uncertainty:.4}; so is their \
             dark level: make a background for each laser"
        ));
        session.count("factor", value);
        session.count("factor_uncertainty", uncertainty);
        correction.factors = Some([1.0, value]);
    }
    Ok(correction)
}

/// Warns if more pixels are hot than a sensor has.
fn warn_of_hot(hot: usize, sizes: &Sizes, session: &mut Session) {
    let share = hot as f64 / sizes.first().map_or(1.0, |[width, height]| (width * height) as f64);
    if share > MOST_HOT {
        session.warn(format!(
            "--hot takes {:.1} % of the pixels for hot ones, which are replaced: light that stands still, as on walls and \
             dirt, looks like them; give a larger --hot, or leave it out: lf-fit finds hot pixels itself",
            100.0 * share
        ));
    }
}

/// Reads all frames for the first time. Refuses pipes, which can be read only once.
fn first_pass(
    arguments: &FrameArguments,
    all: &[(usize, &PathBuf)],
    sizes: &mut Sizes,
    session: &mut Session,
) -> Result<(HotPixels, Lasers)> {
    let is_pipe = |file: &Path| io::is_standard(file) || file.exists() && !file.is_file();
    if let Some((_, file)) = all.iter().find(|(_, file)| is_pipe(file)) {
        let wanted = "wanted a file: --hot and --equalise read every frame twice";
        return Err(Error::new(io::name(file), "a stream, which can be read only once", wanted));
    }
    let (mut hot, mut lasers) = (HotPixels::default(), Lasers::default());
    let progress = session.progress("looks", all.len() as u64);
    for (laser, file) in all {
        let frame = session.phase("read", |_| read(arguments, file, sizes))?;
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
    Ok((hot, lasers))
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
