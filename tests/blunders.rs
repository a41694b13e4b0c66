//! Blunders of a user: each gets a warning that names its cause, and good frames get none.

use lf_core::history::History;
use lf_core::image;
use lf_tests::{Ended, Folder};
use serde_json::{Value, json};

/// A camera: layout, turn of the lattice, stop.
const CAMERAS: [[&str; 3]; 4] = [
    ["square", "0.0", "square"],
    ["square", "0.0", "circle"],
    ["square", "0.003", "circle"],
    ["hexagonal", "0.003", "circle"],
];

/// Without `bits`, so that the black level is not clipped.
const NOISE: &str =
    r#"sensor_noise={"gain_counts_per_electron": 0.2, "photon_noise": true, "read_noise_electrons": 12}"#;

/// Particles of a ninth of the volume of `core`, by a camera, with more keys.
fn rendered([layout, turn, stop]: [&str; 3], more: &[&str]) -> Folder {
    let folder = Folder::new();
    let lattice = [
        format!("camera.microlenses.layout={layout}"),
        format!("camera.microlenses.rotation_rad={turn}"),
        format!("camera.main_lens.aperture={stop}"),
    ];
    let small = ["volume.x_mm=[-0.35,0.35]", "volume.y_mm=[-0.35,0.35]", "volume.z_mm=[-3,3]", "truth=null"];
    let light = ["particles.rays=50000", "particles.intensity=40000"];
    let keys = lattice.iter().map(String::as_str).chain(small).chain(light).chain(more.iter().copied());
    folder.scene("core", &keys.collect::<Vec<_>>());
    folder.run("lf-synth frames scene.json -o . --quiet");
    folder
}

const REGION: &str = "--depth -3,3 --bounds -0.35,0.35,-0.35,0.35 --pvr 1,1,20";

fn prune(folder: &Folder, words: &str) -> Ended {
    folder.run(&format!("lf-prune frame-0000.exr -c camera.json {REGION} -o support.lfv {words}"))
}

fn mart(folder: &Folder, words: &str) -> Ended {
    folder.run(&format!("lf-mart support.lfv -i frame-0000.exr -c camera.json -o volume.lfv {words}"))
}

/// Changes a block of `camera.json`.
fn change(folder: &Folder, block: &str, key: &str, value: &Value) {
    let mut camera = folder.json("camera.json");
    camera[block][key] = value.clone();
    folder.write("camera.json", camera.to_string());
}

/// The one warning of a run has all of these words.
fn assert_warned(ended: &Ended, words: &[&str]) {
    let lines: Vec<&str> = ended.stderr.lines().filter(|line| line.contains(": warning: ")).collect();
    let has_all = |line: &&&str| words.iter().all(|word| line.contains(word));
    assert!(lines.iter().filter(has_all).count() == 1, "{words:?} in {}", ended.stderr);
}

#[test]
fn good_frames_are_pruned_and_reconstructed_without_a_word() {
    for camera in CAMERAS {
        for density in ["0.02", "0.1", "0.5", "1.0"] {
            for noise in ["sensor_noise=null", NOISE] {
                let folder = rendered(camera, &[&format!("particles.per_lenslet={density}"), noise]);
                prune(&folder, "").silent();
                if density == "0.1" {
                    mart(&folder, "").silent();
                }
            }
        }
    }
}

/// One particle far from the focus shows the stop at few places, and at the side of the sensor a part of it.
#[test]
fn a_frame_of_one_particle_is_pruned_without_a_word() {
    for seed in ["seed=1", "seed=5", "seed=14", "seed=15"] {
        let narrow = ["camera.microlenses.focal_length_mm=1.232", "camera.main_lens.working_f_number=16"];
        let deep = ["volume.z_mm=[-12,12]", "particles.per_lenslet=0.0122", seed];
        let folder = rendered(CAMERAS[1], &[&narrow[..], &deep].concat());
        assert_eq!(folder.text("particles.csv").lines().filter(|line| line.starts_with('0')).count(), 1);
        folder.run("lf-prune frame-0000.exr -c camera.json --depth -12,12 --pvr 2,2,40 -o support.lfv").silent();
    }
}

#[test]
fn a_stop_smaller_than_stated_loses_no_particle_and_is_named() {
    for camera in CAMERAS {
        for more in [&["sensor_noise=null"][..], &[r#"sensor_noise={"dead_share": 0.01}"#]] {
            let stop = "camera.main_lens.working_f_number=4.545454";
            let folder = rendered(camera, &[&[stop, "particles.per_lenslet=0.5"], more].concat());
            change(&folder, "main_lens", "working_f_number", &json!(4.0));
            for score in ["geometric", "quantile"] {
                let ended = prune(&folder, &format!("--score {score} --truth particles.csv --stats stats.json"));
                let counts = folder.json("stats.json")["counts"].clone();
                let [lost, all] = ["lost_particles", "particles"].map(|name| counts[name].as_f64().unwrap());
                assert!(all > 20.0 && lost <= 0.02 * all, "{camera:?} {score}: {lost} of {all}");
                assert_warned(
                    &ended,
                    &["sections of the aperture are dark", "the camera says 14.0 px", "lf-calib lattice"],
                );
            }
        }
    }
}

#[test]
fn a_forgotten_background_is_named() {
    let folder = rendered(CAMERAS[1], &["particles.per_lenslet=0.5", r#"sensor_noise={"dark_counts": 100}"#]);
    let ended = prune(&folder, "");
    assert_warned(&ended, &["the darkest tenth of the image is", "% as bright", "-b"]);
    assert_warned(&ended, &["% of the voxels are kept", "-b"]);
    assert_warned(&mart(&folder, "--iterations 2"), &["the darkest tenth of the image is", "-b"]);
    folder.run("lf-synth dark scene.json -o dark.exr --quiet");
    prune(&folder, "-b dark.exr").silent();
    // A mask hides pixels of the frame, and none of the background.
    let mut mask = image::open(&folder.path("dark.exr")).unwrap().pixels;
    let rows = mask.nrows();
    mask.indexed_iter_mut()
        .for_each(|((row, _), pixel)| *pixel = f32::from(u8::from((3..5).contains(&(8 * row / rows)))));
    image::save(&folder.path("mask.exr"), &mask, &History::default()).unwrap();
    let ended = prune(&folder, "-b dark.exr --mask mask.exr");
    assert!(!ended.stderr.contains("times the counts"), "{}", ended.stderr);
}

#[test]
fn a_white_image_is_named_as_a_frame_and_as_a_background() {
    for camera in CAMERAS {
        let folder = rendered(camera, &["particles.per_lenslet=2"]);
        let is_white = "half of the pixels are at least";
        assert!(!prune(&folder, "").stderr.contains(is_white), "{camera:?}");
        folder.run("lf-synth white scene.json -o white.exr --quiet");
        let other = format!("lf-prune white.exr -c camera.json {REGION} -o support.lfv");
        assert_warned(&folder.run(&other), &[is_white, "a white image"]);
        let words = ["the background of -b has", "times the counts of the frame", "no white image"];
        // Nothing may be left, which is refused.
        let line = format!("lf-prune frame-0000.exr -c camera.json {REGION} -b white.exr -o support.lfv");
        assert_warned(&folder.call(&line).run(), &words);
    }
}

#[test]
fn a_few_dark_counts_are_named() {
    let noise = r#"sensor_noise={"dark_counts": 5}"#;
    let folder = rendered(CAMERAS[1], &["particles.per_lenslet=0.5", noise]);
    for ended in [prune(&folder, ""), mart(&folder, "--iterations 2")] {
        assert_warned(
            &ended,
            &["the darkest hundredth of the pixels has 5.0 counts", "no background is subtracted", "-b"],
        );
    }
    folder.run("lf-synth dark scene.json -o dark.exr --quiet");
    prune(&folder, "-b dark.exr").silent();
}

#[test]
fn a_clipped_frame_is_named_with_its_share() {
    let noise = r#"sensor_noise={"gain_counts_per_electron": 0.2, "photon_noise": true, "full_well_electrons": 1500}"#;
    let folder = rendered(CAMERAS[1], &["particles.per_lenslet=0.5", noise]);
    for ended in [prune(&folder, ""), mart(&folder, "--iterations 2")] {
        assert_warned(&ended, &["% of the pixels are clipped, at 300 counts"]);
    }
}

#[test]
fn a_moved_lattice_is_named() {
    for camera in &CAMERAS[1..] {
        let folder = rendered(*camera, &["particles.per_lenslet=0.5"]);
        change(&folder, "microlenses", "offset_mm", &json!([0.0055, -0.0055]));
        assert_warned(
            &prune(&folder, ""),
            &["the light lies 1.", "px beside the camera's lenslet images", "lf-calib lattice"],
        );
        assert_warned(&mart(&folder, "--iterations 2"), &["the light lies 1.", "px beside"]);
    }
}

/// Keys of particles under most of the lenslets: under a few of them another pitch is not clear.
const WIDE: [&str; 3] = ["volume.x_mm=[-1,1]", "volume.y_mm=[-1,1]", "volume.z_mm=[-1,1]"];

/// A camera of another pitch either leaves voxels, with a warning, or none.
#[test]
fn a_camera_of_another_lattice_is_named() {
    for camera in &CAMERAS[1..] {
        for density in [0.1, 0.5] {
            let folder = rendered(*camera, &[&WIDE[..], &[&format!("particles.per_lenslet={density}")]].concat());
            change(&folder, "microlenses", "pitch_mm", &json!(0.08));
            let ended = folder
                .call(&format!("lf-prune frame-0000.exr -c camera.json {REGION} -o support.lfv --threshold 0.01"))
                .run();
            let line = "the light does not lie under the camera's lenslets";
            assert!(ended.stderr.contains(line), "{camera:?} {density}: {}", ended.stderr);
        }
    }
}

/// A support of another frame cannot explain the image.
#[test]
fn a_misfit_beyond_the_noise_is_named() {
    let folder = rendered(CAMERAS[0], &["particles.per_lenslet=0.1", "seed=1"]);
    prune(&folder, "");
    folder.scene(
        "core",
        &["volume.x_mm=[-0.35,0.35]", "volume.y_mm=[-0.35,0.35]", "volume.z_mm=[-3,3]", "truth=null", "seed=7"],
    );
    folder.run("lf-synth frames scene.json -o . --quiet");
    assert_warned(&mart(&folder, ""), &["misfit ", "up to 0.35 is good", "check that camera and support"]);
}

#[test]
fn nothing_left_names_the_cause() {
    let folder = rendered(CAMERAS[1], &[&WIDE[..], &["particles.per_lenslet=0.3"]].concat());
    let line = |words: &str| {
        folder
            .call(&format!("lf-prune frame-0000.exr -c camera.json {REGION} -o support.lfv {words}"))
            .run()
            .ended(2)
            .stderr
    };
    change(&folder, "microlenses", "pitch_mm", &json!(0.08));
    let text = line("--threshold 0.99");
    assert!(text.contains("no voxel survives pruning: the light does not lie under the camera's lenslets"), "{text}");
}
