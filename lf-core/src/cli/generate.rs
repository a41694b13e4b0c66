//! `--generate`: man pages and shell completions from the texts of `--help-all`. Hidden: only `scripts/man` needs it.

use crate::{Error, Result};
use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;
use std::{ffi::OsString, io::Write};

/// The option; it must be the first word.
pub(super) const OPTION: &str = "--generate";

const WANTED: &str = "wanted man, bash, zsh, fish or tasks; man TASK for the page of a subcommand";

/// All tools; every page lists the others at its end.
const TOOLS: [&str; 8] =
    ["lf-synth", "lf-calib", "lf-prune", "lf-mart", "lf-fit", "lf-xcorr", "lf-flow", "lf-validate"];

/// The text of `--generate WORDS`: a man page for `man` or `man TASK`, completions for `bash`, `zsh` or `fish`, and the
/// names of the subcommands, one a line, for `tasks`.
pub(super) fn text(tool: &'static str, command: Command, words: &[OsString]) -> Result<Vec<u8>> {
    let words: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
    let words: Vec<&str> = words.iter().map(|word| &**word).collect();
    let mut command = command.name(tool).bin_name(tool);
    let mut text = Vec::new();
    let refused = |found: String| Error::new(OPTION, found, WANTED);
    let shell = match words.as_slice() {
        ["man", task @ ..] => {
            command = command.disable_help_subcommand(true);
            command.build();
            let page_of = match task {
                [] => Some(&command),
                [task] => command.find_subcommand(task),
                _ => None,
            };
            let page_of = page_of.ok_or_else(|| refused(format!("no subcommand '{}'", task.join(" "))))?;
            page(tool, page_of, &mut text).map_err(|error| refused(error.to_string()))?;
            return Ok(text);
        }
        ["tasks"] => {
            command.get_subcommands().for_each(|task| text.extend(format!("{}\n", task.get_name()).bytes()));
            return Ok(text);
        }
        ["bash"] => Shell::Bash,
        ["zsh"] => Shell::Zsh,
        ["fish"] => Shell::Fish,
        _ => return Err(refused(format!("'{}'", words.join(" ")))),
    };
    clap_complete::generate(shell, &mut command, tool, &mut text);
    Ok(text)
}

/// Writes the man page of a built command: the texts of `--help` under the headings of a man page.
fn page(tool: &str, command: &Command, out: &mut Vec<u8>) -> std::io::Result<()> {
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").trim().to_owned();
    let man = Man::new(command.clone().override_usage(usage)).manual("Light-field PIV");
    man.render_title(out)?;
    man.render_name_section(out)?;
    man.render_synopsis_section(out)?;
    man.render_description_section(out)?;
    man.render_options_section(out)?;
    if command.has_subcommands() {
        man.render_subcommands_section(out)?;
    }
    if let Some(examples) = command.get_after_help() {
        let examples = examples.to_string();
        let (title, lines) = examples.split_once('\n').unwrap_or(("", &examples));
        let title = title.trim_start_matches("Examples").trim_start_matches([',', ';', ':', ' ']);
        let title = title.chars().take(1).flat_map(char::to_uppercase).chain(title.chars().skip(1)).collect::<String>();
        let title = if title.is_empty() { title } else { format!("{}\n.PP\n", plain(&title)) };
        writeln!(out, ".SH EXAMPLES\n{title}.nf")?;
        lines.lines().try_for_each(|line| writeln!(out, "{}", plain(line)))?;
        writeln!(out, ".fi")?;
    }
    let judged = if tool == "lf-validate" { "\n.TP\n1\njudged, and the answer is no" } else { "" };
    let failed = "the work could not be done: one line on standard error says what was found and what was wanted";
    writeln!(out, ".SH EXIT STATUS\n.TP\n0\ndone{judged}\n.TP\n2\n{failed}")?;
    let history = "off leaves tool, version and arguments out of the history that files carry";
    writeln!(out, ".SH ENVIRONMENT\n.TP\n\\fBLF_HISTORY\\fR\n{history}")?;
    let own = command.get_display_name().unwrap_or(tool).to_owned();
    let others = TOOLS.into_iter().filter(|name| *name != own).map(|name| format!("\\fB{}\\fR(1)", plain(name)));
    writeln!(out, ".SH SEE ALSO\n{}", others.collect::<Vec<_>>().join(", "))
}

/// A line of text, escaped for roff.
fn plain(line: &str) -> String {
    let line = line.replace('\\', "\\e").replace('-', "\\-");
    if line.starts_with(['.', '\'']) { format!("\\&{line}") } else { line }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_not_read_as_commands() {
        assert_eq!(plain(".SH a -b \\"), "\\&.SH a \\-b \\e");
        assert_eq!(plain("  lf-mart"), "  lf\\-mart");
    }

    #[test]
    fn pages_of_tools_and_of_their_tasks() {
        let command = || {
            let task = Command::new("task").about("Does it").after_help("Examples:\n  lf-x task");
            Command::new("x").version("1").about("Some tool").subcommand(task)
        };
        let text = |words: &[&str]| {
            let words: Vec<OsString> = words.iter().map(OsString::from).collect();
            text("lf-x", command(), &words).map(|text| String::from_utf8(text).unwrap())
        };
        let page = text(&["man"]).unwrap();
        assert!(page.contains("lf\\-x \\- Some tool") && page.contains("lf\\-x\\-task(1)"), "{page}");
        let page = text(&["man", "task"]).unwrap();
        let examples = ".SH EXAMPLES\n.nf\n  lf\\-x task";
        assert!(page.contains("lf\\-x\\-task \\- Does it") && page.contains(examples), "{page}");
        assert_eq!(text(&["tasks"]).unwrap(), "task\n");
        for words in [&[][..], &["csh"], &["man", "word"], &["man", "task", "task"]] {
            assert!(text(words).is_err(), "{words:?}");
        }
        assert!(text(&["bash"]).unwrap().contains("complete -F"));
    }
}
