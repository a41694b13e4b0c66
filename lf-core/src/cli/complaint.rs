//! The one line on standard error that ends a failed run, also for a mistake on the command line.

use crate::{Result, io};
use std::{ffi::OsString, io::Write, path::Path, process::ExitCode};

/// Maximum length of a line, letters. A name, a value or a key of a damaged file may have any length.
const MAX_LETTERS: usize = 1000;
/// Letters kept at the end of a longer text: they say what was wanted.
const LAST_LETTERS: usize = 300;
/// Stands for the letters left out.
const GAP: &str = " [...] ";

/// The text as one line of at most [`MAX_LETTERS`] letters. Control characters in a file name or in a foreign message
/// must not break the line.
pub(super) fn one_line(text: &str) -> String {
    let text = text.trim_end();
    let plain = |letter: char| if letter.is_control() { ' ' } else { letter };
    let count = text.chars().count();
    if count <= MAX_LETTERS {
        return text.chars().map(plain).collect();
    }
    let first = text.chars().take(MAX_LETTERS - LAST_LETTERS - GAP.len());
    first.chain(GAP.chars()).chain(text.chars().skip(count - LAST_LETTERS)).map(plain).collect()
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
            let print = || -> Result<()> {
                io::check_place(Path::new("-"))?;
                let printed = error.print().and_then(|()| std::io::stdout().flush());
                printed.map_err(|error| io::writing("standard output", &error))
            };
            print().map_or_else(|error| complain(tool, &error.to_string()), |()| ExitCode::SUCCESS)
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand | ErrorKind::MissingSubcommand => {
            let tasks: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
            let wanted = if tasks.is_empty() { "more".to_owned() } else { format!("one of {}", tasks.join(", ")) };
            usage(tool, &format!("nothing to do; wanted {wanted}"))
        }
        _ => {
            let refuse = |what: &str| {
                let task = task(command, typed).map_or(String::new(), |task| format!(" {}", task.get_name()));
                complain(tool, &format!("{what}; see '{tool}{task} --help'"))
            };
            if let Some((option, number)) = negative(error, command, typed) {
                return refuse(&format!("{option}: {number}; wanted a number that is not negative"));
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
            refuse(&tip.map_or_else(|| what.to_owned(), |tip| format!("{what} ({tip})")))
        }
    }
}

/// The subcommand that was typed.
fn task<'c>(command: &'c clap::Command, typed: &[OsString]) -> Option<&'c clap::Command> {
    command.get_subcommands().find(|task| typed.iter().any(|word| word == task.get_name()))
}

/// The option and its negative number, or list of numbers, which clap reports as an unknown option.
fn negative(error: &clap::Error, command: &clap::Command, typed: &[OsString]) -> Option<(String, String)> {
    use clap::error::{ContextKind, ContextValue};
    let ContextValue::String(found) = error.get(ContextKind::InvalidArg)? else { return None };
    let place = typed.iter().position(|word| word.to_str().is_some_and(|word| word.starts_with(found.as_str())))?;
    let number = typed[place].to_str().filter(|word| word.split(',').all(|part| part.parse::<f64>().is_ok()))?;
    let option = typed[..place].last()?.to_str()?;
    let name = option.strip_prefix("--")?;
    let mut options = task(command, &typed[..place])
        .unwrap_or(command)
        .get_arguments()
        .filter(|known| known.get_long() == Some(name));
    options.any(|known| known.get_action().takes_values()).then(|| (option.to_owned(), number.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_a_line() {
        assert_eq!(one_line("a\nb\tc\u{1b}[0m\n"), "a b c [0m");
    }

    #[test]
    fn a_long_line_keeps_its_ends() {
        let whole = format!("name: {}", "x".repeat(MAX_LETTERS - 6));
        assert_eq!(one_line(&whole), whole);
        let line = one_line(&format!("name: {}; wanted less", "ü".repeat(100_000)));
        assert_eq!(line.chars().count(), MAX_LETTERS);
        assert!(
            line.starts_with("name: ü") && line.contains("ü [...] ü") && line.ends_with("ü; wanted less"),
            "{line}"
        );
    }
}
