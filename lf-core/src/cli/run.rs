//! The whole of a tool's `main`.

use super::complaint::{answer, complain, usage};
use super::generate;
use super::session::{Common, Session};
use crate::{Result, history::Step, io};
use std::panic::{self, AssertUnwindSafe};
use std::{ffi::OsString, io::Write, path::Path, process::ExitCode, sync::Mutex};

/// Upper limit of `--threads`. Each thread costs a stack; a larger number is a typing error.
const MOST_THREADS: usize = 1024;

/// How a run ended if nothing failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The work is done: exit code 0.
    Done,
    /// It was judged and the answer is no: exit code 1.
    No,
}

/// Message and place of the last panic.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// The whole of a tool's `main`: parses the command line, runs `body`, and turns its outcome into an exit code. The
/// first word `--generate` prints a man page or shell completions instead.
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
    let mut session = Session::new(step::<A>(tool, &words), common);
    report(tool, || {
        common.stats.as_deref().map_or(Ok(()), io::check_place)?;
        let verdict = body(&arguments, &mut session)?;
        std::io::stdout().flush().map_err(|error| io::writing("standard output", &error))?;
        session.save_stats()?;
        Ok(verdict)
    })
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
