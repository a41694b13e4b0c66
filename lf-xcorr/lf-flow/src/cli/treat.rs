//! Tasks that turn a field into a field: read, work, report, write.

use super::arguments::{DeriveArguments, PressureArguments, SmoothArguments, SolenoidalArguments};
use super::files::Files;
use lf_core::cli::MemoryLimit;
use lf_core::field::{Array, MEASURED};
use lf_core::{Error, Field, Result, Session, io};
use lf_flow::{self as flow, Measured, PressureOptions, Task};
use std::path::Path;

/// Constant: warn above this misfit to the stated uncertainties. Errors correlated like windows stay below it.
const MISFIT: f64 = 1.5;
/// Constant: warn above this share of filled vectors.
const FILLED: f64 = 0.2;
/// Constant: warn above this share of accelerations without a pressure.
const UNEXPLAINED: f64 = 0.5;

/// Remedy for a solver that does not reach its goal.
const FEWER_GAPS: &str = "larger windows, which leave fewer gaps, or a smaller volume";

/// A field, the arrays to write with its vectors, and the line to print once it is written.
type Treated = (Field, Vec<Array>, String);

/// Treats every field, one after another.
fn each(
    files: &Files,
    task: Task,
    limit: MemoryLimit,
    session: &mut Session,
    mut treat: impl FnMut(&Field, &str, &mut Session) -> Result<Treated>,
) -> Result<()> {
    let jobs = files.jobs(session)?;
    let progress = session.progress("fields", jobs.len() as u64);
    for (input, output) in &jobs {
        let name = io::name(input);
        let field = open(input, task, limit, session)?;
        let (mut found, more, line) = session.phase("work", |session| treat(&field, &name, session))?;
        found.layout.history = session.history(&field.layout.history);
        session.phase("write", |_| found.save_with(output, &more))?;
        session.say(format!("{name}: {line}"));
        progress.add(1);
    }
    session.count("fields", jobs.len());
    Ok(())
}

/// Reads a field and refuses a task that takes too much memory.
pub fn open(path: &Path, task: Task, limit: MemoryLimit, session: &mut Session) -> Result<Field> {
    let field = session.phase("read", |_| Field::open(path))?;
    session.add("vectors", field.len());
    session.allow_memory(limit, task.bytes(&field), io::name(path), || format!("{} vectors", field.len()))?;
    Ok(field)
}

pub fn smooth(arguments: &SmoothArguments, limit: MemoryLimit, session: &mut Session) -> Result<()> {
    each(&arguments.files, Task::Smooth, limit, session, |field, name, session| {
        let measured = measured(field, name, arguments.sigma.sigma, session)?;
        let found = flow::smooth(field, &measured, arguments.strength);
        let [u, v, w] = found.strength.map(short);
        let line = format!("strength {u}, {v}, {w}; u, v, w moved by {}", lengths(found.change_mm));
        warn_unsolved(found.unsolved, "the smooth field", "a smaller --strength, or larger windows", name, session);
        for (component, misfit) in ["u", "v", "w"].into_iter().zip(found.misfit) {
            session.keep_greatest(&format!("misfit_{component}"), misfit);
            if misfit > MISFIT {
                session.warn(format!(
                    "{name}: {component} departs from the smooth field {misfit:.1} times as much as its uncertainty \
                     says; the flow is finer than the windows or the uncertainty too small; take smaller windows or a \
                     smaller --strength"
                ));
            }
        }
        Ok((found.field, Vec::new(), line))
    })
}

pub fn solenoidal(arguments: &SolenoidalArguments, limit: MemoryLimit, session: &mut Session) -> Result<()> {
    each(&arguments.files, Task::Solenoidal, limit, session, |field, name, session| {
        let measured = measured(field, name, arguments.sigma.sigma, session)?;
        let found = flow::solenoidal(field, &measured);
        let [before, after] = found.divergence;
        let moved = lengths(found.change_mm);
        let line = format!("divergence RMS {before:.1e} before, {after:.1e} after; u, v, w moved by {moved}");
        let [u, v, w] = found.left.map(|left| 100.0 * left.sqrt());
        session.explain(format!(
            "{name}: {} steps; misfit {:.2}; {u:.0}, {v:.0} and {w:.0} % of the uncertainty of u, v, w is left",
            found.steps, found.misfit
        ));
        warn_unsolved(found.unsolved, "the divergence", FEWER_GAPS, name, session);
        session.keep_greatest("misfit", found.misfit);
        session.keep_greatest("divergence_before", before);
        session.keep_greatest("divergence_after", after);
        if found.misfit > MISFIT {
            session.warn(format!(
                "{name}: the divergence is {:.1} times what the uncertainties explain; the flow is compressible, \
                 finer than the windows, or less certain than stated; compare lf-validate divergence, or take \
                 smaller windows",
                found.misfit
            ));
        } else if found.misfit < flow::SMOOTHED {
            session.warn(format!(
                "{name}: the divergence is {:.2} of what the uncertainties explain; the field was smoothed before, and \
                 the uncertainties of the result are too small; take the field as lf-xcorr wrote it",
                found.misfit
            ));
        }
        Ok((found.field, Vec::new(), line))
    })
}

pub fn derive(arguments: &DeriveArguments, limit: MemoryLimit, session: &mut Session) -> Result<()> {
    each(&arguments.files, Task::Derive, limit, session, |field, name, session| {
        let found = flow::derive(field);
        let [rms, sigma] = found.divergence;
        let unit = if field.layout.dt_s.is_some() { "1/s" } else { "a frame" };
        let stated = if sigma.is_finite() { format!(", uncertain by {sigma:.1e}") } else { String::new() };
        let line = format!("divergence RMS {rms:.1e} {unit}{stated}; {} vectors with gradients", found.places);
        session.add("places", found.places);
        if found.places == 0 {
            let [x, y, z] = field.layout.shape;
            session.warn(format!(
                "{name}: no vector has neighbours along x, y and z ({x} x {y} x {z} vectors); take more \
                 vectors along every axis"
            ));
        }
        Ok((field.clone(), found.arrays, line))
    })
}

pub fn pressure(arguments: &PressureArguments, limit: MemoryLimit, session: &mut Session) -> Result<()> {
    let inputs: Vec<&Path> =
        [Some(&arguments.field), arguments.next.as_ref()].into_iter().flatten().map(|p| p.as_path()).collect();
    session.keep_apart(&arguments.output, &inputs)?;
    Field::check_place(&arguments.output)?;
    let name = io::name(&arguments.field);
    let task = Task::Pressure { has_next: arguments.next.is_some() };
    let field = open(&arguments.field, task, limit, session)?;
    let next = session.phase("read", |_| arguments.next.as_deref().map(Field::open).transpose())?;
    let last = arguments.next.as_deref().map_or(name.clone(), io::name);
    let wanted = "wanted --dt with the seconds between its volumes";
    let dt_s = arguments.dt.or(field.layout.dt_s).ok_or_else(|| Error::new(&name, "knows no time", wanted))?;
    let other = next.as_ref().and_then(|next| next.layout.dt_s).filter(|_| arguments.dt.is_none());
    if let Some(other) = other.filter(|other| *other != dt_s) {
        let found = format!("{other} s between its volumes");
        return Err(Error::new(last, found, format!("wanted {dt_s} s, as in {name}, or --dt for both")));
    }
    let options = PressureOptions { density: arguments.density, dt_s, interval_s: arguments.interval };
    let pressure =
        |_: &mut Session| flow::pressure(&field, next.as_ref(), &options).map_err(|refusal| refusal.about(last));
    let found = session.phase("work", pressure)?;
    let [rms, sigma] = found.rms_pa;
    let stated = if sigma > 0.0 { format!(", uncertain by {sigma:.1e} Pa") } else { String::new() };
    let line = format!("{name}: pressure RMS {rms:.3e} Pa{stated}; misfit {:.2} of its gradient", found.misfit);
    session.count("misfit", found.misfit);
    session.count("places", found.places);
    warn_unsolved(found.unsolved, "the pressure", FEWER_GAPS, &name, session);
    if found.parts > 1 {
        session.warn(format!(
            "{name}: gaps cut the field into {} parts, and the pressure of each has a mean of 0; fill the gaps by \
             lf-flow solenoidal or smooth before",
            found.parts
        ));
    }
    if found.misfit > UNEXPLAINED {
        session.warn(format!(
            "{name}: {:.0} % of the accelerations have no pressure; the field is too noisy or the flow not steady; try \
             lf-flow solenoidal before, or a second field with --interval",
            100.0 * found.misfit
        ));
    }
    let mut written = field.clone();
    written.layout.dt_s = Some(dt_s);
    written.layout.history = session.history(&field.layout.history);
    session.phase("write", |_| written.save_with(&arguments.output, &found.arrays))?;
    session.say(line);
    Ok(())
}

fn measured(field: &Field, name: &str, sigma: Option<[f64; 3]>, session: &mut Session) -> Result<Measured> {
    let measured = Measured::new(field, sigma).map_err(|refusal| refusal.about(name))?;
    let is_measured = |i: &usize| field.flag[*i] == MEASURED;
    if sigma.is_some() && (0..field.len()).filter(is_measured).all(|i| field.uncertainty_mm(i).min_element() > 0.0) {
        session.warn(format!(
            "{name}: --sigma changes nothing, since every vector states its uncertainties; leave it out"
        ));
    }
    warn_unsolved(measured.unsolved, "the values in gaps", FEWER_GAPS, name, session);
    session.add("filled", measured.filled());
    let share = measured.filled() as f64 / field.len() as f64;
    if share > FILLED {
        session.warn(format!(
            "{name}: {:.0} % of the vectors were not measured and are filled from the others; take larger \
             windows, or a smaller volume",
            100.0 * share
        ));
    }
    Ok(measured)
}

/// Warns of a solver that stopped before its goal, with this residual.
fn warn_unsolved(unsolved: Option<f64>, what: &str, remedy: &str, name: &str, session: &Session) {
    if let Some(residual) = unsolved {
        session.warn(format!(
            "{name}: the solver of {what} stopped before its goal, at a residual of {residual:.0e}; vectors far from \
             measured ones are not settled; take {remedy}"
        ));
    }
}

fn lengths([u, v, w]: [f64; 3]) -> String {
    format!("{u:.2e}, {v:.2e}, {w:.2e} mm")
}

/// A number with three digits.
fn short(number: f64) -> f64 {
    format!("{number:.2e}").parse().unwrap_or(number)
}
