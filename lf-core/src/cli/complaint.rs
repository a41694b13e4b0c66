//! The one line on standard error that ends a failed run.

use std::io::Write;
use std::process::ExitCode;

/// Control characters in a file name or in a foreign message must not break the line.
pub(super) fn one_line(text: &str) -> String {
    text.trim_end().chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

/// Prints `tool: what` on standard error; exit code 2.
pub(super) fn complain(tool: &str, what: &str) -> ExitCode {
    let _ = writeln!(std::io::stderr().lock(), "{}", one_line(&format!("{tool}: {what}")));
    ExitCode::from(2)
}

/// Complains about the command line and points to `--help`.
pub(super) fn usage(tool: &str, what: &str) -> ExitCode {
    complain(tool, &format!("{what}; see '{tool} --help'"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_a_line() {
        assert_eq!(one_line("a\nb\tc\u{1b}[0m\n"), "a b c [0m");
    }
}
