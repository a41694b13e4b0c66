//! `ensemble` beyond the mean: convergence, phases, lines and modes.

use lf_core::field::MEASURED;
use lf_core::{Field, VectorGrid};
use lf_tests::Call;
use serde_json::Value;
use std::path::PathBuf;
use tempfile::TempDir;

/// Twelve fields of a wave along x that swings in four phases, and grows weaker along z.
fn fields() -> (TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let layout = VectorGrid { shape: [16, 5, 4], spacing_mm: [0.1, 0.2, 0.3], ..VectorGrid::default() };
    let mut paths = Vec::new();
    for n in 0..12u32 {
        let mut field = Field::empty(layout.clone());
        let swing = [0.0, 1.0, 0.0, -1.0][n as usize % 4];
        for i in 0..field.len() {
            let turn = std::f32::consts::TAU * (i % 16) as f32 / 8.0;
            field.u[i] = 0.5 + 0.02 * swing * turn.cos();
            field.w[i] = 0.1;
        }
        field.flag.fill(MEASURED);
        paths.push(folder.path().join(format!("field-{n:02}.exr")));
        field.save(&paths[n as usize]).unwrap();
    }
    (folder, paths)
}

#[test]
fn all_statistics_of_a_swinging_wave() {
    let (folder, paths) = fields();
    let parts = folder.path().join("parts");
    let words = ["--phases", "4", "--along", "x", "--modes", "2", "--parts"];
    let call = Call::new("lf-validate").word("ensemble").words(&paths).words(words).word(&parts);
    let told: Value = serde_json::from_slice(&call.run().done().stdout).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let steps: Vec<u64> =
        told["convergence"].as_array().unwrap().iter().map(|s| s["fields"].as_u64().unwrap()).collect();
    assert_eq!(steps, [2, 4, 8]);
    // After whole cycles the mean is that of all.
    assert!(
        number(&told["convergence"][1]["change_mm"][0]) < 1e-7
            && number(&told["convergence"][0]["change_mm"][0]) > 1e-3
    );
    assert!(number(&told["fields_for_1_percent"][0]) >= 1.0);
    // Half of 0.02^2, in half of the phases.
    let wanted = 0.02 * 0.25f64.sqrt();
    assert!((number(&told["phases"]["coherent_mm"][0]) / wanted - 1.0).abs() < 1e-3, "{told}");
    assert!(number(&told["phases"]["incoherent_mm"][0]) < 1e-6);
    assert!((number(&told["modes"]["share"][0]) - 1.0).abs() < 1e-5, "{}", told["modes"]);
    assert!((number(&told["modes"]["rms_mm"][0]) / wanted - 1.0).abs() < 1e-3);
    assert!((number(&told["lines"]["correlation"][0][4]) + 1.0).abs() < 1e-4, "{}", told["lines"]);
    let spectrum = told["lines"]["spectrum_mm3"][0].as_array().unwrap();
    let top = (0..8).max_by(|a, b| number(&spectrum[*a]).total_cmp(&number(&spectrum[*b]))).unwrap();
    assert!((number(&told["lines"]["wavenumber_1_mm"][top]) - 1.25).abs() < 1e-9);
    let crest = Field::open(&parts.join("phase-01.exr")).unwrap();
    assert!((crest.u[0] - 0.52).abs() < 1e-6);
    let mode = Field::open(&parts.join("mode-00.exr")).unwrap();
    assert!((f64::from(mode.u[0]).abs() / (wanted * 2f64.sqrt()) - 1.0).abs() < 1e-3);
}

#[test]
fn options_that_cannot_be_kept_are_refused() {
    let (folder, paths) = fields();
    let call = |words: &[&str]| Call::new("lf-validate").word("ensemble").word(&paths[0]).words(words);
    call(&["--along", "x"]).run().refused("--along");
    call(&["--parts", "parts"]).within(folder.path()).run().refused("--parts");
    call(&["-", "--modes", "2"]).run().refused("--modes");
    call(&["--phases", "1"]).run().refused("--phases");
    call(&["--phases", "2"]).run().refused("--phases: 2 phases of 1 fields; wanted a field or more for each phase");
    call(&["--phases", "2", "--parts", "field-00.exr"]).within(folder.path()).run().refused("wanted a folder");
}

#[test]
fn parts_replace_no_input_and_no_other_output() {
    let (folder, paths) = fields();
    for (n, path) in paths.iter().enumerate() {
        std::fs::rename(path, folder.path().join(format!("phase-{n:02}.exr"))).unwrap();
    }
    let before = std::fs::read(folder.path().join("phase-01.exr")).unwrap();
    let refused = |words: &[&str], wanted: &str| {
        let inputs = ["phase-00.exr", "phase-01.exr", "phase-02.exr"];
        Call::new("lf-validate")
            .word("ensemble")
            .words(inputs)
            .words(words)
            .within(folder.path())
            .run()
            .refused(wanted);
    };
    refused(&["--phases", "2", "--parts", "."], "phase-00.exr: is also an input; wanted another file to write to");
    let twice = "mode-00.exr: is asked for twice; wanted another name for each";
    refused(&["--modes", "1", "--parts", ".", "-o", "mode-00.exr"], twice);
    refused(&["-o", "a.svg", "--plot", "./a.svg"], "a.svg: is asked for twice");
    assert_eq!(std::fs::read(folder.path().join("phase-01.exr")).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 12);
}
