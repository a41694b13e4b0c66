//! Black-box tests of lf-mart on a small scene of lf-synth, whose true voxels are the support.

use lf_core::Volume;
use lf_tests::Workbench;
use serde_json::Value;

const CALL: &str = "scene/truth-0000.lfv -i scene/frame-0000.exr -c scene/camera.json";

/// A small scene by rays.
fn bench(keys: &[&str]) -> Workbench {
    let bench = Workbench::new(env!("CARGO_BIN_EXE_lf-mart"));
    let small = [
        "camera.sensor.width=210",
        "camera.sensor.height=210",
        "volume.x_mm=[-0.3,0.3]",
        "volume.y_mm=[-0.3,0.3]",
        "particles.rays=20000",
        "truth.pixels_per_voxel=[2,2,20]",
        "frames=1",
    ];
    let keys: Vec<&str> = small.iter().chain(keys).copied().collect();
    bench.scene("core", &keys);
    std::ops::Deref::deref(&bench).run("lf-synth frames scene.json -o scene");
    bench
}

/// The lines of a log of sweeps.
fn sweeps(bench: &Workbench, name: &str) -> Vec<Value> {
    bench.text(name).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The voxels of the truth explain the frame on every lattice and behind every stop. The bytes do not depend on the
/// number of threads.
#[test]
fn the_true_voxels_explain_the_frame() {
    for keys in [
        &[][..],
        &["camera.main_lens.aperture=\"circle\""],
        &["camera.microlenses.layout=\"hexagonal\"", "camera.microlenses.rotation_rad=0.003"],
    ] {
        let bench = bench(keys);
        bench.done(&format!("{CALL} -o one.lfv --threads 1 --log log.jsonl"));
        bench.done(&format!("{CALL} -o three.lfv --threads 3"));
        assert!(bench.bytes("one.lfv") == bench.bytes("three.lfv"), "{keys:?}");
        let log = sweeps(&bench, "log.jsonl");
        let misfit = log.last().unwrap()["misfit"].as_f64().unwrap();
        assert!(log.len() == 20 && misfit < 0.1, "{keys:?}: {misfit} after {} sweeps", log.len());
        let [truth, found] = ["scene/truth-0000.lfv", "one.lfv"].map(|name| Volume::open(&bench.path(name)).unwrap());
        let light = |volume: &Volume| volume.column("intensity").unwrap().iter().map(|e| f64::from(*e)).sum::<f64>();
        assert!((light(&found) / light(&truth) - 1.0).abs() < 0.1, "{keys:?}: {} {}", light(&found), light(&truth));
    }
}

/// A bright reflection under the mask changes nothing.
#[test]
fn a_masked_reflection_changes_nothing() {
    let bench = bench(&[]);
    bench.reflection("scene/frame-0000.exr");
    for (frame, volume) in [("scene/frame-0000.exr", "one.lfv"), ("bright.exr", "two.lfv")] {
        let words = format!("scene/truth-0000.lfv -i {frame} -c scene/camera.json --mask mask.exr -o {volume}");
        assert_eq!(bench.done(&words).stderr, "");
    }
    assert!(bench.bytes("one.lfv") == bench.bytes("two.lfv"));
}

/// A preset sets the number of sweeps, a typed number wins, and a misfit that is reached ends them.
#[test]
fn sweeps_are_as_many_as_asked_for() {
    let bench = bench(&[]);
    for (options, wanted) in [("--preset fast", 10), ("--preset fast --iterations 3", 3), ("--method mart", 30)] {
        bench.done(&format!("{CALL} -o volume.lfv --log log.jsonl {options}"));
        assert_eq!(sweeps(&bench, "log.jsonl").len(), wanted, "{options}");
    }
    bench.done(&format!("{CALL} -o volume.lfv --log log.jsonl --until 0.3"));
    let misfits: Vec<f64> = sweeps(&bench, "log.jsonl").iter().map(|sweep| sweep["misfit"].as_f64().unwrap()).collect();
    let (last, before) = misfits.split_last().unwrap();
    assert!(*last <= 0.3 && before.iter().all(|misfit| *misfit > 0.3), "{misfits:?}");
}

#[test]
fn memory_is_estimated_and_options_that_clash_are_refused() {
    let bench = bench(&[]);
    let estimate: Value = serde_json::from_slice(&bench.done(&format!("{CALL} --estimate -q")).stdout).unwrap();
    let keys: Vec<&String> = estimate.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["memory_bytes", "voxels"], "{estimate}");
    for (options, named) in [
        ("--max-memory 0.001", "wanted 0.001 GB at most, as --max-memory allows"),
        ("--weights sphere --basis blob", "--basis"),
        ("--method smart --preset fast", "--preset: fast with another --method"),
        ("--until soon", "wanted stall, noise, never, or a misfit in 0 to 1"),
    ] {
        let refused = bench.run(&format!("{CALL} -o refused.lfv {options}")).refusal();
        assert!(refused.contains(named), "{options}: {refused}");
        assert!(!bench.path("refused.lfv").exists(), "{options}");
    }
}
