//! The command line of `trade`.

use crate::workbench::workbench;
use serde_json::json;

const RUNS: &str = r#"{"name": "base", "set.iterations": 60, "set.kernel": "drt", "set.seed": 1, "seconds": 10, "rms_w_px": 0.4, "peak_bytes": 100}
{"name": "base", "set.iterations": 60, "set.kernel": "drt", "set.seed": 2, "seconds": 30, "rms_w_px": 0.6, "peak_bytes": 100}
{"name": "short", "set.iterations": 20, "set.kernel": "drt", "set.seed": 1, "seconds": 5, "rms_w_px": 1.0, "peak_bytes": 100}
{"name": "long", "set.iterations": 120, "set.kernel": "drt", "set.seed": 1, "seconds": 40, "rms_w_px": 0.45, "peak_bytes": 100}
{"name": "exact", "set.iterations": 60, "set.kernel": "exact", "set.seed": 1, "seconds": 200, "rms_w_px": 0.1, "peak_bytes": 400}
{"name": "worse", "set.iterations": 20, "set.kernel": "exact", "set.seed": 1, "seconds": 70, "rms_w_px": 3, "peak_bytes": 400}
{"name": "failed", "seconds": 1}
"#;

#[test]
fn the_front_and_the_settings_it_dominates() {
    let bench = workbench();
    bench.write("runs.jsonl", RUNS);
    let found = bench.run(&["trade", "runs.jsonl", "--quiet"]).silent_json();
    assert_eq!(found["front"].as_object().unwrap().keys().collect::<Vec<_>>(), ["short", "base", "long", "exact"]);
    assert_eq!(found["front"]["base"], json!({"cost": 20.0, "error": 0.5, "memory": 100.0}));
    assert_eq!(found["settings"]["worse"]["dominated_by"], "long");
    assert_eq!(found["settings"]["worse"]["set"], json!({"iterations": 20, "kernel": "exact"}));
    assert_eq!(found["settings"]["base"]["cost_range"], json!([10.0, 30.0]));
    assert!(found.get("factors").is_none());
    let loud = bench.run(&["trade", "runs.jsonl"]);
    let warning = loud.stderr;
    assert!(loud.status.success() && warning.contains("1 of 7 runs left out, without rms_w_px"), "{warning}");
    // The order of the runs does not matter.
    let backwards: Vec<&str> = RUNS.lines().rev().collect();
    assert_eq!(
        bench.feed(&["trade", "-", "--quiet"], backwards.join("\n")).stdout,
        bench.run(&["trade", "runs.jsonl", "--quiet"]).stdout
    );
}

#[test]
fn factors_relative_to_the_base_and_a_picture() {
    let bench = workbench();
    bench.write("runs.jsonl", RUNS);
    let words = [
        "trade",
        "runs.jsonl",
        "--quiet",
        "--base",
        "base",
        "--plot",
        "trade.svg",
        "--title",
        "What precision costs",
        "--cost-name",
        "run time, s",
        "--max-error",
        "0.5",
    ];
    let found = bench.run(&words).silent_json();
    assert_eq!(found["factors"].as_object().unwrap().keys().collect::<Vec<_>>(), ["iterations", "kernel"]);
    let short = json!({"value": 20, "cost_ratio": 0.25, "error_ratio": 2.0, "memory_ratio": 1.0});
    assert_eq!(found["factors"]["iterations"]["settings"]["short"], short);
    assert_eq!(found["factors"]["kernel"]["base"], "drt");
    assert_eq!(found["ungrouped"], json!(["worse"]));
    let svg = bench.text("trade.svg");
    for text in [
        "What precision costs",
        "run time, s",
        "rms_w_px",
        "Pareto front",
        "iterations",
        "kernel",
        "short",
        "120",
        "limit",
        "cost / cost of base",
    ] {
        assert!(svg.contains(text), "{text}");
    }
}

#[test]
fn limits_decide_the_exit_code() {
    let bench = workbench();
    bench.write("runs.jsonl", RUNS);
    for (limits, code) in [
        (&["--max-error", "0.5", "--max-cost", "20"][..], 0),
        (&["--max-error", "0.5", "--max-cost", "19.9"], 1),
        (&["--max-error", "0.09"], 1),
        (&["--max-cost", "5"], 0),
    ] {
        let output = bench.run(&[&["trade", "runs.jsonl", "--quiet"], limits].concat());
        assert_eq!(output.status.code(), Some(code), "{limits:?}");
        assert!(!output.stdout.is_empty());
    }
}

#[test]
fn runs_that_cannot_be_judged_are_refused() {
    let bench = workbench();
    bench.write("runs.jsonl", RUNS);
    bench.write(
        "mixed.jsonl",
        RUNS.replace("\"set.iterations\": 20", "\"set.iterations\": 21").replace("short", "base"),
    );
    for (words, wanted) in [
        (&["runs.jsonl", "--base", "basis"][..], ["no setting is named basis", "short, base"]),
        (&["runs.jsonl", "--error", "rms"], ["wanted numbers at rms", "rms_w_px"]),
        (&["mixed.jsonl"], ["set.iterations is 60 in mixed.jsonl, object 1", "both named base"]),
        (&["runs.jsonl", "--max-cost", "NaN"], ["--max-cost", "finite"]),
        (&["runs.jsonl", "--where", "kernel"], ["--where", "KEY=VALUE"]),
        (&["runs.jsonl", "--title", "alone"], ["--plot", "required"]),
    ] {
        let text = bench.run(&[&["trade"], words].concat()).refusal();
        assert!(wanted.iter().all(|word| text.contains(word)), "{text}");
    }
}

#[test]
fn help_defines_what_is_printed() {
    let bench = workbench();
    for (command, words) in [
        ("line", &["NAME:FILE", "--output"][..]),
        ("curves", &["--by", "--panel", "--plot", "median", "--reference-x"]),
        ("trade", &["--base", "--plot", "dominated_by", "--max-error", "[default: rms_w_px]"]),
    ] {
        let help = bench.run(&[command, "--help"]);
        let text = help.text();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    }
}
