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

/// Few particles, away from the focal plane, where one image does not show the depth. Q is far above what a wrong sign,
/// a shift of half a pixel or a lost corner of the aperture would leave; 1 - Q is at most twice today's.
#[test]
fn every_camera_finds_its_particles() {
    for (name, set, least) in [
        ("core", "", 0.952),
        ("core-round", "", 0.953),
        ("core-hexagonal", "", 0.981),
        ("core", "camera.microlenses.rotation_rad=0.01", 0.983),
        ("core-round", "camera.microlenses.offset_mm=[0.02,-0.03]", 0.973),
    ] {
        let mut keys = SMALL.to_vec();
        keys.push("volume.z_mm=[1,3]");
        keys.push("particles.per_lenslet=0.1");
        if !set.is_empty() {
            keys.push(set);
        }
        let folder = rendered(name, &keys);
        let q = reconstructed(&folder, "1,3", BEST_Q);
        assert!(q > least, "{name} {set}: Q {q}");
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
    assert!(on[0] < quick[0] && on[19] < 0.5 * quick[2], "{quick:?} {on:?}");
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
        ("bias_u_px", 0.09),
        ("bias_v_px", 0.066),
        ("bias_w_px", 0.23),
        ("rms_u_px", 0.35),
        ("rms_v_px", 0.22),
        ("rms_w_px", 2.2),
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
    assert!((calibrated - with_the_truth).abs() < 7e-4, "{calibrated} against {with_the_truth}");
    assert!(guessed < 0.04 * calibrated, "{guessed} against {calibrated}");
}

/// Particles of one frame of a table: place and, where it is there, its standard uncertainty, mm.
fn particles(folder: &Folder, name: &str, frame: usize) -> Vec<Vec<f64>> {
    let text = folder.text(name);
    let rows = text.lines().skip_while(|line| !line.starts_with("frame,")).skip(1);
    let rows = rows.map(|line| line.split(',').map(|word| word.parse().unwrap()).collect::<Vec<f64>>());
    rows.filter(|row| row[0] == frame as f64).map(|row| row[2..].to_vec()).collect()
}

/// Number of pairs of true and found particles within 1.5 px or three standard uncertainties of each other along each
/// axis.
fn matched(truth: &[Vec<f64>], found: &[Vec<f64>]) -> usize {
    let mut free: Vec<&Vec<f64>> = found.iter().collect();
    let is_near = |a: &[f64], b: &[f64]| (0..3).all(|k| (a[k] - b[k]).abs() < (1.5 * 0.0055f64).max(3.0 * b[4 + k]));
    let mut count = 0;
    for particle in truth {
        if let Some(n) = free.iter().position(|other| is_near(particle, other)) {
            free.swap_remove(n);
            count += 1;
        }
    }
    count
}

/// The default chain on noisy frames of a vortex ring: at most twice today's errors.
#[test]
fn the_default_chain_keeps_its_figures() {
    let folder = rendered(
        "demo",
        &[
            "camera.sensor.width=420",
            "camera.sensor.height=420",
            "volume.x_mm=[-0.77,0.77]",
            "volume.y_mm=[-0.77,0.77]",
            "particles.per_lenslet=0.3",
            "particles.rays=100000",
            r#"flow={"kind": "ring", "centre_mm": [0, 0, 0], "axis": [1, 0, 0], "radius_mm": 0.7, "core_mm": 0.5,
                "displacement_mm": 0.06}"#,
            "truth=null",
            r#"sensor_noise={"photon_noise": true, "read_noise_electrons": 3, "dark_counts": 20}"#,
        ],
    );
    folder.run("lf-synth dark scene.json -o dark.exr");
    let (mut there, mut found, mut both) = (0, 0, 0);
    for n in 0..2 {
        let frame = format!("frame-000{n}.exr");
        let camera = "-c camera.json -b dark.exr";
        folder.run(&format!("lf-prune {frame} {camera} --depth -5,5 -o support.lfv"));
        folder.run(&format!("lf-mart support.lfv -i {frame} {camera} -o volume-{n}.lfv"));
        let output = format!("--frame {n} --particles found-{n}.csv");
        folder.run(&format!("lf-fit volume-{n}.lfv -i {frame} {camera} {output}"));
        let [truth, fitted] = ["particles.csv", &format!("found-{n}.csv")].map(|name| particles(&folder, name, n));
        there += truth.len();
        found += fitted.len();
        both += matched(&truth, &fitted);
    }
    folder.run("lf-xcorr volume-0.lfv volume-1.lfv --particles found-0.csv found-1.csv -o field.exr");
    let error = folder.run("lf-validate displacement scene.json field.exr -c camera.json").json();
    let rms = ["u", "v", "w"].map(|axis| number(&error, &format!("rms_{axis}_px")));
    let (missed, ghosts) = (there - both, found - both);
    assert!(missed <= 2 && ghosts <= 6, "of {there} particles {missed} missed, {ghosts} ghosts; RMS {rms:?} px");
    assert!(rms[0] < 0.55 && rms[1] < 0.36 && rms[2] < 0.69, "RMS {rms:?} px");
}
