//! `--help-all`: the long help with the options for experiments, which `--help` hides.

use clap::{Arg, ArgAction, Command};
use std::ffi::OsString;
use std::fmt::Write;

const NAME: &str = "help-all";

/// The option as it is typed.
pub(super) const OPTION: &str = "--help-all";

/// The last line of the help of a command with hidden options.
const MENTION: &str = "--help-all prints this help with the options for experiments.";

/// Whether the option is among the words of a command line.
pub(super) fn is_wanted(words: &[OsString]) -> bool {
    words.iter().take_while(|word| *word != "--").any(|word| word == OPTION)
}

/// The command and its subcommands with the option added. Help that hides options mentions it in its last line.
pub(super) fn with_option(command: Command) -> Command {
    let hides_options = command.get_arguments().any(Arg::is_hide_set);
    let help = "Print help with the options for experiments";
    let option = Arg::new(NAME).long(NAME).help(help).action(ArgAction::HelpLong).hide(true);
    let command = command.mut_subcommands(with_option).arg(option);
    if !hides_options {
        return command;
    }
    let mut help = command.get_after_help().cloned().unwrap_or_default();
    let gap = if help.to_string().is_empty() { "" } else { "\n\n" };
    let _ = write!(help, "{gap}{MENTION}");
    command.after_help(help)
}

/// The command and its subcommands with every option visible.
pub(super) fn with_all_shown(command: Command) -> Command {
    let option = Arg::new(NAME).long(NAME).help("Print this help").action(ArgAction::HelpLong);
    command.arg(option).mut_args(|arg| arg.hide(false)).mut_subcommands(with_all_shown)
}
