//! The options of every tool, and the handle that a tool's body gets: messages, progress, history, phases.

use super::complaint::one_line;
use super::kernel_tables::peak_bytes;
use super::progress::{Progress, Screen};
use crate::history::{History, Step};
use crate::{Error, Result, io};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of every tool; `#[command(flatten)]` it at the top of a tool's arguments.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Worker threads; 0 uses every core
    #[arg(long, value_name = "N", default_value_t = 0, global = true)]
    pub threads: usize,
    /// Write seconds per phase, peak memory and counts to FILE as JSON
    #[arg(long, value_name = "FILE", global = true)]
    pub stats: Option<PathBuf>,
    /// Print errors only
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print decisions and their reasons
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

/// One run of a tool: its messages, its history, its phases and counts.
pub struct Session {
    pub(super) step: Step,
    keeps_history: bool,
    screen: Screen,
    pub(super) common: Common,
    started: Instant,
    phases: Vec<(String, f64)>,
    counts: Map<String, Value>,
}

impl Session {
    pub(super) fn new(step: Step, common: &Common) -> Self {
        let screen = Screen::new(&step.tool, common.quiet);
        Self {
            step,
            keeps_history: std::env::var_os("LF_HISTORY").is_none_or(|value| value != "off"),
            screen,
            common: common.clone(),
            started: Instant::now(),
            phases: Vec::new(),
            counts: Map::new(),
        }
    }

    /// Runs `work` as a named phase of `--stats`. Phases of one name add up; a phase inside another counts in both.
    pub fn phase<T>(&mut self, name: &str, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let place = self.phases.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.phases.push((name.to_owned(), 0.0));
            self.phases.len() - 1
        });
        let started = Instant::now();
        let outcome = work(self);
        io::release_memory();
        let seconds = started.elapsed().as_secs_f64();
        self.phases[place].1 += seconds;
        self.explain(format!("{name}: {seconds:.3} s"));
        outcome
    }

    /// Records a number for `--stats`; a later value of the same name replaces it.
    pub fn count(&mut self, name: &str, value: impl Into<Value>) {
        self.counts.insert(name.to_owned(), value.into());
    }

    /// Adds to a number for `--stats`, which begins at 0.
    pub fn add(&mut self, name: &str, value: usize) {
        let before = self.counts.get(name).and_then(Value::as_u64).unwrap_or(0);
        self.count(name, before + value as u64);
    }

    /// Records a number for `--stats`, unless a larger one of that name is recorded.
    pub fn keep_greatest(&mut self, name: &str, value: f64) {
        let before = self.counts.get(name).and_then(Value::as_f64).unwrap_or(f64::NEG_INFINITY);
        self.count(name, value.max(before));
    }

    /// Prints a line on standard error, unless `--quiet`.
    pub fn say(&self, line: impl AsRef<str>) {
        if !self.common.quiet {
            self.print(line.as_ref());
        }
    }

    /// Whether [`Session::explain`] prints. Guards expensive diagnostics.
    pub fn is_verbose(&self) -> bool {
        self.common.verbose && !self.common.quiet
    }

    /// Prints a line on standard error with `--verbose`.
    pub fn explain(&self, line: impl AsRef<str>) {
        if self.is_verbose() {
            self.print(line.as_ref());
        }
    }

    /// Explains a step of long work: with `--verbose` always, otherwise as progress, unless there was a line of it
    /// in the last ten seconds.
    pub fn explain_step(&self, line: impl AsRef<str>) {
        if self.is_verbose() {
            self.print(line.as_ref());
        } else {
            self.screen.print_progress(line.as_ref());
        }
    }

    /// Prints `tool: warning: ...` on standard error, unless `--quiet`.
    pub fn warn(&self, line: impl AsRef<str>) {
        self.say(format!("warning: {}", line.as_ref()));
    }

    /// Writes the file of `--stats`; does nothing without it.
    pub(super) fn save_stats(&self) -> Result<()> {
        let Some(path) = &self.common.stats else { return Ok(()) };
        let phases: Map<_, _> = self.phases.iter().map(|(name, seconds)| (name.clone(), json!(seconds))).collect();
        let stats = json!({
            "tool": self.step.tool,
            "version": self.step.version,
            "threads": rayon::current_num_threads(),
            "seconds": self.started.elapsed().as_secs_f64(),
            "phases": phases,
            "peak_bytes": peak_bytes(),
            "counts": self.counts,
        });
        io::save_text(path, |out| writeln!(out, "{stats:#}"))
    }

    fn print(&self, line: &str) {
        self.screen.print(&one_line(&format!("{}: {line}", self.step.tool)));
    }

    /// A progress counter of `total` steps.
    pub fn progress(&self, what: &str, total: u64) -> Progress {
        self.screen.progress(what, total)
    }

    /// The history `before` with this run appended; empty with `LF_HISTORY=off`.
    pub fn history(&self, before: &History) -> History {
        if self.keeps_history { before.iter().chain([&self.step]).cloned().collect() } else { History::new() }
    }

    /// Checks that output, inputs and the `--stats` file are different files. Also refuses standard input twice.
    pub fn keep_apart(&self, output: &Path, inputs: &[&Path]) -> Result<()> {
        let clash = |output: &Path, found: &str| {
            Err(Error::new(io::output_name(output), found, "wanted another file to write to"))
        };
        let inputs: Vec<&Path> = inputs.iter().map(|input| io::split_page(input).0).collect();
        if inputs.iter().filter(|input| io::is_standard(input)).count() > 1 {
            return Err(Error::new("standard input", "named more than once", "wanted - for one input only"));
        }
        for input in inputs {
            if io::same_file(output, input) {
                return clash(output, "is also an input");
            }
            if self.common.stats.as_ref().is_some_and(|stats| io::same_file(stats, input)) {
                return clash(input, "is an input and the --stats file");
            }
        }
        match &self.common.stats {
            Some(stats) if stats == output || io::same_file(stats, output) => {
                clash(output, "is the output and the --stats file")
            }
            _ => Ok(()),
        }
    }
}
