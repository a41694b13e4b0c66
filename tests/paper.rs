//! scripts/paper/paper.mk: every size is sound, a figure is made, and a rule that fails leaves nothing.

use lf_tests::scripts::{has_programs, link_tools, text};
use lf_tests::tools::workspace;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// A run of make. None if make or bash is missing, which is said.
fn make(words: &[&str]) -> Option<Output> {
    if !has_programs(&["make", "bash", "awk"]) {
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
    let names: Vec<&str> = made.iter().filter_map(|file| file.rsplit('/').next()).collect();
    let runs = ["drt-2-0.5-1.jsonl", "fit-3-0.5-1.jsonl", "ours-60-0.5-1.jsonl"];
    assert_eq!(names, [&["fig8.json", "fig8.svg"], &runs[..]].concat(), "{made:?}");
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
