//! What the six front doors share: exit codes, errors, progress, `--stats`, `--threads`.
//!
//! Exit codes: 0 done, 1 judged and the answer is no, 2 the work could not be done. Whatever goes wrong ends in one line
//! on standard error that starts with the tool's name.

mod generate;
mod numbers;
mod preset;
mod progress;

use crate::history::{History, Step};
use crate::{Error, Result, io};
use progress::Screen;
use serde_json::{Map, Value, json};
use std::ffi::OsString;
use std::io::Write;
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::Instant;

pub use numbers::numbers;
pub use preset::{Preset, word};
pub use progress::Progress;

/// Above this a `--threads` is a slip of the finger, and each thread costs a stack.
const MOST_THREADS: usize = 1024;

/// What a tool holds that has read its inputs, where the system does not tell.
const HELD_BYTES: u64 = 1 << 26;

/// Options that mean the same in every tool; `#[command(flatten)]` it at the top of a tool's arguments.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Worker threads; 0 takes every core
    #[arg(long, value_name = "N", default_value_t = 0, global = true)]
    pub threads: usize,
    /// Write seconds per phase, peak memory and counts to FILE as JSON
    #[arg(long, value_name = "FILE", global = true)]
    pub stats: Option<PathBuf>,
    /// Print errors only
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Say what was decided and why
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

/// How a run ended when nothing failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The work is done: exit code 0.
    Done,
    /// It was judged and the answer is no: exit code 1.
    No,
}

/// One run of a tool.
pub struct Session {
    step: Step,
    keeps_history: bool,
    quiet: bool,
    verbose: bool,
    screen: Screen,
    stats: Option<PathBuf>,
    started: Instant,
    phases: Vec<(String, f64)>,
    counts: Map<String, Value>,
}

impl Session {
    fn new(step: Step, common: &Common) -> Self {
        Self {
            step,
            keeps_history: std::env::var_os("LF_HISTORY").is_none_or(|value| value != "off"),
            quiet: common.quiet,
            verbose: common.verbose,
            screen: Screen::new(common.quiet),
            stats: common.stats.clone(),
            started: Instant::now(),
            phases: Vec::new(),
            counts: Map::new(),
        }
    }

    /// Runs `work` as a named phase; its seconds go to `--stats`, added up where a name returns. A phase inside another
    /// counts in both.
    pub fn phase<T>(&mut self, name: &str, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let place = self.phases.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.phases.push((name.to_owned(), 0.0));
            self.phases.len() - 1
        });
        let started = Instant::now();
        let outcome = work(self);
        let seconds = started.elapsed().as_secs_f64();
        self.phases[place].1 += seconds;
        self.explain(format!("{name}: {seconds:.3} s"));
        outcome
    }

    /// Records a number for `--stats`; the last value of a name stays.
    pub fn count(&mut self, name: &str, value: impl Into<Value>) {
        self.counts.insert(name.to_owned(), value.into());
    }

    /// A line on standard error, unless `--quiet`.
    pub fn say(&self, line: impl AsRef<str>) {
        if !self.quiet {
            self.print(line.as_ref());
        }
    }

    /// Whether anyone hears what [`Session::explain`] says: what is dear to find out is asked for only then.
    pub fn is_verbose(&self) -> bool {
        self.verbose && !self.quiet
    }

    /// A line on standard error with `--verbose`.
    pub fn explain(&self, line: impl AsRef<str>) {
        if self.verbose && !self.quiet {
            self.print(line.as_ref());
        }
    }

    /// A warning on standard error, `tool: warning: ...`, unless `--quiet`.
    pub fn warn(&self, line: impl AsRef<str>) {
        if !self.quiet {
            self.print(&format!("warning: {}", line.as_ref()));
        }
    }

    fn print(&self, line: &str) {
        self.screen.print(&one_line(&format!("{}: {line}", self.step.tool)));
    }

    /// A progress counter of `total` steps: a bar on a terminal, nothing elsewhere. Cheap, `Sync`.
    pub fn progress(&self, what: &str, total: u64) -> Progress {
        self.screen.progress(what, total)
    }

    /// `before` with this run appended; empty with `LF_HISTORY=off`.
    pub fn history(&self, before: &History) -> History {
        if !self.keeps_history {
            return History::new();
        }
        before.iter().chain([&self.step]).cloned().collect()
    }

    /// Refuses an output that is the same file as an input, and a `--stats` file that is one of them.
    pub fn keep_apart(&self, output: &Path, inputs: &[&Path]) -> Result<()> {
        let clash = |output: &Path, found: &str| {
            Err(Error::new(io::output_name(output), found, "wanted another file to write to"))
        };
        if inputs.iter().filter(|input| io::is_standard(input)).count() > 1 {
            return Err(Error::new("standard input", "named more than once", "wanted - for one input only"));
        }
        for input in inputs {
            if io::same_file(output, input) {
                return clash(output, "is also an input");
            }
            if self.stats.as_ref().is_some_and(|stats| io::same_file(stats, input)) {
                return clash(input, "is an input and the --stats file");
            }
        }
        match &self.stats {
            Some(stats) if stats == output || io::same_file(stats, output) => {
                clash(output, "is the output and the --stats file")
            }
            _ => Ok(()),
        }
    }

    /// Prints what `--estimate` asks for, one JSON object on standard output: the memory that a run will hold at its most,
    /// `memory_bytes`, which is `work_bytes` beside what is held already by now, when the inputs are read, and `counts`.
    pub fn tell_estimate(&mut self, work_bytes: u64, counts: &[(&str, u64)]) -> Result<()> {
        let held = status_bytes("VmRSS:").unwrap_or(HELD_BYTES) + work_bytes;
        let memory_bytes = held.max(peak_bytes().unwrap_or(0));
        self.count("estimated_bytes", memory_bytes);
        let counts = counts.iter().map(|(name, count)| ((*name).to_owned(), json!(count)));
        let told: Map<String, Value> =
            [("memory_bytes".to_owned(), json!(memory_bytes))].into_iter().chain(counts).collect();
        io::save_text(Path::new("-"), |out| writeln!(out, "{}", Value::Object(told)))
    }

    fn save_stats(&self) -> Result<()> {
        let Some(path) = &self.stats else {
            return Ok(());
        };
        let phases: Map<String, Value> =
            self.phases.iter().map(|(name, seconds)| (name.clone(), json!(seconds))).collect();
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
}

/// Peak resident memory of this process; none where the system does not tell.
fn peak_bytes() -> Option<u64> {
    status_bytes("VmHWM:")
}

/// A line of what the system says of this process.
fn status_bytes(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// Control characters, in a file name or a message from elsewhere, may not break a line in two.
fn one_line(text: &str) -> String {
    text.trim_end().chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

fn complain(tool: &str, what: &str) -> ExitCode {
    let _ = writeln!(std::io::stderr().lock(), "{}", one_line(&format!("{tool}: {what}")));
    ExitCode::from(2)
}

fn usage(tool: &str, what: &str) -> ExitCode {
    complain(tool, &format!("{what}; see '{tool} --help'"))
}

/// The whole of a tool's `main`: parses, runs, reports, and turns the outcome into an exit code.
pub fn run<A: clap::Parser>(
    tool: &'static str,
    common: impl FnOnce(&A) -> &Common,
    body: impl FnOnce(&A, &mut Session) -> Result<Verdict>,
) -> ExitCode {
    let words: Vec<_> = std::env::args_os().skip(1).collect();
    if let [first, words @ ..] = words.as_slice()
        && first == generate::OPTION
    {
        let told = generate::text(tool, A::command(), words)
            .and_then(|text| io::save_text(Path::new("-"), |out| out.write_all(&text)));
        return told.map_or_else(|error| complain(tool, &error.to_string()), |()| ExitCode::SUCCESS);
    }
    let arguments = match A::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return answer(tool, &error, &A::command(), &words),
    };
    let common = common(&arguments);
    if common.threads > MOST_THREADS {
        return usage(tool, &format!("--threads: {}; wanted at most {MOST_THREADS}", common.threads));
    }
    if let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(common.threads).build_global() {
        return complain(tool, &format!("--threads: {error}; wanted fewer"));
    }
    let version = A::command().get_version().unwrap_or(env!("CARGO_PKG_VERSION")).to_owned();
    let typed = words.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let mut session = Session::new(Step { tool: tool.to_owned(), version, arguments: typed }, common);

    static PANIC: Mutex<Option<String>> = Mutex::new(None);
    panic::set_hook(Box::new(|panic| {
        let payload = panic.payload();
        let message = payload.downcast_ref::<&str>().copied();
        let message = message.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message");
        let place = panic.location().map(|place| format!(" ({}:{})", place.file(), place.line()));
        if let Ok(mut last) = PANIC.lock() {
            *last = Some(format!("{message}{}", place.unwrap_or_default()));
        }
    }));
    let outcome = panic::catch_unwind(AssertUnwindSafe(|| {
        session.stats.as_deref().map_or(Ok(()), io::check_place)?;
        let verdict = body(&arguments, &mut session)?;
        std::io::stdout().flush().map_err(|error| io::writing("standard output", &error))?;
        session.save_stats()?;
        Ok(verdict)
    }));
    match outcome {
        Ok(Ok(Verdict::Done)) => ExitCode::SUCCESS,
        Ok(Ok(Verdict::No)) => ExitCode::from(1),
        Ok(Err(error)) => {
            let error: Error = error;
            complain(tool, &error.to_string())
        }
        Err(_) => {
            let message = PANIC.lock().ok().and_then(|mut last| last.take()).unwrap_or_default();
            complain(tool, &format!("internal error: {message}; please report it"))
        }
    }
}

/// What clap has to say instead of arguments: help asked for, or one line about a slip.
fn answer(tool: &str, error: &clap::Error, command: &clap::Command, typed: &[OsString]) -> ExitCode {
    use clap::error::ErrorKind;
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            match error.print().and_then(|()| std::io::stdout().flush()) {
                Ok(()) => ExitCode::SUCCESS,
                Err(error) => complain(tool, &io::writing("standard output", &error).to_string()),
            }
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand | ErrorKind::MissingSubcommand => {
            let tasks: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
            let wanted = if tasks.is_empty() { "more".to_owned() } else { format!("one of {}", tasks.join(", ")) };
            usage(tool, &format!("nothing to do; wanted {wanted}"))
        }
        _ => {
            if let Some((option, number)) = negative(error, command, typed) {
                return usage(tool, &format!("{option}: {number}; wanted a number of 0 or more"));
            }
            let text = error.render().to_string();
            let mut paragraphs = text.split("\n\n");
            let words = |paragraph: &str| paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
            let what = words(paragraphs.next().unwrap_or_default());
            let what = what.strip_prefix("error: ").unwrap_or(&what);
            // What the standard library says of a word that is no number.
            let what = what.replace("invalid digit found in string", "wanted a whole number of 0 or more");
            let what = what.replace("invalid float literal", "wanted a number");
            let what = what.replace("number too large to fit in target type", "wanted a smaller number");
            let tip = paragraphs.map(words).find_map(|paragraph| Some(paragraph.strip_prefix("tip: ")?.to_owned()));
            usage(tool, &tip.map_or_else(|| what.to_owned(), |tip| format!("{what} ({tip})")))
        }
    }
}

/// An option that takes no negative number, and the one that was typed after it, which clap takes for another option.
fn negative(error: &clap::Error, command: &clap::Command, typed: &[OsString]) -> Option<(String, String)> {
    use clap::error::{ContextKind, ContextValue};
    let ContextValue::String(found) = error.get(ContextKind::InvalidArg)? else { return None };
    let place = typed.iter().position(|word| word.to_str().is_some_and(|word| word.starts_with(found.as_str())))?;
    let number = typed[place].to_str().filter(|word| word.parse::<f64>().is_ok())?;
    let option = typed[..place].last()?.to_str()?;
    let task = command.get_subcommands().find(|task| typed[..place].iter().any(|word| word == task.get_name()));
    let name = option.strip_prefix("--")?;
    let mut options = task.unwrap_or(command).get_arguments().filter(|known| known.get_long() == Some(name));
    options.any(|known| known.get_action().takes_values()).then(|| (option.to_owned(), number.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_memory_is_known_here() {
        assert!(peak_bytes().is_some_and(|bytes| bytes > 100_000));
    }

    #[test]
    fn a_line_stays_a_line() {
        assert_eq!(one_line("a\nb\tc\u{1b}[0m\n"), "a b c [0m");
    }
}
