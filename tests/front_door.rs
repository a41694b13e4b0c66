//! Rules that all command lines share.

use lf_tests::Call;
use lf_tests::samples::Samples;
use lf_tests::tools::TOOLS;
use lf_tests::uses::{is_tested, uses};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

fn tools() -> impl Iterator<Item = &'static str> {
    TOOLS.into_iter().filter(|tool| is_tested(tool))
}

/// Scar: the rules for every tool left out lf-fit, which had no use.
#[test]
fn every_tool_has_a_use() {
    for tool in tools() {
        assert!(uses().any(|this| this.tool == tool), "{tool}");
    }
}

#[test]
fn help_and_version_go_to_standard_output() {
    for tool in tools() {
        for word in ["--help", "-h"] {
            let help = Call::new(tool).word(word).run().done();
            let text = String::from_utf8(help.stdout).unwrap();
            assert!(help.stderr.is_empty(), "{tool}");
            for word in ["--threads", "--stats", "--quiet", "--verbose"] {
                assert!(text.contains(word), "{tool} has no {word}");
            }
            assert!(text.lines().all(|line| line.chars().count() <= 100), "{tool} {word} is wider than 100");
        }
        let version = Call::new(tool).word("--version").run().done();
        assert!(version.stdout.starts_with(tool.as_bytes()), "{tool}");
        Call::new(tool).word("--help").closed_pipe().run().refused("standard output");
    }
}

#[test]
fn a_mistyped_option_is_refused_in_one_line() {
    let samples = Samples::new();
    for this in uses() {
        let call = || this.sound_call(&samples, &samples.path("slip"));
        call().word("--no-such-option").run().refused("--no-such-option");
        call().words(["--threads", "many"]).run().refused("--threads");
        call().words(["--threads", "100000"]).run().refused("--threads");
        assert!(!samples.path("slip").exists(), "{this:?}");
    }
}

#[test]
fn a_run_is_silent_and_quiet_is_never_louder() {
    let samples = Samples::new();
    for this in uses() {
        let output = samples.path(this.output().unwrap_or("unused"));
        let ended = this.sound_call(&samples, &output).word("--quiet").run().done();
        assert_eq!(ended.stderr, "", "{this:?}");
        if this.output().is_some() {
            assert!(ended.stdout.is_empty(), "{this:?}");
        }
        let verbose = this.sound_call(&samples, &output).word("--verbose").run().done();
        let begins = format!("{}: ", this.tool);
        assert!(verbose.stderr.lines().all(|line| line.starts_with(&begins)), "{this:?}\n{}", verbose.stderr);
    }
}

#[test]
fn stats_are_json_with_the_agreed_keys() {
    let samples = Samples::new();
    for this in uses() {
        let output = samples.path(this.output().unwrap_or("unused"));
        let stats = samples.path("stats.json");
        this.sound_call(&samples, &output).words(["--threads", "2", "--stats"]).word(&stats).run().done();
        let found: Value = serde_json::from_slice(&fs::read(&stats).unwrap()).unwrap();
        assert_eq!(found["tool"], this.tool);
        assert_eq!(found["threads"], 2, "{this:?}");
        assert!(found["peak_bytes"].as_u64().is_some_and(|bytes| bytes > 0), "{this:?}");
        assert!(!found["phases"].as_object().unwrap().is_empty(), "{this:?}");
        assert!(found["phases"].as_object().unwrap().values().all(Value::is_number), "{this:?}");
        fs::remove_file(stats).unwrap();
    }
}

#[test]
fn headers_remember_the_run_unless_history_is_off() {
    let samples = Samples::new();
    let info = |output: &Path| {
        String::from_utf8(Call::new("lf-validate").word("info").word(output).run().done().stdout).unwrap()
    };
    for this in uses().filter(|this| this.output().is_some_and(|name| name.contains(".lfv") || name.contains(".exr"))) {
        let output = samples.path(this.output().unwrap());
        this.sound_call(&samples, &output).env("LF_HISTORY", "on").run().done();
        assert!(info(&output).contains(&format!("{} {}", this.tool, env!("CARGO_PKG_VERSION"))), "{this:?}");
        this.sound_call(&samples, &output).run().done();
        assert!(!info(&output).contains(this.tool), "{this:?}");
    }
}

/// The text of `--generate`.
fn generated(tool: &str, words: &[&str]) -> String {
    String::from_utf8(Call::new(tool).word("--generate").words(words).run().done().stdout).unwrap()
}

/// The long options that a help text lists.
fn options(help: &str) -> Vec<String> {
    let listed = help.lines().filter(|line| line.trim_start().starts_with('-'));
    let words =
        listed.flat_map(|line| line.split([' ', ',']).take_while(|word| word.is_empty() || word.starts_with('-')));
    words.filter(|word| word.starts_with("--")).map(str::to_owned).collect()
}

#[test]
fn man_pages_name_every_option() {
    for tool in tools() {
        let tasks = generated(tool, &["tasks"]);
        let tasks: Vec<&str> = tasks.lines().collect();
        for task in tasks.iter().copied().map(Some).chain([None]) {
            let page = generated(tool, &["man"].into_iter().chain(task).collect::<Vec<_>>());
            let page = page.replace("\\-", "-");
            let name = [tool].into_iter().chain(task).collect::<Vec<_>>().join("-");
            assert!(page.contains(&format!("{name} - ")), "{name}\n{page}");
            let help = Call::new(tool).words(task).word("--help-all").run().done().stdout;
            let help = String::from_utf8(help).unwrap();
            let listed = options(&help);
            assert!(listed.len() > 4, "{name}: {listed:?}");
            listed.iter().for_each(|option| assert!(page.contains(option.as_str()), "{name} has no {option}\n{page}"));
            assert!(!help.contains("--generate"), "{name} shows users what only packagers need");
        }
    }
}

#[test]
fn every_help_ends_with_two_examples() {
    for tool in tools() {
        let tasks = generated(tool, &["tasks"]);
        for task in tasks.lines().map(Some).chain([None]) {
            let help = Call::new(tool).words(task).word("--help").run().done().stdout;
            let help = String::from_utf8(help).unwrap();
            let (_, examples) = help.rsplit_once("\nExamples").unwrap_or_else(|| panic!("{tool} {task:?} has none"));
            let count = examples.lines().filter(|line| line.starts_with("  lf-")).count();
            assert_eq!(count, 2, "{tool} {task:?}{examples}");
        }
    }
}

#[test]
fn completions_are_read_by_their_shells() {
    for tool in tools() {
        for shell in ["bash", "zsh", "fish"] {
            let script = generated(tool, &[shell]);
            assert!(script.contains(tool) && script.contains("threads"), "{tool} {shell}");
            let child = Command::new(shell).arg("-n").stdin(Stdio::piped()).spawn();
            // Not every machine has every shell.
            let Ok(mut child) = child else { continue };
            child.stdin.take().unwrap().write_all(script.as_bytes()).unwrap();
            assert!(child.wait().unwrap().success(), "{tool} {shell}");
        }
        Call::new(tool).words(["--generate", "csh"]).run().refused("csh");
        Call::new(tool).words(["--generate", "man", "nothing"]).run().refused("nothing");
    }
}
