//! A run of lf-xcorr: read the volumes, plan, correlate, write the field.

use super::{arguments::Arguments, parse::MaskSource, particles, particles::Tables, report, warnings};
use lf_core::{
    Error, Field, Grid, JoinedVolume, Result, Session, Verdict, Volume, cli, field::Cut, io, simd::Level,
    volume::together,
};
use lf_xcorr::{Mask, Outcome, Plan, Refused, Seeding, Side, Sparse};
use std::path::{Path, PathBuf};

/// The column of a volume that is correlated.
const COLUMN: &str = "intensity";

pub fn run(arguments: &Arguments, session: &mut Session) -> Result<Verdict> {
    check_outputs(arguments, session)?;
    let (volumes, tables, support) = session.phase("read", |session| {
        let given = volumes(arguments)?;
        let tables = Tables::read(arguments, given.as_ref().map(|volumes| volumes.len() / 2), session)?;
        let drawn = || tables.as_ref().map_or_else(|| Ok(Vec::new()), Tables::volumes);
        Ok((given.map_or_else(drawn, Ok)?, tables, support(arguments)?))
    })?;
    let mask = mask(arguments, support.as_ref(), &volumes[0])?;
    let named = |refused| named(refused, &volumes);
    let part = mask.part(volumes[0].grid()).map_err(named)?;
    let whole = || names(&volumes, " and ");
    let lists = Plan::list_bytes(&part, volumes.len());
    cli::check_memory(arguments.memory, lists, whole(), || format!("a {part}"))?;
    check_slice(arguments.picture.slice.unwrap_or_default(), &mask, &part, volumes[0].name())?;
    let pairs = pairs(&volumes);
    let find = || Seeding::find(&pairs, &mask, arguments.floor());
    let seeding = session.phase("choose", |_| arguments.windows.are_chosen().then(find).transpose().map_err(named))?;
    let options = arguments.options(&part, seeding.as_ref().map(Seeding::window));
    let plan = Plan::new(&pairs, &mask, &options).map_err(named)?;

    arguments.windows.report_millimetres(&part, session);
    if let Some(seeding) = &seeding {
        session.say(report::chosen_windows(seeding, &options));
    }
    warnings::about_pairs(&volumes).into_iter().for_each(|line| session.warn(line));
    if arguments.estimate {
        let voxels = volumes.iter().map(|volume| volume.indices().len() as u64).sum();
        let (initial_mm, window_mm) = report::windows_mm(&options, &part);
        let lengths = [("initial_mm", initial_mm), ("window_mm", window_mm)];
        session.print_estimate(plan.bytes(), &[("voxels", voxels)], &lengths)?;
        return Ok(Verdict::Done);
    }
    let windows = || format!("{} windows in all passes", plan.windows());
    session.allow_memory(arguments.memory, plan.bytes() as f64, whole(), windows)?;
    if session.is_verbose() {
        session.explain(plan.about());
        session.explain(format!("products by {}", Level::unfused().name()));
    }
    let mut outcome = session.phase("correlate", |session| {
        let progress = session.progress("windows", plan.windows());
        plan.correlate(&|windows| progress.add(windows)).map_err(named)
    })?;
    let (mut pairs, mut has_decided) = (Vec::new(), false);
    if let Some(tables) = &tables {
        let decide = |session: &mut Session| tables.decide(&outcome.field, &mask, volumes[0].grid(), session);
        if let Some(tracks) = session.phase("particles", decide)? {
            particles::report(&tracks.report, session);
            has_decided = particles::has_decided(&tracks.report);
            (outcome.field, pairs) = (tracks.field, tracks.pairs);
        }
    }
    let histories = volumes.iter().map(JoinedVolume::history).chain(support.as_ref().map(Volume::history));
    outcome.field.layout.history = session.history(&together(histories));
    outcome.field.layout.dt_s = arguments.dt;
    report::report(&outcome, &options, session);
    warnings::about(&outcome, &options, &part, has_decided).into_iter().for_each(|line| session.warn(line));
    session.phase("write", |_| {
        save(&outcome, arguments)?;
        match (&arguments.tracks, &tables) {
            (Some(file), Some(tables)) => particles::save(file, &pairs, tables),
            _ => Ok(()),
        }
    })?;
    Ok(Verdict::Done)
}

/// Refuses options that would change nothing, and outputs that cannot be written or that are another file of this run.
fn check_outputs(arguments: &Arguments, session: &Session) -> Result<()> {
    if let Some((option, why)) = arguments.ignored() {
        return Err(Error::new(option, format!("changes nothing: {why}"), "wanted it left out"));
    }
    let inputs = arguments.inputs();
    let plot = arguments.picture.plot.as_ref();
    type Check = fn(&Path) -> Result<()>;
    let outputs: [(_, _, Check); 3] = [
        ("output", Some(&arguments.output), Field::check_place),
        ("--plot file", plot, io::check_picture),
        ("--tracks file", arguments.tracks.as_ref(), io::check_place),
    ];
    for (n, (name, path, check)) in outputs.into_iter().enumerate() {
        let Some(path) = path else { continue };
        session.keep_apart(path, &inputs)?;
        check(path)?;
        let is_same = |other: &PathBuf| path == other || io::same_file(path, other);
        if let Some((other, ..)) = outputs[..n].iter().find(|(_, other, _)| other.is_some_and(is_same)) {
            let found = format!("is the {other} and the {name}");
            return Err(Error::new(io::output_name(path), found, "wanted two files"));
        }
    }
    Ok(())
}

/// The volumes of all pairs, first and second in turn; None if no file is given.
fn volumes(arguments: &Arguments) -> Result<Option<Vec<JoinedVolume>>> {
    if arguments.files().next().is_none() {
        return Ok(None);
    }
    let mut volumes = JoinedVolume::open_all(arguments.files(), COLUMN)?;
    if volumes.len() != 2 {
        let found = format!("{} volumes", volumes.len());
        let wanted = "wanted two, each a file or all its tiles; more pairs by --and";
        return Err(Error::new(names(&volumes, ", "), found, wanted));
    }
    let more = JoinedVolume::open_all(arguments.and.iter().map(PathBuf::as_path), COLUMN)?;
    if more.len() % 2 == 1 {
        return Err(Error::new(names(&more, ", "), format!("{} volumes after --and", more.len()), "wanted pairs"));
    }
    volumes.extend(more);
    Ok(Some(volumes))
}

fn names(volumes: &[JoinedVolume], between: &str) -> String {
    volumes.iter().map(JoinedVolume::name).collect::<Vec<_>>().join(between)
}

fn support(arguments: &Arguments) -> Result<Option<Volume>> {
    match &arguments.mask {
        Some(MaskSource::Support(path)) => Volume::open(path).map(Some),
        _ => Ok(None),
    }
}

/// The mask for volumes of the same grid as `first`.
fn mask<'a>(arguments: &Arguments, support: Option<&'a Volume>, first: &JoinedVolume) -> Result<Mask<'a>> {
    let grid = first.grid();
    match (&arguments.mask, support) {
        (Some(MaskSource::Box(box_mm)), _) => Ok(Mask::Box(grid.voxels_within(*box_mm))),
        (_, Some(support)) if !support.grid().agrees_with(grid) => {
            let wanted = format!("wanted the grid of {}, {grid}", first.name());
            Err(Error::new(support.name(), format!("a grid of {}", support.grid()), wanted))
        }
        (_, Some(support)) => Ok(Mask::Support(support.indices())),
        _ => Ok(Mask::Everything),
    }
}

/// Refuses a slice outside the part of the volume `name` that is correlated.
fn check_slice(cut: Cut, mask: &Mask, part: &Grid, name: &str) -> Result<()> {
    let (axis, count) = (cut.axis, part.shape[cut.axis] as f64);
    let bounds_mm = [-0.5, count - 0.5].map(|i| part.origin_mm[axis] + i * part.spacing_mm[axis]);
    let whose = if let Mask::Box(_) = mask { "mask" } else { "volume" };
    cut.check(bounds_mm, whose).map_err(|refusal| refusal.about(name))
}

/// The light of the volumes, pair by pair.
fn pairs<'a>(volumes: &'a [JoinedVolume]) -> Vec<[Sparse<'a>; 2]> {
    let sparse = |volume: &'a JoinedVolume| Sparse {
        grid: volume.grid(),
        indices: volume.indices(),
        intensity: volume.values(),
    };
    volumes.chunks_exact(2).map(|pair| [sparse(&pair[0]), sparse(&pair[1])]).collect()
}

/// The refusal with the name of the file or option that it is about.
fn named(refused: Refused, volumes: &[JoinedVolume]) -> Error {
    let subject = match refused.side {
        Side::First(pair) => volumes[2 * pair].name().to_owned(),
        Side::Second(pair) => volumes[2 * pair + 1].name().to_owned(),
        Side::Both => names(volumes, " and "),
        Side::Mask => "--mask".to_owned(),
        Side::Options => "options".to_owned(),
    };
    refused.refusal.about(subject)
}

/// Writes the field and its picture. The field is kept if the slice is inside the volume but outside the smaller field.
fn save(outcome: &Outcome, arguments: &Arguments) -> Result<()> {
    outcome.field.save(&arguments.output)?;
    if let Some(path) = &arguments.picture.plot {
        let drawing = lf_plot::field(&outcome.field, &arguments.picture.content())
            .map_err(|refusal| refusal.about(io::output_name(path)))?;
        lf_plot::save(path, &drawing)?;
    }
    Ok(())
}
