//! The command lines of `line` and `curves`.

use crate::workbench::workbench;
use serde_json::json;

/// Two series of three x and three seeds, one run without a score.
fn runs() -> String {
    let mut lines = String::new();
    for (kernel, scale) in [("exact", 1.0), ("drt", 2.0)] {
        for iterations in [100, 20, 5] {
            for seed in 1..=3 {
                let error = scale * f64::from(seed) / f64::from(iterations);
                let run = json!({"set": {"kernel": kernel, "iterations": iterations, "seed": seed}, "rms_w_px": error,
                    "pdf": {"edges": [0, 1, 2], "w": [error, 1.0]}});
                lines += &format!("{run}\n");
            }
        }
    }
    lines + "{\"set\": {\"kernel\": \"drt\", \"iterations\": 50}, \"rms_w_px\": null}\n"
}

#[test]
fn a_line_of_settings_and_scores() {
    let bench = workbench();
    bench.write(
        "stats.json",
        "{\"seconds\": 2.5, \"counts\": {\"kept\": 3}, \"steps\": [{\"a\": 1}], \"list\": [1, 2]}",
    );
    bench.write("score.json", "{\n  \"rms_w_px\": 0.25\n}\n");
    let output = bench.run(&["line", "set.iterations=60", "name=base", "lit=true", "mart:stats.json", "./score.json"]);
    output.silent_json();
    let wanted = "{\"set.iterations\":60,\"name\":\"base\",\"lit\":true,\"mart.seconds\":2.5,\"mart.counts.kept\":3,\
                  \"mart.list\":[1,2],\"rms_w_px\":0.25}\n";
    assert_eq!(String::from_utf8_lossy(&output.stdout), wanted);
    let piped = bench.feed(
        &["line", "set.iterations=60", "name=base", "lit=true", "mart:-", "score.json", "-o", "line.json"],
        bench.text("stats.json"),
    );
    assert!(piped.status.success() && piped.stdout.is_empty());
    assert_eq!(bench.text("line.json"), wanted);
}

#[test]
fn a_line_has_every_key_once() {
    let bench = workbench();
    bench.write("one.json", "{\"seconds\": 2.5}");
    bench.write("list.json", "[1]");
    bench.write("two.json", "{}\n{}");
    for (words, wanted) in [
        (&["one.json", "seconds=3"][..], ["one.json", "seconds=3"]),
        (&["a=1", "a=1"], ["the key a", "a=1"]),
        (&["one.json", "./one.json"], ["one.json and from ./one.json", "NAME:"]),
        (&["list.json"], ["list.json", "not an object"]),
        (&["two.json"], ["two.json", "not JSON"]),
        (&["none.json"], ["none.json", "wanted"]),
        (&["=1"], ["'=1'", "KEY=VALUE"]),
        (&["-", "x:-"], ["standard input", "more than once"]),
        (&["one.json", "-o", "one.json"], ["one.json", "also an input"]),
        (&[], ["required", "[NAME:]FILE"]),
    ] {
        let text = bench.run(&[&["line"], words].concat()).refusal();
        assert!(wanted.iter().all(|word| text.contains(word)), "{text}");
    }
}

#[test]
fn curves_are_medians_over_seeds() {
    let bench = workbench();
    bench.write("runs.jsonl", runs());
    let words = ["curves", "runs.jsonl", "-x", "set.iterations", "-y", "rms_w_px", "--by", "set.kernel", "--quiet"];
    let found = bench.run(&words).silent_json();
    assert_eq!(
        (&found["x"], &found["y"], &found["runs"]),
        (&json!("set.iterations"), &json!(["rms_w_px"]), &json!(19))
    );
    assert_eq!(found["series"].as_object().unwrap().keys().collect::<Vec<_>>(), ["drt", "exact"]);
    let wanted = json!({"y": "rms_w_px", "x": [5.0, 20.0, 100.0], "median": [0.4, 0.1, 0.02], "low": [0.2, 0.05, 0.01],
        "high": [0.6, 0.15, 0.03], "runs": [3, 3, 3]});
    assert_eq!(found["series"]["exact"], wanted);
    let loud = bench.run(&words[..8]);
    assert_eq!(loud.status.code(), Some(0));
    let warning = loud.stderr;
    assert_eq!(warning, "lf-validate: warning: 1 of 19 runs left out, without rms_w_px\n");
    let mut piped = words;
    piped[1] = "-";
    assert_eq!(bench.feed(&piped, runs()).silent_json(), found);
    let chosen = [&words[..], &["--where", "set.kernel=drt", "--where", "set.seed=2"]].concat();
    assert_eq!(bench.run(&chosen).silent_json()["series"]["drt"]["runs"], json!([1, 1, 1]));
}

#[test]
fn lists_panels_and_several_values() {
    let bench = workbench();
    bench.write("runs.jsonl", runs());
    let words = [
        "curves",
        "runs.jsonl",
        "-x",
        "pdf.edges",
        "-y",
        "pdf.w",
        "--by",
        "set.kernel",
        "--panel",
        "set.iterations",
        "--quiet",
        "--plot",
        "pdf.svg",
        "--title",
        "PDF of w",
        "--x-name",
        "displacement, px",
        "--y-range",
        "-1,3",
        "--reference",
        "all alike=1",
        "--reference-x",
        "true mean=0.5",
    ];
    let found = bench.run(&words).silent_json();
    let series = &found["series"]["iterations = 20: drt"];
    assert_eq!((&series["x"], &series["median"]), (&json!([0.5, 1.5]), &json!([0.2, 1.0])));
    assert_eq!(found["series"].as_object().unwrap().len(), 6);
    let svg = bench.text("pdf.svg");
    for text in [
        "PDF of w",
        "displacement, px",
        "pdf.w",
        "iterations = 5",
        "iterations = 100",
        "all alike",
        "true mean",
        "median of up to 3 runs",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    bench.run(&words);
    assert_eq!(bench.text("pdf.svg"), svg);
    let several = [
        "curves",
        "runs.jsonl",
        "-x",
        "set.iterations",
        "-y",
        "rms_w_px,set.seed",
        "--quiet",
        "--log-x",
        "--log-y",
        "--plot",
        "several.svg",
    ];
    assert_eq!(
        bench.run(&several).silent_json()["series"].as_object().unwrap().keys().collect::<Vec<_>>(),
        ["rms_w_px", "set.seed"]
    );
}

#[test]
fn runs_without_a_curve_are_refused() {
    let bench = workbench();
    bench.write("runs.jsonl", runs());
    bench.write("empty.jsonl", "");
    bench.write("bad.jsonl", "{\"a\": 1}\n{\"a\": \n");
    for (words, wanted) in [
        (&["runs.jsonl", "-x", "iterations", "-y", "rms_w_px"][..], ["runs.jsonl", "set.iterations, set.kernel"]),
        (&["empty.jsonl", "-x", "a", "-y", "b"], ["empty.jsonl", "no run"]),
        (&["bad.jsonl", "-x", "a", "-y", "b"], ["bad.jsonl", "object 2"]),
        (&["runs.jsonl", "-x", "set.seed", "-y", "pdf.w"], ["runs.jsonl, object 1", "lists of one length"]),
        (&["runs.jsonl", "-x", "a", "-y", "b", "--where", "set.kernel=sphere"], ["19 runs", "set.kernel=sphere"]),
        (&["runs.jsonl", "-x", "set.seed", "-y", "rms_w_px", "--plot", "runs.jsonl"], ["runs.jsonl", "also an input"]),
        (&["runs.jsonl", "-x", "set.seed", "-y", "rms_w_px", "--plot", "-"], ["--plot", "standard output"]),
        (&["runs.jsonl", "-x", "set.seed", "-y", "rms_w_px", "--log-x"], ["--plot", "required"]),
        (
            &["runs.jsonl", "-x", "set.seed", "-y", "rms_w_px", "--plot", "a.svg", "--log-y", "--y-range", "0,1"],
            ["a.svg", "above 0"],
        ),
        (
            &["runs.jsonl", "-x", "set.seed", "-y", "rms_w_px", "--plot", "a.svg", "--x-range", "3"],
            ["--x-range", "LOW,HIGH"],
        ),
        (&["runs.jsonl", "-y", "rms_w_px"], ["-x", "required"]),
        (&["runs.jsonl", "-x", "set.seed", "-y", "rms_w_px,rms_w_px"], ["-y", "twice"]),
        (&["runs.jsonl", "-x", "set.seed", "-y", "rms_w_px", "--by", "a,a"], ["--by", "twice"]),
    ] {
        let text = bench.run(&[&["curves"], words].concat()).refusal();
        assert!(wanted.iter().all(|word| text.contains(word)), "{text}");
    }
    assert!(!bench.path("a.svg").exists());
}
