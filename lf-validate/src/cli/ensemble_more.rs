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

/// Fields for the folder of parts, with their names in it.
pub type Parts = Vec<(String, Field)>;

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
        if let Some(folder) = &self.parts {
            if self.phases.is_none() && self.modes.is_none() {
                return Err(Error::new("--parts", "changes nothing", "wanted --phases or --modes with it"));
            }
            if folder.exists() && !folder.is_dir() {
                return Err(Error::new(io::output_name(folder), "is a file", "wanted a folder"));
            }
        }
        match self.phases {
            Some(phases) if phases as usize > inputs.len() => {
                let found = format!("{phases} phases of {} fields", inputs.len());
                Err(Error::new("--phases", found, "wanted a field or more for each phase"))
            }
            _ => Ok(()),
        }
    }

    /// Files that the parts of so many fields are written to.
    pub fn files(&self, fields: usize) -> Vec<PathBuf> {
        let Some(folder) = &self.parts else { return Vec::new() };
        let phases = (0..self.phases.unwrap_or(0) as usize).map(phase_name);
        let modes = (0..fields.min(self.modes.unwrap_or(0) as usize)).map(mode_name);
        phases.chain(modes).map(|name| folder.join(name)).collect()
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

    /// All numbers, and the parts to write.
    pub fn told(
        &self,
        inputs: &[&Path],
        found: &Ensemble,
        log: ConvergenceLog,
        phases: Option<PhaseSums>,
        least: u32,
        session: &mut Session,
    ) -> Result<(Told, Parts)> {
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
        let (phases, phase_summary) = phases.unzip();
        let (mode_statistics, modes) = modes.unzip();
        let means = phases.into_iter().flatten().enumerate().map(|(n, phase)| (phase_name(n), phase.mean));
        let modes = modes.into_iter().flatten().enumerate().map(|(n, mode)| (mode_name(n), mode));
        let told = Told {
            summary: found.summary(),
            convergence: log.finish(found),
            fields_for_1_percent: enough(found),
            phases: phase_summary,
            lines: lines.map(LineSums::finish),
            modes: mode_statistics,
        };
        Ok((told, means.chain(modes).collect()))
    }

    /// Writes the parts into their folder, with the history of the mean.
    pub fn save(&self, parts: Parts, found: &Ensemble) -> Result<()> {
        let Some(folder) = &self.parts else { return Ok(()) };
        fs::create_dir_all(folder).map_err(|error| io::writing(&io::output_name(folder), &error))?;
        for (name, mut field) in parts {
            field.layout.history = found.mean.layout.history.clone();
            field.save(&folder.join(name))?;
        }
        Ok(())
    }
}

fn phase_name(n: usize) -> String {
    format!("phase-{n:02}.exr")
}

fn mode_name(n: usize) -> String {
    format!("mode-{n:02}.exr")
}
