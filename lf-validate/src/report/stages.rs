//! Time and memory of every stage.

use super::html::Section;
use super::source::Source;
use serde_json::Value;
use std::collections::BTreeMap;

/// Runs up to this number are listed one by one.
const MOST_RUNS: usize = 60;

/// One `--stats` file.
struct StageRun {
    stage: String,
    name: String,
    seconds: f64,
    peak_bytes: Option<f64>,
    threads: u64,
    slowest: String,
}

/// The values in `--stats` files, each with its name; null for one that is not JSON.
pub(super) fn read(source: &dyn Source, stats: &[String]) -> Vec<(String, Value)> {
    let one = |file: &String| serde_json::from_str(&source.text(file).ok()?).ok();
    stats.iter().map(|file| (file.clone(), one(file).unwrap_or_default())).collect()
}

/// The section, seconds of all stages, and their largest memory in bytes. None without stats.
pub(super) fn section(stats: &[(String, Value)], notes: &mut Vec<String>) -> Option<(Section, f64, f64)> {
    let mut runs = Vec::new();
    for (file, value) in stats {
        match stage_run(file, value) {
            Some(run) => runs.push(run),
            None => notes.push(format!("{file} is not what --stats writes; it is left out")),
        }
    }
    if runs.is_empty() {
        return None;
    }
    let mut section = Section::new("stages", "Time and memory");
    let mut by_stage = BTreeMap::<&str, Vec<&StageRun>>::new();
    runs.iter().for_each(|run| by_stage.entry(&run.stage).or_default().push(run));
    let megabytes = |bytes: Option<f64>| bytes.map_or("-".into(), |bytes| format!("{:.0}", 1e-6 * bytes));
    let peak = |runs: &[&StageRun]| runs.iter().filter_map(|run| run.peak_bytes).reduce(f64::max);
    let rows: Vec<Vec<String>> = by_stage
        .iter()
        .map(|(stage, runs)| {
            let total: f64 = runs.iter().map(|run| run.seconds).sum();
            let longest = runs.iter().map(|run| run.seconds).fold(0.0, f64::max);
            let count = runs.len().to_string();
            vec![(*stage).to_owned(), count, format!("{total:.1}"), format!("{longest:.1}"), megabytes(peak(runs))]
        })
        .collect();
    section.table(&["stage", "runs", "seconds", "longest", "peak MB"], &rows, 1);
    let lines = runs.iter().take(MOST_RUNS).map(|run| {
        let threads = if run.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", run.threads) };
        let memory = megabytes(run.peak_bytes);
        format!("{}: {:.2} s, {memory} MB, {threads}; {}", run.name, run.seconds, run.slowest)
    });
    section.details("Each run, with its longest phases", &lines.collect::<Vec<_>>());
    if runs.len() > MOST_RUNS {
        section.text(&format!("The list has the first {MOST_RUNS} of {} runs.", runs.len()));
    }
    let seconds = runs.iter().map(|run| run.seconds).sum();
    Some((section, seconds, peak(&runs.iter().collect::<Vec<_>>()).unwrap_or(0.0)))
}

fn stage_run(file: &str, value: &Value) -> Option<StageRun> {
    let name = file.trim_end_matches(".stats.json").to_owned();
    let mut phases: Vec<(&String, f64)> =
        value["phases"].as_object()?.iter().filter_map(|(phase, seconds)| Some((phase, seconds.as_f64()?))).collect();
    phases.sort_by(|one, other| other.1.total_cmp(&one.1));
    let slowest = phases.iter().take(3).map(|(phase, seconds)| format!("{phase} {seconds:.2} s"));
    Some(StageRun {
        stage: value["tool"].as_str()?.to_owned(),
        name,
        seconds: value["seconds"].as_f64()?,
        peak_bytes: value["peak_bytes"].as_f64(),
        threads: value["threads"].as_u64().unwrap_or(0),
        slowest: slowest.collect::<Vec<_>>().join(", "),
    })
}
