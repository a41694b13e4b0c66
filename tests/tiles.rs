//! A volume pruned, reconstructed and correlated in four tiles equals the whole volume.

use lf_tests::Folder;
use std::sync::OnceLock;

fn number(folder: &Folder, line: &str, key: &str) -> f64 {
    let scores = folder.run(line).json();
    scores[key].as_f64().unwrap_or_else(|| panic!("{key} in {scores}"))
}

/// Frames 0000 and 0001 of 24 x 24 lenslets and 1 mm of depth, with the same displacement everywhere.
fn rendered() -> &'static Folder {
    static RENDERED: OnceLock<Folder> = OnceLock::new();
    RENDERED.get_or_init(|| {
        let folder = Folder::shared();
        let keys = [
            "volume.x_mm=[-0.9,0.9]",
            "volume.y_mm=[-0.9,0.9]",
            "volume.z_mm=[1,2]",
            "camera.sensor.width=448",
            "camera.sensor.height=448",
            "particles.rays=20000",
        ];
        folder.scene("uniform", &keys);
        folder.run("lf-synth frames scene.json -o .");
        folder
    })
}

const VOLUME: &str = "-c camera.json --pvr 2,2,10 --depth 1,2 --bounds -0.9,0.9,-0.9,0.9";

/// Prunes and reconstructs a tile of a frame.
fn reconstruct(folder: &Folder, tile: &str, frame: &str, name: &str) {
    let sweeps = "--iterations 5 --until never";
    folder.run(&format!("lf-prune frame-{frame}.exr {VOLUME} {tile} -o support.lfv"));
    folder.run(&format!("lf-mart support.lfv -i frame-{frame}.exr -c camera.json {sweeps} -o {name}-{frame}.lfv"));
}

#[test]
fn four_tiles_are_the_whole() {
    let folder = rendered();
    for frame in ["0000", "0001"] {
        reconstruct(folder, "--tile 1/1", frame, "whole");
        for index in 1..=4 {
            reconstruct(folder, &format!("--tile {index}/4"), frame, &format!("tile-{index}"));
        }
    }
    // In any order.
    let tiles = |frame: &str| [3, 1, 4, 2].map(|index| format!("tile-{index}-{frame}.lfv")).join(" ");
    let (first, second) = (tiles("0000"), tiles("0001"));
    for (frame, tiles) in [("0000", &first), ("0001", &second)] {
        let line = format!("lf-validate quality whole-{frame}.lfv {tiles}");
        folder.run(&format!("{line} --max-difference 1e-4"));
    }
    let windows = "--pass 96,96,18 --pass 64,64,12";
    folder.run(&format!("lf-xcorr whole-0000.lfv whole-0001.lfv {windows} -o whole.exr"));
    folder.run(&format!("lf-xcorr {first} {second} {windows} -o tiles.exr"));
    for axis in ["u", "v", "w"] {
        let line = "lf-validate displacement whole.exr tiles.exr -c camera.json";
        let rms = number(folder, line, &format!("rms_{axis}_px"));
        assert!(rms < 1e-3, "{axis}: {rms} px");
    }
    // A pair given twice gives the same field. A missing tile is refused.
    let files: Vec<&str> = first.split(' ').chain(second.split(' ')).collect();
    let again: String = files.chunks(2).map(|two| format!("--and {} ", two.join(" "))).collect();
    folder.run(&format!("lf-xcorr {first} {second} {again} {windows} -o twice.exr"));
    assert!(number(folder, "lf-validate displacement tiles.exr twice.exr", "rms_u_mm") < 1e-5);
    let words = format!("{} {second} -o none.exr", first.rsplit_once(' ').unwrap().0);
    folder.call(&format!("lf-xcorr {words}")).run().refused("tile-3-0001.lfv");
    let info = folder.run("lf-validate info tile-2-0000.lfv").text();
    assert!(info.contains("2 of 4"), "{info}");
}

#[test]
fn an_invalid_tile_is_refused() {
    let folder = rendered();
    let prune = |words: &str| folder.call(&format!("lf-prune frame-0000.exr {VOLUME} {words} -o none.lfv")).run();
    for (words, subject) in [
        ("--tile 5/4", "--tile: 5/4; wanted 1/n to n/n"),
        ("--tile 0/4", "--tile: 0/4; wanted 1/n to n/n"),
        ("--tile 4", "like 1/4"),
        ("--tile 1/4 --halo=-1", "--halo"),
        ("--halo 1", "--tile"),
    ] {
        prune(words).refused(subject);
    }
    assert!(!folder.path("none.lfv").exists());
}
