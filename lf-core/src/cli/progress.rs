//! Progress: a bar if standard error is a terminal, otherwise nothing.

use indicatif::{HumanCount, MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::Duration;

/// No forecast of the time left before this time.
const SETTLED: Duration = Duration::from_secs(2);

/// Standard error: lines and bars that do not overwrite each other.
pub(super) struct Screen {
    bars: Option<MultiProgress>,
}

impl Screen {
    pub(super) fn new(quiet: bool) -> Self {
        let visible = !quiet && std::io::stderr().is_terminal();
        Self { bars: visible.then(|| MultiProgress::with_draw_target(ProgressDrawTarget::stderr())) }
    }

    /// Prints a line. A closed standard error is ignored.
    pub(super) fn print(&self, line: &str) {
        let print = || writeln!(std::io::stderr().lock(), "{line}");
        let _ = self.bars.as_ref().map_or_else(print, |bars| bars.suspend(print));
    }

    pub(super) fn progress(&self, what: &str, total: u64) -> Progress {
        let Some(bars) = &self.bars else { return Progress::hidden() };
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
        Progress { bar: Some((bars.add(bar), bars.clone())) }
    }
}

/// A progress counter; dropping it removes its bar. Cheap, `Sync`, silent unless standard error is a terminal.
pub struct Progress {
    bar: Option<(ProgressBar, MultiProgress)>,
}

impl Progress {
    /// A counter that shows nothing, for callers without a [`super::Session`].
    pub fn hidden() -> Self {
        Self { bar: None }
    }

    /// Adds `steps` to the count.
    pub fn add(&self, steps: u64) {
        if let Some((bar, _)) = &self.bar {
            bar.inc(steps);
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
