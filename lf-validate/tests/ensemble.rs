//! `ensemble` beyond the mean: convergence, and outputs that are refused.

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
fn statistics_of_a_swinging_wave_settle() {
    let (_folder, paths) = fields();
    let score: Value =
        serde_json::from_slice(&Call::new("lf-validate").word("ensemble").words(&paths).run().done().stdout).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let steps: Vec<u64> =
        score["convergence"].as_array().unwrap().iter().map(|s| s["fields"].as_u64().unwrap()).collect();
    assert_eq!(steps, [2, 4, 8]);
    // After whole cycles the mean is that of all.
    assert!(
        number(&score["convergence"][1]["change_mm"][0]) < 1e-7
            && number(&score["convergence"][0]["change_mm"][0]) > 1e-3
    );
    assert!(number(&score["fields_for_1_percent"][0]) >= 1.0);
}

#[test]
fn two_outputs_of_one_name_are_refused() {
    let (folder, paths) = fields();
    let call = Call::new("lf-validate").word("ensemble").word(&paths[0]).words(["-o", "a.svg", "--plot", "./a.svg"]);
    call.within(folder.path()).run().refused("a.svg: is asked for twice; wanted another name for each");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 12);
}
