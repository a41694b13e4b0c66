//! scripts/studies/bench: a record holds all that a comparison needs, a stage paired with itself gives the same output,
//! and unknown words are refused.

use lf_tests::scripts::{has_programs, text};
use lf_tests::tools::{path, workspace};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Runs scripts/studies/bench with the tools of this test and its files under `out`. Without Python: prints why and
/// returns None.
fn bench(out: &Path, words: &[&str]) -> Option<Output> {
    if !has_programs(&["python3"]) {
        return None;
    }
    let mut command = Command::new("python3");
    command.arg(workspace().join("scripts/studies/bench")).args(words).current_dir(out);
    command.env("BIN", path("lf-synth").parent().unwrap()).env("OUT", out).env("COMMIT", "one");
    Some(command.output().unwrap())
}

/// The lines of the record.
fn record(out: &Path) -> Vec<Value> {
    let text = fs::read_to_string(out.join("record.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_measurement_goes_on_record_and_a_tool_is_the_same_as_itself() {
    let place = tempfile::tempdir().unwrap();
    let itself = format!("'{}'", path("lf-synth").display());
    for words in [&["synth", "small", "--runs", "1"][..], &["lf-synth", "small", "--runs", "1", "--against", &itself]] {
        let Some(output) = bench(place.path(), words) else { return };
        let said = text(&output);
        assert!(output.status.success(), "{said}");
        assert!(said.contains("rays/s"), "{said}");
        let is_pair = words.contains(&"--against");
        assert_eq!(said.contains("outputs are the same, byte for byte"), is_pair, "{said}");
        assert_eq!(said.contains("1 pair, too few to judge"), is_pair, "{said}");
    }

    let lines = record(place.path());
    assert_eq!(lines.len(), 2);
    for line in &lines {
        for key in ["date", "commit", "tool", "cpu", "stage", "size", "camera", "inputs", "unit"] {
            assert!(line[key].as_str().is_some_and(|text| !text.is_empty()), "{key}: {line}");
        }
        for key in ["cores", "threads", "runs", "seconds", "seconds_min", "seconds_max", "work", "per_second"] {
            assert!(line[key].as_f64().is_some_and(|number| number > 0.0), "{key}: {line}");
        }
        assert_eq!(line["stage"], "lf-synth");
        assert_eq!(line["commit"], "one");
        assert_eq!(line["counts"]["rays"], line["work"]);
        assert!(line.get("peak_bytes").is_some() && line.get("rustc").is_some() && line.get("others").is_some());
        // A record is published, so it names no path of the machine.
        assert!(!line.to_string().contains('/'), "{line}");
    }
    assert_eq!(lines[0]["inputs"], lines[1]["inputs"]);
    assert!(lines[0].get("against").is_none());
    assert_eq!(lines[1]["against"]["identical"], true);
    assert!(lines[1]["against"]["ratio"].as_f64().is_some_and(|ratio| ratio > 0.0), "{}", lines[1]);

    // A second record with a later commit and date: the two are compared in the order of their dates.
    let line = fs::read_to_string(place.path().join("record.jsonl")).unwrap().lines().next().unwrap().to_owned();
    let seconds = |times: f64| format!("\"seconds\":{}", times * lines[0]["seconds"].as_f64().unwrap());
    let later = line.replace("\"one\"", "\"two\"").replacen("\"date\":\"20", "\"date\":\"21", 1);
    let later = later.replace(&seconds(1.0), &seconds(2.0));
    fs::write(place.path().join("record.jsonl"), format!("{later}\n{line}\n")).unwrap();
    let said = text(&bench(place.path(), &["--history", "synth"]).unwrap());
    assert!(said.contains("  one ") && said.contains("  two "), "{said}");
    assert!(said.contains("time x 2.00, processor time x 1.00, memory x 1.00; the same tool"), "{said}");
}

#[test]
fn unknown_words_are_refused_in_one_line() {
    let place = tempfile::tempdir().unwrap();
    for (words, wanted) in [
        (&["solve"][..], "synth, calib, prune, mart, fit, xcorr, validate"),
        (&["mart", "huge"], "small, medium, large"),
        (&["mart", "bent"], "plain, turned, hexagonal, distorted, gap, tilt, water"),
        (&["--fast"], "--against"),
        (&["--runs", "many"], "whole number"),
        (&["--runs"], "value"),
        (&["--against", "lf-mart"], "a stage as well"),
        (&["synth", "small", "--against", "false"], "fails in the place of lf-synth"),
    ] {
        let Some(output) = bench(place.path(), words) else { return };
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().last().unwrap_or_default();
        assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
        assert!(last.starts_with("bench: ") && last.contains(wanted), "{words:?}: {said}");
    }
    assert!(!place.path().join("record.jsonl").exists());
    let output = bench(place.path(), &["--help"]).unwrap();
    assert!(output.status.success() && text(&output).contains("--against"));
}
