//! scripts/paper/paper.mk: every size is sound, a figure is made, and a rule that fails leaves nothing.
//! scripts/paper/curves: medians over seeds, the Pareto front, and what it refuses.

use lf_tests::scripts::{has_programs, link_tools, text};
use lf_tests::tools::workspace;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// A run of make. None if a program is missing, which is said.
fn make(words: &[&str]) -> Option<Output> {
    if !has_programs(&["make", "bash", "awk", "python3"]) {
        return None;
    }
    let mut command = Command::new("make");
    command.current_dir(workspace()).env_remove("MAKEFLAGS").args(["-f", "scripts/paper/paper.mk"]).args(words);
    Some(command.output().unwrap())
}

/// Every file under a folder.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().map(Result::unwrap) {
        if entry.path().is_dir() {
            found.extend(files(&entry.path()));
        } else {
            found.push(entry.path().display().to_string());
        }
    }
    found.sort();
    found
}

#[test]
fn every_size_has_every_figure() {
    let place = tempfile::tempdir().unwrap();
    let out = format!("OUT={}", place.path().join("out").display());
    for size in ["small", "medium", "paper"] {
        let Some(output) = make(&["-n", &out, &format!("SIZE={size}"), "burn"]) else { return };
        let said = text(&output);
        assert!(output.status.success(), "{size}: {said}");
        for figure in 4..=17 {
            let is_there = said.contains(&format!("/fig{figure}"));
            assert_eq!(is_there, figure != 16, "{size}: figure {figure}");
        }
    }
    let said = text(&make(&["-n", &out, "SIZE=huge", "burn"]).unwrap());
    assert!(said.contains("SIZE is 'huge'; wanted small, medium or paper"), "{said}");
    assert!(files(place.path()).is_empty());
}

#[test]
fn a_figure_is_made_and_a_failed_rule_leaves_nothing() {
    let place = tempfile::tempdir().unwrap();
    let tools = place.path().join("tools");
    link_tools(&tools);
    let (bin, folder) = (format!("BIN={}/", tools.display()), place.path().join("out"));
    let out = format!("OUT={}", folder.display());
    let small = ["SEEDS=1", "FIG8_SIDE=2", "FIG8_DENSITIES=0.5", "FIG8_MART_DENSITIES=", "DRT_SWEEPS=2", "fig8"];
    let run = || make(&[&[bin.as_str(), out.as_str()], &small[..]].concat());
    let Some(output) = run() else { return };
    assert!(output.status.success(), "{}", text(&output));
    let made = files(&folder);
    // Without matplotlib there is no picture.
    let names = made.iter().filter_map(|file| file.rsplit('/').next()).filter(|name| *name != "fig8.svg");
    let names: Vec<&str> = names.collect();
    let runs = ["drt-2-0.5-1.jsonl", "fit-3-0.5-1.jsonl", "ours-60-0.5-1.jsonl"];
    assert_eq!(names, [&["fig8.json"], &runs[..]].concat(), "{made:?}");
    let line = fs::read_to_string(folder.join("fig8/ours-60-0.5-1.jsonl")).unwrap();
    assert!(line.contains("\"method\":\"ours\"") && line.contains("\"q\":0.") && line.lines().count() == 1, "{line}");

    // Now a tool fails in the middle of a rule.
    fs::remove_dir_all(&folder).unwrap();
    fs::remove_file(tools.join("lf-mart")).unwrap();
    std::os::unix::fs::symlink("/bin/false", tools.join("lf-mart")).unwrap();
    let output = run().unwrap();
    assert!(!output.status.success());
    assert!(files(&folder).is_empty(), "{:?}", files(&folder));
}

const RUNS: &str = r#"
    {"name": "base", "set": {"n": 60, "seed": 1, "kernel": "drt"}, "s": 10, "e": 0.4, "m": 1e8}
    {"name": "base", "set": {"n": 60, "seed": 2, "kernel": "drt"}, "s": 30, "e": 0.6, "m": 1e8}
    {"name": "short", "set.n": 20, "set.kernel": "drt", "s": 5, "e": 1.0, "m": 5e7, "x": [0, 2, 4], "p": [1, 5]}
    {"name": "long", "set.n": 120, "set.kernel": "drt", "s": 40, "e": 0.5, "m": 1e8, "x": [0, 2, 4], "p": [3, null]}
    {"name": "exact", "set.n": 60, "set.kernel": "exact", "s": 200, "e": 0.1, "m": 1e8}
    {"name": "both", "set.n": 20, "set.kernel": "exact", "s": 70, "e": null, "m": 1e8}
    {"name": "other", "set.n": 20, "set.kernel": "exact", "s": 70, "e": 3, "m": 1e8}"#;

/// Exit code and all text of scripts/paper/curves in a folder with `RUNS`. None without Python, which is said.
fn curves(words: &[&str]) -> Option<(i32, String)> {
    if !has_programs(&["python3"]) {
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("runs.jsonl"), RUNS).unwrap();
    let output =
        Command::new(workspace().join("scripts/paper/curves")).args(words).current_dir(&folder).output().unwrap();
    Some((output.status.code().unwrap(), text(&output)))
}

#[test]
fn seeds_become_a_median_and_edges_become_centres() {
    let Some((code, said)) = curves(&["draw", "runs.jsonl", "-x", "set.n", "-y", "e", "--by", "set.kernel"]) else {
        return;
    };
    for wanted in [
        "1 of 7 runs left out, without e",
        "\"drt\": {",
        "\"x\": [20, 60, 120]",
        "\"median\": [1.0, 0.5, 0.5]",
        "\"high\": [1.0, 0.6, 0.5]",
        "\"runs\": [1, 2, 1]",
    ] {
        assert!(code == 0 && said.contains(wanted), "{wanted}: {said}");
    }
    let (_, said) = curves(&["draw", "runs.jsonl", "-x", "x", "-y", "p"]).unwrap();
    assert!(said.contains("\"x\": [1.0, 3.0]") && said.contains("\"median\": [2.0, 5.0]"), "{said}");
    let (_, said) = curves(&["line", "set.n=60", "note=a:b/c=d", "pvr=1,1,5"]).unwrap();
    assert_eq!(said.trim(), "{\"set.n\":60,\"note\":\"a:b/c=d\",\"pvr\":\"1,1,5\"}");
}

#[test]
fn the_trade_lists_the_front_and_one_factor_at_a_time() {
    let words = ["trade", "runs.jsonl", "--cost", "s:seconds", "--error", "e", "--memory", "m", "--base", "base"];
    let Some((code, said)) = curves(&words) else { return };
    let rows: Vec<&str> = said.lines().filter(|line| line.starts_with("| ")).collect();
    assert_eq!(code, 0, "{said}");
    let wanted = [
        "| setting | seconds | e | MB | differs from the base in |",
        "| --- | ---: | ---: | ---: | --- |",
        "| short | 5 | 1 | 50 | n 20 |",
        "| base | 20 | 0.5 | 100 | the base: n 60; kernel drt |",
        "| exact | 200 | 0.1 | 100 | kernel exact |",
        "| factor | value | seconds | e | memory |",
        "| --- | --- | ---: | ---: | ---: |",
        "| kernel | drt | 1 | 1 | 1 |",
        "| | exact | 10.00 | 0.20 | 1.00 |",
        "| n | 60 | 1 | 1 | 1 |",
        "| | 20 | 0.25 | 2.00 | 0.50 |",
        "| | 120 | 2.00 | 1.00 | 1.00 |",
    ];
    assert_eq!(rows, wanted, "{said}");
}

#[test]
fn curves_refuses_in_one_line() {
    for (words, wanted) in [
        (
            &["trade", "runs.jsonl", "--cost", "s", "--error", "q"][..],
            "no run has q; wanted one of their keys: e, m, name",
        ),
        (&["trade", "runs.jsonl", "--cost", "s", "--error", "e", "--memory", "m", "--base", "none"], "no setting none"),
        (&["draw", "runs.jsonl", "-x", "s", "-y", "p"], "s and p do not match; wanted a number at both"),
        (&["draw", "runs.jsonl", "-x", "s", "-y", "e", "--where", "k=2"], "no run with k=2; wanted one"),
        (&["line", "q=1", "q=2"], "the key q again in q=2; wanted every key once"),
        (&["line", "runs.jsonl"], "runs.jsonl: 7 JSON objects; wanted one"),
        (&["line", "missing.json"], "missing.json"),
    ] {
        let Some((code, said)) = curves(words) else { return };
        let refusal = said.lines().last().unwrap_or_default();
        assert!(code == 2 && refusal.starts_with("curves: ") && refusal.contains(wanted), "{words:?}: {said}");
    }
}
