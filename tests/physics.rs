//! Whole pipelines against what is known: light, reconstruction, displacement. The scenes are rendered by rays; the
//! tools that judge them know nothing of those.

use lf_tests::Call;
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// Renders a ready scene with keys set into a new folder.
fn rendered(name: &str, keys: &[&str]) -> TempDir {
    let folder = TempDir::new().unwrap();
    let set = keys.iter().flat_map(|key| ["--set", key]);
    let scene = Call::new("lf-synth").words(["scene", name]).words(set).run().done();
    std::fs::write(folder.path().join("scene.json"), scene.stdout).unwrap();
    Call::new("lf-synth").within(folder.path()).words(["frames", "scene.json", "-o", "."]).run().done();
    folder
}

fn run(folder: &Path, line: &str) -> Vec<u8> {
    let (tool, words) = line.split_once(' ').unwrap();
    Call::new(tool).within(folder).words(words.split_whitespace()).run().done().stdout
}

fn scores(folder: &Path, line: &str) -> Value {
    serde_json::from_slice(&run(folder, line)).unwrap()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// A ninth of the test volume of 20 x 20 lenslets, to be quick.
const SMALL: [&str; 3] = ["volume.x_mm=[-0.26,0.26]", "volume.y_mm=[-0.26,0.26]", "particles.rays=50000"];

/// Q on the grid of the truth, over the depths `z`.
fn reconstructed(folder: &Path, z: &str, options: &str) -> f64 {
    let bounds = format!("--depth {z} --bounds -0.26,0.26,-0.26,0.26");
    run(folder, &format!("lf-prune frame-0000.exr -c camera.json {bounds} -o support.lfv"));
    run(folder, &format!("lf-mart support.lfv -i frame-0000.exr -c camera.json {options} -o volume.lfv"));
    number(&scores(folder, "lf-validate quality truth-0000.lfv volume.lfv"), "q")
}

/// Two particles away from the depths at which one image tells no place: well above what a wrong sign, a half-pixel
/// shift or a lost aperture corner would leave.
#[test]
fn every_camera_finds_its_particles() {
    for (name, set) in [
        ("core", ""),
        ("core-round", ""),
        ("core-hexagonal", ""),
        ("core", "camera.microlenses.rotation_rad=0.01"),
        ("core-round", "camera.microlenses.offset_mm=[0.02,-0.03]"),
    ] {
        let mut keys = SMALL.to_vec();
        keys.push("volume.z_mm=[1,3]");
        keys.push("particles.per_lenslet=0.1");
        if !set.is_empty() {
            keys.push(set);
        }
        let folder = rendered(name, &keys);
        let q = reconstructed(folder.path(), "1,3", "");
        assert!(q > 0.93, "{name} {set}: Q {q}");
    }
}

#[test]
fn the_default_beats_the_method_of_the_paper() {
    let folder =
        rendered("core", &[&SMALL[..], &["volume.z_mm=[-2.5,2.5]", "particles.per_lenslet=0.3", "seed=3"]].concat());
    let ours = reconstructed(folder.path(), "-2.5,2.5", "");
    let paper =
        reconstructed(folder.path(), "-2.5,2.5", "--weights drt --method mart --relaxation 2.5 --iterations 10");
    assert!(ours > 0.88, "Q {ours}");
    assert!(paper > 0.5 && paper < ours, "Q {paper} of the paper's method, {ours} of the default");
}

/// A quick reconstruction, gone on from: its misfit begins where the quick one ended and comes out lower.
#[test]
fn a_reconstruction_is_logged_and_gone_on_from() {
    let folder = rendered("core", &[&SMALL[..], &["volume.z_mm=[1,3]", "particles.per_lenslet=0.3"]].concat());
    let misfits = |options: &str| -> Vec<f64> {
        run(folder.path(), &format!("lf-mart support.lfv -i frame-0000.exr -c camera.json --log log.jsonl {options}"));
        let log = std::fs::read_to_string(folder.path().join("log.jsonl")).unwrap();
        log.lines().map(|line| number(&serde_json::from_str(line).unwrap(), "misfit")).collect()
    };
    let first = reconstructed(folder.path(), "1,3", "--iterations 3");
    let quick = misfits("--iterations 3 -o quick.lfv");
    assert_eq!(quick.len(), 3);
    let on = misfits("--start quick.lfv --iterations 20 --until never -o on.lfv");
    assert_eq!(on.len(), 20);
    // Blobs of blobs are wider than the particles: the start is a little worse than what it came from.
    assert!(on[0] < quick[0] && on[19] < 0.7 * quick[2], "{quick:?} {on:?}");
    let score = scores(folder.path(), "lf-validate quality truth-0000.lfv on.lfv");
    assert!(number(&score, "q") > first + 0.02, "{first} {score}");
    let until = misfits(&format!("--until {} -o until.lfv", quick[1]));
    assert_eq!(until.len(), 2);
    assert!(until[1] <= quick[1]);
}

/// From raw images to vectors: (0.02, -0.013, 0.06) mm is (3.64, -2.36, 10.9) px.
#[test]
fn a_uniform_displacement_is_measured() {
    let folder = rendered(
        "uniform",
        &["volume.x_mm=[-0.9,0.9]", "volume.y_mm=[-0.9,0.9]", "particles.rays=20000", "truth.vectors=[5,5,5]"],
    );
    let path = folder.path();
    for n in ["0000", "0001"] {
        run(
            path,
            &format!(
                "lf-prune frame-{n}.exr -c camera.json --pvr 2,2,10 --depth -5,5 --bounds -0.9,0.9,-0.9,0.9 -o support.lfv"
            ),
        );
        run(path, &format!("lf-mart support.lfv -i frame-{n}.exr -c camera.json --iterations 20 -o volume-{n}.lfv"));
    }
    run(path, "lf-xcorr volume-0000.lfv volume-0001.lfv --window 48,48,32 -o field.exr");
    let error = scores(path, "lf-validate displacement flow.exr field.exr -c camera.json");
    for (key, most) in [
        ("bias_u_px", 0.1),
        ("bias_v_px", 0.1),
        ("bias_w_px", 1.0),
        ("rms_u_px", 0.6),
        ("rms_v_px", 0.6),
        ("rms_w_px", 5.0),
    ] {
        let found = number(&error, key).abs();
        assert!(found < most, "{key} {found}\n{error:#}");
    }
}

/// A camera whose data sheet is a little wrong, calibrated from a white image, serves as well as the true one.
#[test]
fn a_calibrated_camera_serves_as_the_true_one() {
    let true_lattice = ["camera.microlenses.pitch_mm=0.0771", "camera.microlenses.offset_mm=[0.011,-0.007]"];
    let folder =
        rendered("core-round", &[&SMALL[..], &true_lattice, &["particles.per_lenslet=0.5", "seed=3"]].concat());
    let path = folder.path();
    let scene = Call::new("lf-synth").words(["scene", "core-round"]).run().done();
    let nominal: Value = serde_json::from_slice(&scene.stdout).unwrap();
    std::fs::write(path.join("nominal.json"), nominal["camera"].to_string()).unwrap();
    run(path, "lf-synth white scene.json -o white.exr");
    let with_the_truth = reconstructed(path, "-5,5", "");
    run(path, "lf-calib lattice white.exr -c nominal.json -o camera.json");
    let calibrated = reconstructed(path, "-5,5", "");
    std::fs::copy(path.join("nominal.json"), path.join("camera.json")).unwrap();
    let guessed = reconstructed(path, "-5,5", "");
    assert!((calibrated - with_the_truth).abs() < 5e-3, "{calibrated} against {with_the_truth}");
    assert!(guessed < calibrated - 0.05, "{guessed} against {calibrated}");
}
