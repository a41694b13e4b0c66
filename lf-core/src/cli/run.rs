//! A tool's `main`.

use super::complaint::{answer, complain, usage};
use super::session::{Common, Session};
use super::{generate, help_all};
use crate::{Result, history::Step, io};
use std::panic::{self, AssertUnwindSafe};
use std::{ffi::OsString, io::Write, path::Path, process::ExitCode, sync::Mutex};

/// Upper limit of `--threads`. Each thread costs a stack; a larger number is a typing error.
const MAX_THREADS: usize = 1024;

/// The environment variable that gives rayon the number of its workers.
const THREADS_VARIABLE: &str = "RAYON_NUM_THREADS";

/// How a run ended if nothing failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The work is done: exit code 0.
    Done,
    /// It was judged and the answer is no: exit code 1.
    No,
}

/// Message and source location of the last panic.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// A tool's `main`: parses the command line, runs `body`, and turns its outcome into an exit code. The
/// first word `--generate` prints a man page or shell completions instead. `--help-all` prints the help of all options.
pub fn run<A: clap::Parser>(
    tool: &'static str,
    common: impl FnOnce(&A) -> &Common,
    body: impl FnOnce(&A, &mut Session) -> Result<Verdict>,
) -> ExitCode {
    io::guard(tool);
    let words: Vec<_> = std::env::args_os().skip(1).collect();
    if let [first, words @ ..] = words.as_slice()
        && first == generate::OPTION
    {
        let printed = generate::text(tool, help_all::with_all_shown(A::command()), words)
            .and_then(|text| io::save_text(Path::new("-"), |out| out.write_all(&text)));
        return printed.map_or_else(|error| complain(tool, &error.to_string()), |()| ExitCode::SUCCESS);
    }
    let shows_all = help_all::is_wanted(&words);
    let mut command = if shows_all { help_all::with_all_shown } else { help_all::with_option }(A::command());
    let parsed = command.try_get_matches_from_mut(std::env::args_os());
    let arguments = match parsed.and_then(|matches| A::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(error) => return answer(tool, &error, &A::command(), &words),
    };
    let common = common(&arguments);
    if let Err(message) = start_threads(common.threads) {
        return usage(tool, &message);
    }
    let mut session = Session::new(step::<A>(tool, &words), common);
    report(tool, || {
        common.stats.as_deref().map_or(Ok(()), io::check_place)?;
        let verdict = body(&arguments, &mut session)?;
        std::io::stdout().flush().map_err(|error| io::writing("standard output", &error))?;
        io::check_inputs()?;
        session.save_stats()?;
        Ok(verdict)
    })
}

/// Starts `typed` workers; for 0, the number in the environment variable, or one a core. The error names a number that
/// is too large.
fn start_threads(typed: usize) -> std::result::Result<(), String> {
    let variable = std::env::var(THREADS_VARIABLE).ok().and_then(|value| value.parse::<u64>().ok());
    let (name, count) = match (typed, variable) {
        (0, Some(count)) => (THREADS_VARIABLE, count),
        (0, None) => ("--threads", 0),
        (typed, _) => ("--threads", typed as u64),
    };
    if count > MAX_THREADS as u64 {
        return Err(format!("{name}: {count}; wanted at most {MAX_THREADS}"));
    }
    let built = rayon::ThreadPoolBuilder::new().num_threads(typed).build_global();
    built.map_err(|error| format!("{name}: {error}; wanted threads that the system can start"))
}

fn step<A: clap::Parser>(tool: &str, words: &[OsString]) -> Step {
    let version = A::command().get_version().unwrap_or(env!("CARGO_PKG_VERSION")).to_owned();
    let arguments = words.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    Step { tool: tool.to_owned(), version, arguments }
}

/// Runs `work` and turns its verdict, its error or its panic into an exit code and at most one line.
fn report(tool: &str, work: impl FnOnce() -> Result<Verdict>) -> ExitCode {
    panic::set_hook(Box::new(|panic| {
        let payload = panic.payload();
        let message = payload.downcast_ref::<&str>().copied();
        let message = message.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message");
        let place = panic.location().map(|place| format!(" ({}:{})", place.file(), place.line()));
        if let Ok(mut last) = PANIC.lock() {
            *last = Some(format!("{message}{}", place.unwrap_or_default()));
        }
    }));
    match panic::catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(Verdict::Done)) => ExitCode::SUCCESS,
        Ok(Ok(Verdict::No)) => ExitCode::from(1),
        Ok(Err(error)) => complain(tool, &error.to_string()),
        Err(_) => {
            let message = PANIC.lock().ok().and_then(|mut last| last.take()).unwrap_or_default();
            complain(tool, &format!("internal error: {message}; please report it"))
        }
    }
}
