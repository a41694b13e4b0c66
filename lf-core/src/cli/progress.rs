//! Progress: a bar if standard error is a terminal, otherwise a line now and then.

use indicatif::{HumanCount, MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// No forecast of the time left before this time.
const SETTLED: Duration = Duration::from_secs(2);

/// Time between two lines of progress. Most runs end before the first.
const BETWEEN: Duration = Duration::from_secs(10);

/// Lines of progress with time between them.
struct Pace {
    tool: String,
    last: Mutex<Instant>,
}

impl Pace {
    fn print(&self, line: impl FnOnce() -> String) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() >= BETWEEN {
            *last = Instant::now();
            let _ = writeln!(std::io::stderr().lock(), "{}: progress: {}", self.tool, line());
        }
    }
}

/// Standard error: lines and bars that do not overwrite each other.
pub(super) struct Screen {
    bars: Option<MultiProgress>,
    pace: Option<Arc<Pace>>,
}

impl Screen {
    pub(super) fn new(tool: &str, quiet: bool) -> Self {
        let visible = !quiet && std::io::stderr().is_terminal();
        Self {
            bars: visible.then(|| MultiProgress::with_draw_target(ProgressDrawTarget::stderr())),
            pace: (!quiet).then(|| Arc::new(Pace { tool: tool.to_owned(), last: Mutex::new(Instant::now()) })),
        }
    }

    /// Prints a line. A closed standard error is ignored.
    pub(super) fn print(&self, line: &str) {
        let print = || writeln!(std::io::stderr().lock(), "{line}");
        let _ = self.bars.as_ref().map_or_else(print, |bars| bars.suspend(print));
    }

    /// Prints a line of progress, unless there was one in the last ten seconds. For work of unknown length.
    pub(super) fn print_progress(&self, line: &str) {
        if let Some(pace) = &self.pace {
            pace.print(|| line.to_owned());
        }
    }

    pub(super) fn progress(&self, what: &str, total: u64) -> Progress {
        let Some(bars) = &self.bars else {
            let lines =
                |pace: &Arc<Pace>| Lines { pace: pace.clone(), what: what.to_owned(), total, done: AtomicU64::new(0) };
            return Progress { bar: None, lines: self.pace.as_ref().map(lines) };
        };
        // The least important parts come last, where a narrow terminal cuts them off.
        let style = "{msg:<10} {percent:>3}% {left:>4} left [{wide_bar:.dim}] {human_pos}/{human_len} {rate}/s";
        let style = ProgressStyle::with_template(style).unwrap_or_else(|_| ProgressStyle::default_bar());
        let style = style.with_key("rate", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let rate = state.per_sec();
            let _ = if rate < 10.0 { write!(out, "{rate:.1}") } else { write!(out, "{}", HumanCount(rate as u64)) };
        });
        let style = style.with_key("left", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // The first steps of many threads do not show the pace.
            let _ = match state.eta().as_secs() {
                _ if state.elapsed() < SETTLED => write!(out, "?"),
                seconds @ 0..100 => write!(out, "{seconds}s"),
                seconds @ 100..6000 => write!(out, "{}m", seconds / 60),
                seconds => write!(out, "{}h", seconds / 3600),
            };
        });
        let bar = ProgressBar::new(total).with_style(style.progress_chars("=> ")).with_message(what.to_owned());
        Progress { bar: Some((bars.add(bar), bars.clone())), lines: None }
    }
}

/// Progress as lines of a log.
struct Lines {
    pace: Arc<Pace>,
    what: String,
    total: u64,
    done: AtomicU64,
}

/// A progress counter; dropping it removes its bar. Cheap, `Sync`. Where standard error is not a terminal, it prints a
/// line of the share done, at most one in ten seconds.
pub struct Progress {
    bar: Option<(ProgressBar, MultiProgress)>,
    lines: Option<Lines>,
}

impl Progress {
    /// A counter that shows nothing, for callers without a [`super::Session`].
    pub fn hidden() -> Self {
        Self { bar: None, lines: None }
    }

    /// Adds `steps` to the count.
    pub fn add(&self, steps: u64) {
        if let Some((bar, _)) = &self.bar {
            bar.inc(steps);
        }
        if let Some(Lines { pace, what, total, done }) = &self.lines {
            let done = done.fetch_add(steps, Ordering::Relaxed) + steps;
            pace.print(|| format!("{what}, {} % of {total}", 100 * done / total.max(&1)));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((bar, bars)) = self.bar.take() {
            bar.finish_and_clear();
            bars.remove(&bar);
        }
    }
}
