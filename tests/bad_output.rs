//! Every output of every tool, made impossible: one line, exit code 2, inputs untouched, nothing left behind.

use lf_tests::Call;
use lf_tests::samples::{Kind, Samples};
use lf_tests::uses::{Use, uses};
use serde_json::Value;
use std::fs::{self, File, Permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};

fn writers() -> impl Iterator<Item = &'static Use> {
    uses().filter(|this| this.output().is_some())
}

fn file_writers() -> impl Iterator<Item = &'static Use> {
    writers().filter(|this| !this.fills_folder())
}

fn bytes(paths: &[PathBuf]) -> Vec<Vec<u8>> {
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

#[test]
fn an_output_may_not_be_an_input_by_any_name() {
    let samples = Samples::new();
    for this in file_writers() {
        let inputs = this.sound(&samples);
        let before = bytes(&inputs);
        for input in &inputs {
            let (soft, hard) = (samples.path("soft"), samples.path("hard"));
            symlink(input, &soft).unwrap();
            fs::hard_link(input, &hard).unwrap();
            for output in [input, &soft, &hard] {
                let name = output.file_name().unwrap().to_str().unwrap();
                this.call(&inputs, output).run().refused(name);
            }
            fs::remove_file(soft).unwrap();
            fs::remove_file(hard).unwrap();
        }
        assert_eq!(bytes(&inputs), before, "{this:?}");
    }
}

#[test]
fn stats_may_not_be_an_input_or_the_output() {
    let samples = Samples::new();
    for this in uses() {
        let inputs = this.sound(&samples);
        let before = bytes(&inputs);
        let output = samples.path(this.output().unwrap_or("unused"));
        for input in &inputs {
            this.call(&inputs, &output).word("--stats").word(input).run().refused("--stats");
        }
        if this.output().is_some() && !this.fills_folder() {
            this.call(&inputs, &output).word("--stats").word(&output).run().refused("--stats");
            assert!(!output.exists(), "{this:?}");
        }
        assert_eq!(bytes(&inputs), before, "{this:?}");
    }
}

#[test]
fn a_full_disk_is_an_error() {
    let samples = Samples::new();
    let full = || File::options().write(true).open("/dev/full").unwrap();
    for this in uses() {
        match this.output() {
            Some(_) if this.fills_folder() => {}
            Some(_) => {
                this.sound_call(&samples, Path::new("/dev/full")).run().refused("/dev/full");
                this.sound_call(&samples, Path::new("-")).stdout(full()).run().refused("standard output");
            }
            None => {
                this.sound_call(&samples, Path::new("unused")).stdout(full()).run().refused("standard output");
            }
        }
    }
}

#[test]
fn a_closed_pipe_is_an_error() {
    let samples = Samples::new();
    for this in uses().filter(|this| !this.fills_folder()) {
        this.sound_call(&samples, Path::new("-")).closed_pipe().run().refused("standard output");
    }
}

#[test]
fn an_output_that_cannot_be_made_leaves_nothing() {
    let samples = Samples::new();
    let plain = samples.write("plain", "a file");
    let locked = samples.path("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, Permissions::from_mode(0o555)).unwrap();
    // The superuser may write anywhere.
    let is_locked = File::create(locked.join("probe")).is_err();
    if !is_locked {
        fs::remove_file(locked.join("probe")).unwrap();
    }
    for this in writers() {
        let name = this.output().unwrap();
        let mut hopeless = vec![plain.join(name), Path::new("/proc").join(name)];
        if !this.fills_folder() {
            hopeless.extend([samples.path("nowhere").join(name), samples.root().to_owned()]);
        }
        if is_locked {
            hopeless.push(locked.join(name));
        }
        for output in hopeless {
            let before = samples.listing();
            this.sound_call(&samples, &output).run().refused(output.file_name().unwrap().to_str().unwrap());
            assert_eq!(samples.listing(), before, "{this:?} left something behind");
        }
    }
    fs::set_permissions(&locked, Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn a_failed_run_leaves_the_old_output_as_it_was() {
    let samples = Samples::new();
    for this in file_writers() {
        let old = samples.write(this.output().unwrap(), "what stood here before");
        let mut inputs = this.sound(&samples);
        inputs[0] = samples.path("missing");
        this.call(&inputs, &old).run().refused("missing");
        assert_eq!(fs::read(&old).unwrap(), b"what stood here before", "{this:?}");
        fs::remove_file(old).unwrap();
    }
}

// `frames` writes fixed names into its folder. They may be files that the scene reads.
#[test]
fn an_output_folder_may_not_overwrite_the_files_of_its_scene() {
    if !uses().any(|this| this.tool == "lf-synth") {
        return;
    }
    let samples = Samples::new();
    let particles = "# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n0,0,0,0,0,1000\n";
    samples.write("particles.csv", particles);
    let mut scene: Value = serde_json::from_slice(&fs::read(samples.sound(Kind::Scene)).unwrap()).unwrap();
    scene["particles"] = serde_json::json!({"csv": "particles.csv", "sigma_px": 0.75, "rays": 500});
    scene["frames"] = 2.into();
    let scene = samples.write("own.json", scene.to_string());
    let call = |output: &Path| Call::new("lf-synth").word("frames").word(&scene).word("-o").word(output);
    call(&samples.path("elsewhere")).run().done();
    call(samples.root()).run().refused("particles.csv");
    assert_eq!(fs::read_to_string(samples.path("particles.csv")).unwrap(), particles);
}

/// Scar: a killed run left new frames beside the camera, the table and the later frames of the run before.
#[test]
fn a_series_that_ends_half_way_does_not_look_whole() {
    if !uses().any(|this| this.tool == "lf-synth") {
        return;
    }
    let samples = Samples::new();
    let mut scene = samples.json("scene.json");
    for (name, frames) in [("two.json", 2), ("three.json", 3)] {
        scene["frames"] = frames.into();
        samples.write(name, scene.to_string());
    }
    let marks = || ["camera.json", "scene-used.json"].map(|name| samples.path("series").join(name).exists());
    samples.run("lf-synth frames three.json -o series");
    assert_eq!(marks(), [true; 2]);
    let shorter = samples.run("lf-synth frames two.json -o series --seed 8").stderr;
    assert!(shorter.contains("warning: series/frame-0002.exr: of another run"), "{shorter}");
    // A folder in the place of the second frame ends the run after the first.
    let second = samples.path("series/frame-0001.exr");
    fs::remove_file(&second).unwrap();
    fs::create_dir(&second).unwrap();
    samples.call("lf-synth frames two.json -o series --seed 9").run().refused("frame-0001.exr");
    assert_eq!(marks(), [false; 2]);
    fs::remove_dir(&second).unwrap();
    samples.run("lf-synth frames two.json -o series --seed 9");
    assert_eq!(marks(), [true; 2]);
}
