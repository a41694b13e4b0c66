//! Limits of memory, and values at the ends of their ranges: refused in one line before the work, or done in the
//! estimated memory.

use lf_core::{Grid, Volume};
use lf_tests::samples::{Kind, Samples};
use lf_tests::{Call, Folder};
use serde_json::json;

/// The line that refuses a run of too much memory.
const TOO_MUCH: &str = "wanted 1 GB at most, as --max-memory allows";

fn prune(samples: &Samples, words: &str) -> Call {
    let call = Call::new("lf-prune").within(samples.root());
    call.words(["image.exr", "-c", "camera.json", "-o", "out.lfv"]).words(words.split_whitespace())
}

#[test]
fn huge_sensors_are_refused_by_every_task_that_renders() {
    let folder = Folder::new();
    folder.scene("target", &["camera.sensor.width=60000", "camera.sensor.height=60000"]);
    for (task, output) in [("white", "white.exr"), ("dark", "dark.exr"), ("dots", "dots"), ("frames", "frames")] {
        let line = format!("lf-synth {task} scene.json -o {output} --max-memory 1");
        folder.call(&line).run().refused(TOO_MUCH);
        assert!(!folder.path(output).exists(), "{task}");
    }
}

#[test]
fn huge_grids_are_refused_before_they_take_memory() {
    let samples = Samples::new();
    for words in ["--pvr 20,20,0.000001", "--pvr 0.001,0.001,0.01", "--pvr 1,1,0.0000001"] {
        for estimate in ["", " --estimate"] {
            let ended = prune(&samples, &format!("--depth -5,5 {words} --max-memory 1{estimate}")).run();
            let line = ended.refused("--depth, --pvr, --bounds").stderr;
            assert!(line.contains(TOO_MUCH) || line.contains("wanted less than 2^32 voxels a slice"), "{line}");
        }
    }
    let grid = Grid { shape: [2, 2, 1 << 58], spacing_mm: [0.01; 3], origin_mm: [0.0; 3] };
    samples.volume("huge.lfv", &grid, &[0, 5, 9], &[("intensity", &[1.0, 2.0, 3.0])]);
    prune(&samples, "--like huge.lfv --max-memory 1").run().refused(TOO_MUCH);
    for line in [
        "lf-validate quality huge.lfv huge.lfv --max-memory 1",
        "lf-validate depth huge.lfv --max-memory 1",
        "lf-xcorr huge.lfv huge.lfv --estimate --max-memory 1",
        "lf-xcorr huge.lfv huge.lfv -o field.exr --max-memory 1",
    ] {
        samples.call(line).run().refused(TOO_MUCH);
    }
    prune(&samples, "--depth -0.2,0.2 --max-memory 0").run().refused("wanted 0.001 to 1000000 GB");
}

/// Bytes by which the estimate of a small run may be too high.
const SMALL: f64 = 5e6;

/// Limits of the estimated memory over the memory taken: by one thread, and by several, which need not reach their
/// peaks together.
const HIGHEST_ESTIMATE: [f64; 2] = [1.3, 1.5];

/// Bytes that lf-mart estimates for weights that it keeps once dark voxels are dropped: a fifth of `--max-memory` at
/// most. In the few sweeps of a test they are not dropped.
fn later(line: &str) -> f64 {
    if line.starts_with("lf-mart") { 0.2 * MART_GB * 1e9 } else { 0.0 }
}
const MART_GB: f64 = 3.0;

/// Runs lines that write `stats.json` with each number of threads. The estimated memory must be at least the memory
/// taken, and at most [`HIGHEST_ESTIMATE`] times as much; small runs may take [`SMALL`] less.
fn check_memory(folder: &Folder, has_estimate: bool, threads: &[usize], lines: &[&str]) {
    for line in lines {
        for threads in threads {
            let line = format!("{line} -q --threads {threads}");
            let estimate =
                has_estimate.then(|| folder.run(&format!("{line} --estimate")).json()["memory_bytes"].clone());
            folder.run(&format!("{line} --stats stats.json"));
            let stats = folder.json("stats.json");
            let estimate = estimate.unwrap_or_else(|| stats["counts"]["estimated_bytes"].clone()).as_f64().unwrap();
            let taken = stats["peak_bytes"].as_f64().unwrap();
            let most = HIGHEST_ESTIMATE[usize::from(*threads > 1)];
            assert!(
                taken <= estimate && estimate <= most * taken + SMALL + later(&line),
                "{line}: {estimate} bytes estimated, {taken} taken"
            );
        }
    }
}

/// Writes the light of a volume three voxels further along x.
fn move_by_three(folder: &Folder, from: &str, to: &str) {
    let volume = Volume::open(&folder.path(from)).unwrap();
    let (grid, light) = (volume.grid(), volume.column("intensity").unwrap());
    let stays = |index: u64| grid.voxel(index)[0] + 3 < grid.shape[0];
    let lit = volume.indices().iter().zip(light).filter(|(index, _)| stays(**index));
    let (indices, light): (Vec<u64>, Vec<f32>) = lit.map(|(index, light)| (index + 3, *light)).unzip();
    folder.volume(to, grid, &indices, &[("intensity", &light)]);
}

#[test]
fn the_estimated_memory_is_the_memory_taken() {
    let folder = Folder::new();
    let noise = r#"sensor_noise={"dark_counts": 100, "read_noise_electrons": 3}"#;
    for (side, threads) in [(1400, &[2][..]), (2800, &[1, 8])] {
        let sides = [format!("camera.sensor.width={side}"), format!("camera.sensor.height={side}")];
        folder.scene("demo", &[&sides[0], &sides[1], noise, "white.rays_per_lenslet=100", "truth=null"]);
        let lines = ["lf-synth white scene.json -o white.exr", "lf-synth dark scene.json -o dark.exr"];
        check_memory(&folder, false, threads, &lines);
    }
    for layout in ["square", "hexagonal"] {
        let layout = format!("camera.microlenses.layout={layout}");
        let keys = [layout.as_str(), "truth=null", "frames=1", "particles.rays=3000", "particles.per_lenslet=2"];
        let sides = ["camera.sensor.width=560", "camera.sensor.height=560"];
        let bounds = ["volume.x_mm=[-1.2,1.2]", "volume.y_mm=[-1.2,1.2]"];
        folder.scene("demo", &[&keys[..], &sides, &bounds].concat());
        folder.run("lf-synth frames scene.json -o . -q");
        let on_frame = "-i frame-0000.exr -c camera.json";
        let prune = "lf-prune frame-0000.exr -c camera.json --depth -5,5 --pvr 2,2,20 -o support.lfv";
        check_memory(&folder, true, &[1, 2], &[prune]);
        let mart = format!("lf-mart support.lfv {on_frame} --iterations 2 -o volume.lfv --max-memory {MART_GB}");
        // On a hexagonal lattice this many voxels take minutes; scripts/studies/memory has them.
        if layout.ends_with("hexagonal") {
            continue;
        }
        check_memory(&folder, true, &[2], &[&format!("{mart} --basis blob"), &mart]);
        // Light that moves by an odd number of voxels is spread the most by the halves that deformation moves it.
        move_by_three(&folder, "volume.lfv", "moved.lfv");
        let xcorr = "lf-xcorr volume.lfv moved.lfv -o field.exr --window 48,48,16";
        check_memory(&folder, true, &[1, 2], &[xcorr]);
        check_memory(&folder, false, &[1, 2], &["lf-flow derive field.exr -o derived.exr"]);
    }
    // A voxel in every other slice of a deep grid: the score by depth is most of the memory.
    let grid = Grid { shape: [4, 4, 400_000], spacing_mm: [0.01; 3], origin_mm: [0.0; 3] };
    let indices: Vec<u64> = (0..200_000).map(|n| 32 * n).collect();
    folder.volume("deep.lfv", &grid, &indices, &[("intensity", &vec![1.5; indices.len()])]);
    let [quality, depth] = ["lf-validate quality deep.lfv deep.lfv", "lf-validate depth deep.lfv"];
    let drawn = [format!("{quality} --plot score.svg"), format!("{depth} --plot score.svg")];
    check_memory(&folder, false, &[1], &[quality, depth, &drawn[0], &drawn[1]]);
}

#[test]
fn the_memory_of_lf_fit_is_estimated() {
    let folder = Folder::new();
    let noise = r#"sensor_noise={"photon_noise": true, "read_noise_electrons": 3, "dark_counts": 20}"#;
    for (layout, threads) in [("square", 1), ("hexagonal", 2)] {
        let layout = format!("camera.microlenses.layout={layout}");
        let keys =
            [layout.as_str(), noise, "truth=null", "frames=1", "particles.rays=20000", "particles.per_lenslet=0.3"];
        let sides = ["camera.sensor.width=560", "camera.sensor.height=560", "volume.x_mm=[-1,1]", "volume.y_mm=[-1,1]"];
        folder.scene("demo", &[&keys[..], &sides].concat());
        folder.run("lf-synth frames scene.json -o . -q");
        folder.run("lf-synth dark scene.json -o dark.exr -q");
        let frame = "-c camera.json -b dark.exr -q";
        folder.run(&format!("lf-prune frame-0000.exr {frame} --depth -5,5 --pvr 2,2,20 -o support.lfv"));
        let fit = "lf-fit support.lfv -i frame-0000.exr -c camera.json -b dark.exr --particles found.csv";
        check_memory(&folder, true, &[threads], &[fit]);
    }
}

/// Scar: a voxel here and there in a huge grid. Workers of lf-mart held whole slices, and lists of lines and slices
/// counted nowhere.
#[test]
fn lists_of_lines_and_slices_count() {
    let samples = Samples::new();
    let spacing_mm = [0.0055, 0.0055, 1e-6];
    let grid = Grid { shape: [36, 36, 1 << 24], spacing_mm, origin_mm: [-0.096, -0.096, -0.19] };
    samples.volume("deep.lfv", &grid, &[0, 5, 1 << 28], &[("score", &[1.0, 2.0, 3.0])]);
    let mut camera = samples.json("camera.json");
    camera["microlenses"]["layout"] = json!("hexagonal");
    samples.write("hexagonal.json", camera.to_string());
    for camera in ["camera.json", "hexagonal.json"] {
        for words in ["", " --basis blob", " --method smart"] {
            let line = format!("lf-mart deep.lfv -i image.exr -c {camera} -o out.lfv --max-memory 0.1{words}");
            samples.call(&line).run().refused("wanted 0.1 GB at most, as --max-memory allows");
        }
    }
    let estimate =
        samples.run("lf-mart deep.lfv -i image.exr -c camera.json --estimate").json()["memory_bytes"].as_f64();
    assert!(estimate.unwrap() > 1e9);
}

#[test]
fn the_flat_field_of_a_camera_is_no_output() {
    let samples = Samples::new();
    let mut camera = samples.json("camera.json");
    camera["vignetting"] = json!("white.exr");
    samples.write("flat.json", camera.to_string());
    let white = samples.bytes("white.exr");
    for line in [
        "lf-prune image.exr -c flat.json --depth -0.2,0.2 -o white.exr",
        "lf-mart support.lfv -i image.exr -c flat.json -o white.exr",
        "lf-mart support.lfv -i image.exr -c flat.json -o out.lfv --log white.exr",
    ] {
        samples.call(line).run().refused("white.exr: is also an input");
        assert!(samples.bytes("white.exr") == white && !samples.path("out.lfv").exists());
    }
}

#[test]
fn starts_times_and_pictures_are_checked_before_the_work() {
    let samples = Samples::new();
    let grid = Grid { shape: [36, 36, 8], spacing_mm: [0.0055, 0.0055, 0.055], origin_mm: [-0.096, -0.096, -0.19] };
    samples.volume("start.lfv", &grid, &[0, 3], &[("intensity", &[1.0, -3.0])]);
    let mart = samples.call("lf-mart support.lfv -i image.exr -c camera.json -o out.lfv --start start.lfv");
    mart.run().refused("start.lfv: an intensity of -3; wanted intensities of 0 or more");
    for (time, is_sound) in [("1e-308", false), ("1e300", false), ("inf", false), ("0.001", true)] {
        let call = samples.call(&format!("lf-xcorr volume.lfv moved.lfv -q --dt {time} -o field-{is_sound}.csv"));
        if is_sound {
            drop(call.run().done())
        } else {
            drop(call.run().refused("wanted seconds, 1e-15 to 1e9"))
        };
    }
    assert!(!samples.path("field-false.csv").exists() && !samples.text("field-true.csv").contains("inf"));
    let names = samples.listing();
    for line in [
        format!("lf-mart {} -i image.exr -c camera.json -o out.lfv --log /proc/sweeps.jsonl", Kind::Support.file()),
        "lf-xcorr volume.lfv moved.lfv -o out.exr --plot /proc/field.svg".to_owned(),
        "lf-validate ensemble field.exr -o out.exr --plot /proc/mean.svg".to_owned(),
        "lf-validate depth volume.lfv --stats /proc/stats.json".to_owned(),
    ] {
        samples.call(&line).run().refused("/proc/");
        assert_eq!(samples.listing(), names, "{line}");
    }
}
