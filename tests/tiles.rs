//! A volume in tiles is the whole: rendered, pruned, reconstructed and correlated in four parts, against one.

use lf_tests::Call;
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn run(folder: &Path, line: &str) -> Vec<u8> {
    let (tool, words) = line.split_once(' ').unwrap();
    Call::new(tool).within(folder).words(words.split_whitespace()).run().done().stdout
}

fn number(folder: &Path, line: &str, key: &str) -> f64 {
    let scores: Value = serde_json::from_slice(&run(folder, line)).unwrap();
    scores[key].as_f64().unwrap_or_else(|| panic!("{key} in {scores}"))
}

/// Frames 0000 and 0001 of 24 x 24 lenslets and 2 mm of depth, displaced alike.
fn rendered() -> TempDir {
    let folder = TempDir::new().unwrap();
    let keys = [
        "volume.x_mm=[-0.9,0.9]",
        "volume.y_mm=[-0.9,0.9]",
        "volume.z_mm=[1,2]",
        "camera.sensor.width=448",
        "camera.sensor.height=448",
        "particles.rays=20000",
    ];
    let set = keys.iter().flat_map(|key| ["--set", key]);
    let scene = Call::new("lf-synth").words(["scene", "uniform"]).words(set).run().done();
    fs::write(folder.path().join("scene.json"), scene.stdout).unwrap();
    run(folder.path(), "lf-synth frames scene.json -o .");
    folder
}

const VOLUME: &str = "-c camera.json --pvr 2,2,10 --depth 1,2 --bounds -0.9,0.9,-0.9,0.9";

/// Support and volume of a part of a frame.
fn reconstructed(folder: &Path, part: &str, frame: &str, name: &str) {
    let sweeps = "--iterations 5 --until never";
    run(folder, &format!("lf-prune frame-{frame}.exr {VOLUME} {part} -o support.lfv"));
    run(folder, &format!("lf-mart support.lfv -i frame-{frame}.exr -c camera.json {sweeps} -o {name}-{frame}.lfv"));
}

#[test]
fn four_tiles_are_the_whole() {
    let folder = rendered();
    let folder = folder.path();
    for frame in ["0000", "0001"] {
        reconstructed(folder, "--tile 1/1", frame, "whole");
        for index in 1..=4 {
            reconstructed(folder, &format!("--tile {index}/4"), frame, &format!("tile-{index}"));
        }
    }
    // In any order.
    let tiles = |frame: &str| [3, 1, 4, 2].map(|index| format!("tile-{index}-{frame}.lfv")).join(" ");
    let (first, second) = (tiles("0000"), tiles("0001"));
    for (frame, tiles) in [("0000", &first), ("0001", &second)] {
        let line = format!("lf-validate quality whole-{frame}.lfv {tiles}");
        let difference = number(folder, &format!("{line} --max-difference 1e-4"), "max_difference");
        assert!(difference > 0.0, "tiles are other sums: {difference}");
        let call = Call::new("lf-validate").within(folder).words(line.split_whitespace().skip(1));
        assert_eq!(call.words(["--max-difference", "0"]).run().status.code(), Some(1));
    }
    let windows = "--window 64,64,12 --initial 96,96,18";
    run(folder, &format!("lf-xcorr whole-0000.lfv whole-0001.lfv {windows} -o whole.exr"));
    run(folder, &format!("lf-xcorr {first} {second} {windows} -o tiles.exr"));
    for axis in ["u", "v", "w"] {
        let line = "lf-validate displacement whole.exr tiles.exr -c camera.json";
        let rms = number(folder, line, &format!("rms_{axis}_px"));
        assert!(rms < 1e-3, "{axis}: {rms} px");
    }
    // The same pair twice is the same field; and half of the tiles are none.
    let files: Vec<&str> = first.split(' ').chain(second.split(' ')).collect();
    let again: String = files.chunks(2).map(|two| format!("--and {} ", two.join(" "))).collect();
    run(folder, &format!("lf-xcorr {first} {second} {again} {windows} -o twice.exr"));
    assert!(number(folder, "lf-validate displacement tiles.exr twice.exr", "rms_u_mm") < 1e-5);
    let words = format!("{} {second} -o none.exr", first.rsplit_once(' ').unwrap().0);
    Call::new("lf-xcorr").within(folder).words(words.split_whitespace()).run().refused("tile-3-0001.lfv");
    let info = String::from_utf8(run(folder, "lf-validate info tile-2-0000.lfv")).unwrap();
    assert!(info.contains("2 of 4"), "{info}");
}

#[test]
fn a_tile_that_is_none_is_refused() {
    let folder = rendered();
    let call = |words: &str| {
        let words = format!("frame-0000.exr {VOLUME} {words} -o none.lfv");
        Call::new("lf-prune").within(folder.path()).words(words.split_whitespace()).run()
    };
    for (words, subject) in [
        ("--tile 5/4", "--tile: 5/4; wanted 1/n to n/n"),
        ("--tile 0/4", "--tile: 0/4; wanted 1/n to n/n"),
        ("--tile 4", "like 1/4"),
        ("--tile 1/4 --halo=-1", "--halo"),
        ("--halo 1", "--tile"),
    ] {
        call(words).refused(subject);
    }
    assert!(!folder.path().join("none.lfv").exists());
}
