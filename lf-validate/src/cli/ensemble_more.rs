//! Statistics of `ensemble` beyond the mean: by phase, along an axis, and modes.

use lf_core::{Error, Field, Result, Session, VectorGrid, io};
use lf_validate::scores::ensemble::{
    ConvergenceLog, ConvergenceStep, Ensemble, EnsembleSummary, EnsembleSums, LineStatistics, LineSums, ModeStatistics,
    ModeSums, PhaseSummary, PhaseSums, enough,
};
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// Statistics asked for beside the mean.
#[derive(clap::Args)]
pub struct Options {
    /// Average by phase: field n has phase n modulo N, in the order typed
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=10_000))]
    phases: Option<u32>,
    /// Spectra and correlations of the fluctuations along an axis; reads every field again
    #[arg(long, value_name = "AXIS", value_parser = ["x", "y", "z"])]
    along: Option<String>,
    /// The N strongest proper orthogonal modes of the fluctuations; reads every field again and holds all of them
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    modes: Option<u32>,
    /// Folder for the means of the phases (phase-00.exr ...) and the modes (mode-00.exr ...)
    #[arg(long, value_name = "FOLDER")]
    parts: Option<PathBuf>,
}

/// All that is printed.
#[derive(Serialize)]
pub struct Told {
    #[serde(flatten)]
    summary: EnsembleSummary,
    convergence: Vec<ConvergenceStep>,
    fields_for_1_percent: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    phases: Option<PhaseSummary>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lines: Option<LineStatistics>,
    #[serde(skip_serializing_if = "Option::is_none")]
    modes: Option<ModeStatistics>,
}

impl Options {
    /// Refuses options that cannot be kept.
    pub fn check(&self, inputs: &[&Path]) -> Result<()> {
        let again = [("--along", self.along.is_some()), ("--modes", self.modes.is_some())];
        if let Some((option, _)) = again.into_iter().find(|(_, is_asked)| *is_asked) {
            if inputs.iter().any(|input| io::is_standard(input)) {
                let found = "reads every field twice, and one is standard input";
                return Err(Error::new(option, found, "wanted files"));
            }
            if inputs.len() < 2 {
                return Err(Error::new(option, "one field, which has no fluctuations", "wanted two or more"));
            }
        }
        let Some(folder) = &self.parts else { return Ok(()) };
        if self.phases.is_none() && self.modes.is_none() {
            return Err(Error::new("--parts", "changes nothing", "wanted --phases or --modes with it"));
        }
        if folder.exists() && !folder.is_dir() {
            return Err(Error::new(io::output_name(folder), "is a file", "wanted a folder"));
        }
        Ok(())
    }

    /// Most bytes that the statistics take for so many fields.
    pub fn bytes(&self, layout: &VectorGrid, fields: usize) -> f64 {
        let phases = self.phases.map_or(0.0, |phases| f64::from(phases) * EnsembleSums::bytes(layout));
        let places = layout.shape.iter().product();
        phases + self.modes.map_or(0.0, |_| ModeSums::bytes(places, fields))
    }

    /// Sums of no field by phase, if asked for.
    pub fn phases(&self, layout: &VectorGrid) -> Option<PhaseSums> {
        self.phases.map(|phases| PhaseSums::new(layout, phases as usize))
    }

    /// All numbers. Writes the parts.
    pub fn told(
        &self,
        inputs: &[&Path],
        found: &Ensemble,
        log: ConvergenceLog,
        phases: Option<PhaseSums>,
        least: u32,
        session: &mut Session,
    ) -> Result<Told> {
        let phases = phases.map(|sums| sums.finish(least, found));
        let axis = self.along.as_ref().and_then(|axis| ["x", "y", "z"].iter().position(|name| name == axis));
        let mut lines = axis.map(|axis| LineSums::new(&found.mean.layout, axis));
        let mut modes = self.modes.map(|_| ModeSums::default());
        if lines.is_some() || modes.is_some() {
            for path in inputs {
                let field = session.phase("read", |_| Field::open(path))?;
                if field.layout.shape != found.mean.layout.shape {
                    return Err(Error::new(io::name(path), "changed since it was read", "wanted the same fields"));
                }
                lines.iter_mut().for_each(|lines| lines.add(&field, &found.mean));
                modes.iter_mut().for_each(|modes| modes.add(&field, &found.mean));
            }
        }
        let modes = modes.map(|sums| sums.finish(&found.mean, self.modes.unwrap_or_default() as usize));
        if let Some(folder) = &self.parts {
            let means = phases.iter().flat_map(|(phases, _)| phases).map(|phase| &phase.mean);
            save(folder, "phase", means, found)?;
            save(folder, "mode", modes.iter().flat_map(|(_, fields)| fields), found)?;
        }
        Ok(Told {
            summary: found.summary(),
            convergence: log.finish(found),
            fields_for_1_percent: enough(found),
            phases: phases.map(|(_, summary)| summary),
            lines: lines.map(LineSums::finish),
            modes: modes.map(|(statistics, _)| statistics),
        })
    }
}

/// Writes fields into a folder, with the history of the mean.
fn save<'a>(folder: &Path, name: &str, fields: impl Iterator<Item = &'a Field>, found: &Ensemble) -> Result<()> {
    fs::create_dir_all(folder).map_err(|error| io::writing(&io::output_name(folder), &error))?;
    for (n, field) in fields.enumerate() {
        let mut field = field.clone();
        field.layout.history = found.mean.layout.history.clone();
        field.save(&folder.join(format!("{name}-{n:02}.exr")))?;
    }
    Ok(())
}
