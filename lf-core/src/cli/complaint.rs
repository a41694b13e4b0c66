//! The one line on standard error that ends a failed run, also for a mistake on the command line.

use crate::io;
use std::{ffi::OsString, io::Write, process::ExitCode};

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

/// Prints the help that was asked for, or one line about the mistake that `clap` found.
pub(super) fn answer(tool: &str, error: &clap::Error, command: &clap::Command, typed: &[OsString]) -> ExitCode {
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
            // Replace the standard library's messages about a word that is not a number.
            let what = what.replace("invalid digit found in string", "wanted a whole number of 0 or more");
            let what = what.replace("invalid float literal", "wanted a number");
            let what = what.replace("number too large to fit in target type", "wanted a smaller number");
            let tip = paragraphs.map(words).find_map(|paragraph| Some(paragraph.strip_prefix("tip: ")?.to_owned()));
            usage(tool, &tip.map_or_else(|| what.to_owned(), |tip| format!("{what} ({tip})")))
        }
    }
}

/// The option and the negative number that it does not take: clap reports the number as an unknown option.
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
    fn a_line_stays_a_line() {
        assert_eq!(one_line("a\nb\tc\u{1b}[0m\n"), "a b c [0m");
    }
}
