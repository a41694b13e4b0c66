//! The support of a rendered scene, refusals, and the same bytes for any number of threads.

use lf_core::{Volume, image};
use lf_tests::{Call, Workbench};

const CALL: &str = "scene/frame-0000.exr -c scene/camera.json --pvr 2,2,20 --depth -5,5";

const SIDE: [&str; 4] =
    ["camera.sensor.width=308", "camera.sensor.height=308", "volume.x_mm=[-0.385,0.385]", "volume.y_mm=[-0.385,0.385]"];

/// A frame of a small scene.
fn bench() -> Workbench {
    bench_of("0.3")
}

fn bench_of(per_lenslet: &str) -> Workbench {
    let density = format!("particles.per_lenslet={per_lenslet}");
    rendered("demo", &[&SIDE[..], &["particles.rays=20000", &density]].concat())
}

/// A frame of a ready scene with other keys.
fn rendered(name: &str, keys: &[&str]) -> Workbench {
    let bench = Workbench::new(env!("CARGO_BIN_EXE_lf-prune"));
    bench.scene(name, &[keys, &["frames=1"]].concat());
    Call::new("lf-synth").within(bench.root()).words(["frames", "scene.json", "-o", "scene"]).run().done();
    bench
}

#[test]
fn a_scene_is_pruned_to_the_voxels_of_its_particles() {
    let bench = bench();
    bench.done(&format!("{CALL} --truth scene/particles.csv --stats stats.json -o support.lfv -q"));
    let stats = bench.json("stats.json");
    let counts = &stats["counts"];
    let volume = Volume::open(&bench.path("support.lfv")).unwrap();
    let grid = volume.grid();
    // A pixel is 0.0055 mm, and the magnification of the scene is 1.
    assert_eq!(grid.spacing_mm.map(|side| (1e6 * side).round() * 1e-6), [0.011, 0.011, 0.11]);
    assert_eq!(counts["voxels"], grid.len());
    assert_eq!(counts["lost_particles"], 0);
    assert!(counts["particles"].as_u64().unwrap() > 10, "{counts}");
    let (kept, all) = (counts["kept"].as_u64().unwrap(), grid.len());
    assert!(kept > 4000 && kept < all / 150, "{kept} of {all}");
    // Keep all voxels that can be seen.
    bench.done(&format!("{CALL} --keep-all --stats stats.json -o whole.lfv -q"));
    let seen = bench.json("stats.json")["counts"]["kept"].as_u64().unwrap();
    assert!(seen > all / 10 * 9, "{seen} of {all}");
    // Compare with the estimate from a few slices.
    let estimate = bench.done(&format!("{CALL} --estimate")).json();
    let expected = estimate["kept"].as_f64().unwrap();
    assert!((expected / kept as f64 - 1.0).abs() < 0.4, "{expected} expected, {kept} kept");
}

/// A particle a hundred times as bright as the others takes none of them away. A volume that is too shallow is warned
/// of, a good one is not.
#[test]
fn a_bright_particle_hides_no_faint_ones() {
    let bench = bench_of("0.06");
    let faint = image::open(&bench.path("scene/frame-0000.exr")).unwrap();
    bench.scene("demo", &["seed=9", "frames=1", "particles.per_lenslet=0.003", SIDE[0], SIDE[1], SIDE[2], SIDE[3]]);
    Call::new("lf-synth").within(bench.root()).words(["frames", "scene.json", "-o", "bright"]).run().done();
    let bright = image::open(&bench.path("bright/frame-0000.exr")).unwrap();
    let both = &faint.pixels + &(100.0 * &bright.pixels);
    image::save(&bench.path("both.exr"), &both, &faint.history).unwrap();
    let words = "-c scene/camera.json --pvr 2,2,20 --truth scene/particles.csv --stats stats.json -o support.lfv";
    let found = bench.done(&format!("both.exr {words} --depth -5,5"));
    assert!(!found.stderr.contains("warning"), "{}", found.stderr);
    let counts = &bench.json("stats.json")["counts"];
    assert!(counts["particles"].as_u64().unwrap() > 2 && counts["lost_particles"] == 0, "{counts}");
    assert!(counts["explained_light"].as_f64().unwrap() > 0.98, "{counts}");
    let shallow = bench.done(&format!("scene/frame-0000.exr {words} --depth 0,5"));
    assert!(shallow.stderr.contains("seen by no kept voxel"), "{}", shallow.stderr);
}

/// Scar: of 54 particles, the logarithms of whose light have a standard deviation of 2, 8 were lost.
#[test]
fn particles_of_mixed_light_stay() {
    let keys = [
        "camera.sensor.width=476",
        "camera.sensor.height=420",
        "volume.x_mm=[-0.5,0.5]",
        "volume.y_mm=[-0.4,0.4]",
        "camera.blur={\"wavelength_nm\": 532, \"sigma_px\": 0.3}",
        "sensor_noise={\"photon_noise\": true, \"read_noise_electrons\": 3}",
        "particles.per_lenslet=0.4",
        "particles.intensity_spread=2",
        "particles.rays=30000",
        "seed=10",
    ];
    let bench = rendered("core", &keys);
    bench.done(&format!("{CALL} --truth scene/particles.csv --stats stats.json -o support.lfv -q"));
    let counts = &bench.json("stats.json")["counts"];
    assert!(counts["particles"] == 54 && counts["lost_particles"].as_u64().unwrap() <= 1, "{counts}");
    assert!(counts["kept"].as_f64().unwrap() < 0.1 * counts["voxels"].as_f64().unwrap(), "{counts}");
}

/// Noise of a sensor whose offset was subtracted: half of the dark pixels are below zero. Few particles are usual light
/// all the same, and all light above the noise is theirs.
#[test]
fn noise_about_zero_is_no_light() {
    let noise = r#"sensor_noise={"photon_noise": true, "gain_counts_per_electron": 0.5, "read_noise_electrons": 3,
        "dark_counts": 40}"#;
    let bench = rendered("demo", &[&SIDE[..], &["particles.per_lenslet=0.02", noise]].concat());
    let mut frame = image::open(&bench.path("scene/frame-0000.exr")).unwrap();
    frame.pixels.fill(40.0);
    image::save(&bench.path("dark.exr"), &frame.pixels, &frame.history).unwrap();
    let found =
        bench.done(&format!("{CALL} -b dark.exr --truth scene/particles.csv --stats stats.json -o support.lfv"));
    assert!(!found.stderr.contains("warning"), "{}", found.stderr);
    let counts = &bench.json("stats.json")["counts"];
    assert!(counts["particles"].as_u64().unwrap() > 1 && counts["lost_particles"] == 0, "{counts}");
    assert!(counts["explained_light"].as_f64().unwrap() > 0.98, "{counts}");
}

/// A bright reflection under the mask changes nothing, and its voxels are judged by what other pixels see of them.
/// Without the mask it changes the support.
#[test]
fn a_masked_reflection_changes_nothing() {
    let bench = bench();
    bench.reflection("scene/frame-0000.exr");
    let words = "-c scene/camera.json --pvr 2,2,20 --depth -5,5 --truth scene/particles.csv --stats stats.json";
    for (frame, support) in [("scene/frame-0000.exr", "one.lfv"), ("bright.exr", "two.lfv")] {
        let said = bench.done(&format!("{frame} {words} --mask mask.exr -o {support}")).stderr;
        assert!(!said.contains("warning") && bench.json("stats.json")["counts"]["lost_particles"] == 0, "{said}");
    }
    assert!(bench.bytes("one.lfv") == bench.bytes("two.lfv"));
    bench.done(&format!("bright.exr {words} -o three.lfv"));
    assert!(bench.bytes("one.lfv") != bench.bytes("three.lfv"));
    bench.image("small.exr", &ndarray::Array2::ones((308, 300)));
    bench.image("black.exr", &ndarray::Array2::zeros((308, 308)));
    bench
        .refused(&format!("{CALL} --mask small.exr"), &["small.exr: mask of 300 x 308 px; wanted the 308 x 308 px of"]);
    bench.refused(&format!("{CALL} --mask black.exr"), &["black.exr: all pixels are 0; wanted pixels that are used"]);
    bench.refused(&format!("{CALL} --mask mask.exr -o mask.exr"), &["mask.exr", "is also an input"]);
}

#[test]
fn calls_without_a_sense_are_refused() {
    let bench = bench();
    let refused = |words: &str, message: &str| bench.refused(&format!("{CALL} {words} -o out.lfv"), &[message]);
    refused("--bounds 1,0,0,1", "--bounds: 1,0,0,1; wanted the lower number of each side first");
    refused("--threshold 2", "--threshold: 2; wanted a share, 0 to 1");
    refused("--sections 1", "--sections: 1; wanted 2 to 64");
    refused("--tile 5/4", "--tile");
    refused("-b scene/camera.json", "scene/camera.json");
    bench.refused(&format!("{CALL} -o scene/camera.json"), &["scene/camera.json"]);
    bench.refused("scene/frame-0000.exr -c scene/frame-0000.exr --depth -5,5 -o out.lfv", &["frame-0000.exr"]);
    refused("-b scene/frame-0000.exr", "no voxel survives pruning: the image is black");
    assert!(!bench.path("out.lfv").exists(), "a refusal leaves no file");
}

#[test]
fn threads_and_pipes_change_no_byte() {
    let bench = bench();
    for words in ["", "--tile 2/4", "--score quantile --sections 7"] {
        let run = |threads: u32, output: &str| bench.done(&format!("{CALL} {words} --threads {threads} -q {output}"));
        let one = run(1, "").stdout;
        assert!(one.len() > 10_000, "{words}: {} bytes", one.len());
        assert!(run(4, "").stdout == one, "{words}");
        run(4, "-o support.lfv");
        assert!(bench.bytes("support.lfv") == one, "{words}");
    }
}
