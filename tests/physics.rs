//! Whole pipelines against the known truth: light, reconstruction, displacement. Rays render the scenes; the tools
//! under test do not know these rays.

use lf_tests::Folder;
use serde_json::Value;

/// Renders a ready scene with keys set into a new folder.
fn rendered(name: &str, keys: &[&str]) -> Folder {
    let folder = Folder::new();
    folder.scene(name, keys);
    folder.run("lf-synth frames scene.json -o .");
    folder
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// A ninth of the test volume of 20 x 20 lenslets, which is quick.
const SMALL: [&str; 3] = ["volume.x_mm=[-0.26,0.26]", "volume.y_mm=[-0.26,0.26]", "particles.rays=50000"];

/// Q on the grid of the truth, over the depths `z`.
fn reconstructed(folder: &Folder, z: &str, options: &str) -> f64 {
    let bounds = format!("--depth {z} --bounds -0.26,0.26,-0.26,0.26");
    folder.run(&format!("lf-prune frame-0000.exr -c camera.json {bounds} -o support.lfv"));
    folder.run(&format!("lf-mart support.lfv -i frame-0000.exr -c camera.json {options} -o volume.lfv"));
    number(&folder.run("lf-validate quality truth-0000.lfv volume.lfv").json(), "q")
}

/// The options with which Q is best; the defaults are best for vectors.
const BEST_Q: &str = "--basis blob --iterations 60 --until stall";

/// Few particles, away from the focal plane, where one image does not tell the depth. Q is far above what a wrong sign,
/// a shift of half a pixel or a lost corner of the aperture would leave.
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
        let q = reconstructed(&folder, "1,3", BEST_Q);
        assert!(q > 0.93, "{name} {set}: Q {q}");
    }
}

#[test]
fn blobs_beat_the_method_of_the_paper() {
    let folder =
        rendered("core", &[&SMALL[..], &["volume.z_mm=[-2.5,2.5]", "particles.per_lenslet=0.3", "seed=3"]].concat());
    let ours = reconstructed(&folder, "-2.5,2.5", BEST_Q);
    let paper = reconstructed(&folder, "-2.5,2.5", "--weights drt --method mart --relaxation 2.5 --iterations 10");
    assert!(ours > 0.88, "Q {ours}");
    assert!(paper > 0.5 && paper < ours, "Q {paper} of the paper's method, {ours} of blobs");
}

/// A reconstruction continued from a quick one: its misfit starts where the quick one ended, and falls.
#[test]
fn a_reconstruction_is_logged_and_continued() {
    let folder = rendered("core", &[&SMALL[..], &["volume.z_mm=[1,3]", "particles.per_lenslet=0.3"]].concat());
    let misfits = |options: &str| -> Vec<f64> {
        folder.run(&format!("lf-mart support.lfv -i frame-0000.exr -c camera.json --log log.jsonl {options}"));
        let log = folder.text("log.jsonl");
        log.lines().map(|line| number(&serde_json::from_str(line).unwrap(), "misfit")).collect()
    };
    let first = reconstructed(&folder, "1,3", "--iterations 3");
    let quick = misfits("--iterations 3 -o quick.lfv");
    assert_eq!(quick.len(), 3);
    let on = misfits("--start quick.lfv --iterations 20 --until never -o on.lfv");
    assert_eq!(on.len(), 20);
    // Blobs of blobs are wider than the particles, so the start is a little worse than the quick result.
    assert!(on[0] < quick[0] && on[19] < 0.7 * quick[2], "{quick:?} {on:?}");
    let score = folder.run("lf-validate quality truth-0000.lfv on.lfv").json();
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
    for n in ["0000", "0001"] {
        folder.run(&format!(
            "lf-prune frame-{n}.exr -c camera.json --pvr 2,2,10 --depth -5,5 --bounds -0.9,0.9,-0.9,0.9 -o support.lfv"
        ));
        folder.run(&format!("lf-mart support.lfv -i frame-{n}.exr -c camera.json --iterations 20 -o volume-{n}.lfv"));
    }
    folder.run("lf-xcorr volume-0000.lfv volume-0001.lfv --window 48,48,32 -o field.exr");
    let error = folder.run("lf-validate displacement flow.exr field.exr -c camera.json").json();
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

/// A camera with a slightly wrong data sheet, calibrated from a white image, reconstructs as well as the true camera.
#[test]
fn a_calibrated_camera_serves_as_the_true_one() {
    let true_lattice = ["camera.microlenses.pitch_mm=0.0771", "camera.microlenses.offset_mm=[0.011,-0.007]"];
    let folder =
        rendered("core-round", &[&SMALL[..], &true_lattice, &["particles.per_lenslet=0.5", "seed=3"]].concat());
    let nominal = folder.run("lf-synth scene core-round").json();
    folder.write("nominal.json", nominal["camera"].to_string());
    folder.run("lf-synth white scene.json -o white.exr");
    let with_the_truth = reconstructed(&folder, "-5,5", "");
    folder.run("lf-calib lattice white.exr -c nominal.json -o camera.json");
    let calibrated = reconstructed(&folder, "-5,5", "");
    folder.write("camera.json", folder.bytes("nominal.json"));
    let guessed = reconstructed(&folder, "-5,5", "");
    assert!((calibrated - with_the_truth).abs() < 5e-3, "{calibrated} against {with_the_truth}");
    assert!(guessed < calibrated - 0.05, "{guessed} against {calibrated}");
}
