//! scripts/pipeline.mk as a list of stages, and scripts/Snakefile, which runs them by that list.

use crate::weather::{campaign, copy, pipeline, said, undisturbed};
use lf_tests::scripts::{has_programs, text};
use lf_tests::tools::workspace;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Every line of the list: stage, what it makes, what it makes that from.
fn list(out: &Path, settings: &[&str]) -> Vec<Vec<String>> {
    let words: Vec<&str> = ["-s", "list"].into_iter().chain(settings.iter().copied()).collect();
    let listed = pipeline(campaign(), out, &words).output().unwrap();
    assert!(listed.status.success(), "{}", said(&listed));
    let text = String::from_utf8(listed.stdout).unwrap();
    text.lines().map(|line| line.split_whitespace().map(str::to_owned).collect()).collect()
}

#[test]
fn the_list_has_every_stage_that_make_runs() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    for settings in
        [&[][..], &["FIT=1", "FLOW=smooth", "WINDOW_MM="], &["BACKGROUND=", "PAIRS=0001a-0002a"], &["BACKGROUND=haze"]]
    {
        let listed = list(place.path(), settings);
        let words: Vec<&str> = ["-n", "-k", "flows"].into_iter().chain(settings.iter().copied()).collect();
        let planned = pipeline(campaign(), place.path(), &words).output().unwrap();
        let planned = String::from_utf8(planned.stdout).unwrap();
        // A line for every stage ends in the option that names its result, and the result.
        let is_stage = |line: &&str| line.starts_with("printf '%s\\n' ");
        let run = planned.lines().filter(is_stage).filter(|line| !line.contains("lf-calib lattice")).count();
        let others = |line: &&Vec<String>| !["calibrate", "windows", "mean"].contains(&line[0].as_str());
        assert_eq!(listed.iter().filter(others).count(), run, "{settings:?}\n{listed:?}\n{planned}");
        // Each stage needs what is there or made by another.
        for needed in listed.iter().flat_map(|line| &line[2..]) {
            let is_made = listed.iter().any(|line| line[1] == *needed);
            assert!(is_made || campaign().join(needed).exists(), "{settings:?}: {needed}\n{listed:?}");
        }
    }
}

/// A % in the background's name is the end of the frame's: each laser has a background of its own.
#[test]
fn each_laser_may_have_a_background() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let listed = list(place.path(), &["BACKGROUND=raw/0003%.tif", "PAIRS=0001a-0001b"]);
    for end in ["a", "b"] {
        let result = |stage: &&Vec<String>| stage[1].ends_with(&format!("-0001{end}.lfv"));
        let stages: Vec<_> = listed.iter().filter(result).collect();
        let has_own = |stage: &&&Vec<String>| stage.contains(&format!("raw/0003{end}.tif"));
        assert_eq!(stages.iter().filter(has_own).count(), stages.len(), "{listed:?}");
        assert!(!stages.is_empty(), "{listed:?}");
    }
}

/// The frames of REFINE are fitted with the camera as calibrated, and the refined camera is that of all others.
#[test]
fn refine_begins_with_the_evidence_of_its_frames() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let planned = pipeline(campaign(), place.path(), &["-n", "-k", "flows", "REFINE=0001a 0002a"]).output().unwrap();
    let planned = String::from_utf8(planned.stdout).unwrap();
    let line = |tool: &str, what: &str| {
        let is_it = |line: &&str| line.starts_with("printf") && line.contains(tool) && line.contains(what);
        planned.lines().find(is_it).unwrap_or_else(|| panic!("{tool} {what}\n{planned}"))
    };
    for name in ["0001a", "0002a"] {
        let fit = line("lf-fit", &format!("evidence-{name}.json"));
        assert!(fit.contains("camera-lattice.json") && fit.contains(&format!("evidence-support-{name}.lfv")), "{fit}");
    }
    let refine = line("lf-calib refine", "camera-refine.json");
    assert!(refine.contains("evidence-0001a.json") && refine.contains("evidence-0002a.json"), "{refine}");
}

/// The first frame that can be read corrects the camera, and all frames begin with that camera.
#[test]
fn the_first_frame_corrects_the_camera_of_all() {
    if !has_programs(&["make"]) {
        return;
    }
    let folder = copy();
    fs::write(folder.path().join("raw/0001a.tif"), "broken").unwrap();
    let camera = fs::read_to_string(campaign().join("taken/camera.json")).unwrap();
    let wrong = camera.replace("\"working_f_number\": 4.0", "\"working_f_number\": 3.9");
    fs::write(folder.path().join("nominal.json"), wrong).unwrap();
    let out = folder.path().join("out");
    let settings = ["FIT=1", "NOMINAL=nominal.json", "WHITE=", "BACKGROUND=", "PAIRS=0001a-0001b 0002a-0002b"];
    let ended = pipeline(folder.path(), &out, &settings).output().unwrap();
    assert_eq!(ended.status.code(), Some(2), "{}", said(&ended));
    let log = fs::read_to_string(out.join("log/camera.txt")).unwrap();
    assert!(
        log.lines().count() == 1 && log.contains("the f-number") && log.contains("begin with that camera"),
        "{log}"
    );
    for name in ["0001b", "0002a", "0002b"] {
        let table = fs::read_to_string(out.join(format!("particles-{name}.csv"))).unwrap();
        assert!(!table.contains("camera corrected"), "{name}: {}", &table[..200]);
    }
    let corrected = fs::read(out.join("camera-corrected.json")).unwrap();
    assert!(corrected != fs::read(folder.path().join("nominal.json")).unwrap());
    assert!(!out.join("field-0001a-0001b.exr").exists() && out.join("field-0002a-0002b.exr").exists());
}

/// Snakemake makes the bytes that make makes, leaves out pairs, and refuses settings that do not exist.
#[test]
fn snakemake_runs_the_same_stages() {
    if !has_programs(&["make", "snakemake"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    // The settings of make's run, in lower case.
    let set: Vec<String> = pipeline(campaign(), &out, &["THREADS=1", "FIT=0"])
        .get_args()
        .filter_map(|word| {
            let (name, value) = word.to_str().unwrap().split_once('=')?;
            Some(format!("{}={value}", name.to_lowercase()))
        })
        .collect();
    let snakemake = |more: &[&str]| {
        let mut command = Command::new("snakemake");
        command.arg("-s").arg(workspace().join("scripts/Snakefile")).args(["-j2", "--directory"]).arg(place.path());
        command.env("LF_HISTORY", "off").env("HOME", place.path()).env_remove("MAKEFLAGS");
        let frames = format!("frame={}/raw/{{name}}.tif", campaign().display());
        command.arg("--config").args(&set).arg(frames).args(more).output().unwrap()
    };
    let ended = snakemake(&["skip=0003,0004"]);
    assert!(ended.status.success(), "{}", text(&ended));
    for name in ["volume-0001a.lfv", "volume-0002b.lfv", "field-0001a-0001b.exr", "field-0002a-0002b.exr"] {
        assert!(fs::read(out.join(name)).unwrap() == undisturbed()[name], "{name}");
    }
    assert!(!out.join("field-0003a-0003b.exr").exists() && !out.join("support-0001a.lfv").exists());
    assert!(fs::read_to_string(out.join("mean.json")).unwrap().contains("\"fields\": 2,"));
    let refused = text(&snakemake(&["depht=-5,5"]));
    assert!(refused.contains("unknown settings depht"), "{refused}");
}
