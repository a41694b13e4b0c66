//! Scenes as users write them: every effect, every output, and one line for each wrong key.

use lf_tests::{Call, Folder};
use std::collections::BTreeMap;

fn scene(name: &str, keys: &[&str]) -> Vec<u8> {
    let set = keys.iter().flat_map(|key| ["--set", key]);
    Call::new("lf-synth").words(["scene", name]).words(set).run().done().stdout
}

/// Keys for every effect in a small scene: a camera that bends and stops light, uneven particles, a sheet, two flows, a
/// noisy sensor.
const EVERYTHING: [&str; 17] = [
    "camera.sensor={\"width\": 280, \"height\": 252, \"pixel_pitch_mm\": 0.0055}",
    "camera.microlenses.layout=hexagonal",
    "camera.microlenses.rotation_rad=0.01",
    "camera.microlenses.gap_mm=0.61",
    "camera.tilt={\"x_rad\": 0.002, \"y_rad\": -0.001}",
    "camera.distortion={\"radial\": [3.0, 0.0, 0.0], \"tangential\": [0.01, 0.02]}",
    "diffraction.wavelength_mm=0.000532",
    "second_stop={\"distance_mm\": 60.0, \"diameter_mm\": 45.0}",
    "volume={\"x_mm\": [-0.5, 0.5], \"y_mm\": [-0.5, 0.5], \"z_mm\": [-5, 5]}",
    "flow=[{\"kind\": \"uniform\", \"displacement_mm\": [0.1, 0, 0]}, {\"kind\": \"rotation\", \"axis\": [0, 0, 1], \
        \"angle_rad\": 0.1}]",
    "frames=[0.0, 0.5]",
    "particles.sigma_px=null",
    "particles.diameter_px=2.0",
    "particles.rays=3000",
    "sensor_noise.dead_share=0.01",
    "sensor_noise.hot_share=0.01",
    "truth.vectors=[3, 3, 3]",
];

fn rendered(task: &str, scene: &[u8], threads: &str, more: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let folder = Folder::new();
    let output = if ["white", "dark"].contains(&task) { folder.path("image.tif") } else { folder.root().into() };
    let call = Call::new("lf-synth").words([task, "-", "--quiet", "--threads", threads]).words(more);
    call.word("-o").word(output).pipe(scene.to_vec()).run().done();
    folder.files(".")
}

/// Every task with every effect writes all its files, with the same bytes for any number of threads.
#[test]
fn everything_at_once_has_the_same_bytes_for_any_number_of_threads() {
    let text = scene("tank", &EVERYTHING);
    for (task, more, names) in [
        (
            "frames",
            &["--format", "tiff"][..],
            &[
                "camera.json",
                "flow.exr",
                "frame-0000.tif",
                "frame-0001.tif",
                "particles.csv",
                "scene-used.json",
                "truth-0000.lfv",
                "truth-0001.lfv",
            ][..],
        ),
        ("white", &[][..], &["image.tif"][..]),
        ("dark", &[][..], &["image.tif"][..]),
    ] {
        let one = rendered(task, &text, "1", more);
        assert_eq!(one.keys().collect::<Vec<_>>(), names, "{task}");
        for threads in ["2", "5"] {
            assert!(rendered(task, &text, threads, more) == one, "{task} with {threads} threads");
        }
    }
}

#[test]
fn coherent_light_has_the_same_bytes_for_any_number_of_threads() {
    let few = ["coherent_light=true", "particles.per_lenslet=null", "particles.count=5", "truth=null"];
    let text = scene("tank", &[&EVERYTHING[..EVERYTHING.len() - 1], &few].concat());
    let one = rendered("frames", &text, "1", &[]);
    assert!(rendered("frames", &text, "3", &[]) == one);
    let text = scene("tank", &[&EVERYTHING[..EVERYTHING.len() - 1], &few[1..]].concat());
    assert!(rendered("frames", &text, "3", &[])["frame-0000.exr"] != one["frame-0000.exr"]);
}

/// `scene-used.json` renders the same frames again, from another folder.
#[test]
fn the_scene_as_used_renders_the_same_again() {
    let first = rendered("frames", &scene("tank", &EVERYTHING), "0", &["--seed", "5"]);
    let again = rendered("frames", &first["scene-used.json"], "0", &[]);
    assert!(first == again);
}

#[test]
fn dots_are_stepped_through_their_depths() {
    let keys = ["dots.depths_mm=[-1.5, 2]", "dots.half_size_mm=[1.2, 0.1]", "particles.rays=2000"];
    let made = rendered("dots", &scene("target", &keys), "0", &[]);
    let names: Vec<&str> = made.keys().map(String::as_str).collect();
    assert_eq!(names, ["camera.json", "dots-0000.exr", "dots-0001.exr", "dots.csv", "scene-used.json"]);
    let table = String::from_utf8(made["dots.csv"].clone()).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 2 + 2 * 3, "{table}");
    assert_eq!(lines[2], "0,0,-1.1000000,0.0000000,-1.5000000,500000");
    assert_eq!(lines[7], "1,2,1.1000000,0.0000000,2.0000000,500000");
}

/// A table of tracks gives the particles of the wanted frames, and no flow.exr.
#[test]
fn tracks_are_followed() {
    let folder = Folder::new();
    let table = "# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n\
                 0,4,0.1,0.2,0.3,500\n0,9,0.1,0.0,0.3,500\n1,4,0.2,0.2,0.3,500\n\
                 2,4,0.3,0.2,0.3,400\n";
    folder.write("tracks.csv", table);
    let text = scene(
        "core",
        &[
            "flow={\"kind\": \"tracks\", \"path\": \"tracks.csv\"}",
            "particles.per_lenslet=null",
            "particles.rays=1000",
            "frames=[0, 2]",
        ],
    );
    folder.write("scene.json", text);
    folder.run("lf-synth frames scene.json -o made");
    let made = folder.files("made");
    assert!(!made.contains_key("flow.exr"));
    let shown = String::from_utf8(made["particles.csv"].clone()).unwrap();
    let lines: Vec<&str> = shown.lines().collect();
    assert_eq!(lines.len(), 5, "{shown}");
    assert!(lines[4].starts_with("1,4,0.3"), "{shown}");
    // Nothing replaces the flow of a run before.
    folder.write("made/flow.exr", "old");
    let said = folder.run("lf-synth frames scene.json -o made").stderr;
    assert!(said.contains("warning: made/flow.exr: of another run"), "{said}");
}

/// A flow.exr written by lf-synth moves particles like the flow itself, within the interpolation between its vectors.
#[test]
fn a_written_flow_can_be_followed() {
    let folder = Folder::new();
    let (small, coarse) =
        ("volume={\"x_mm\": [-0.4, 0.4], \"y_mm\": [-0.4, 0.4], \"z_mm\": [-5, 5]}", "particles.rays=1000");
    let shear = "flow={\"kind\": \"shear\", \"along\": \"x\", \"across\": \"z\", \"rate\": 0.01}";
    let places = |flow: &str, name: &str| {
        folder.scene("core", &[small, coarse, flow, "frames=2"]);
        folder.run(&format!("lf-synth frames scene.json -o {name}"));
        let table = folder.text(format!("{name}/particles.csv"));
        let number = |text: &str| text.parse::<f64>().unwrap();
        table.lines().skip(2).map(|line| line.split(',').map(number).collect()).collect::<Vec<Vec<f64>>>()
    };
    let written = places(shear, "written");
    let followed = places("flow={\"kind\": \"sampled\", \"path\": \"written/flow.exr\"}", "followed");
    assert!(written.len() > 10 && written.len() == followed.len());
    for (a, b) in written.iter().zip(&followed) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }
}

#[test]
fn no_particles_are_black_frames() {
    let made = rendered("frames", &scene("core", &["particles.per_lenslet=0"]), "0", &[]);
    let stack = lf_core::image::Stack::from_bytes(made["frame-0000.exr"].clone().into(), "frame").unwrap();
    let image = stack.only(None).unwrap();
    assert!(image.pixels.iter().all(|pixel| *pixel == 0.0));
    assert_eq!(made["particles.csv"].iter().filter(|byte| **byte == b'\n').count(), 2);
}

/// A scene without `truth` gets none.
#[test]
fn without_a_truth_none_is_written() {
    let made = rendered("frames", &scene("core", &["truth=null", "particles.rays=100"]), "0", &[]);
    let names: Vec<&str> = made.keys().map(String::as_str).collect();
    assert_eq!(names, ["camera.json", "frame-0000.exr", "particles.csv", "scene-used.json"]);
}

#[test]
fn bad_scenes_are_refused_by_name() {
    let background = Folder::new();
    let other = background.image("light.exr", &ndarray::Array2::zeros((4, 6)));
    let light = format!("sensor_noise.background={:?}", other.display().to_string());
    for (name, key, named) in [
        ("core", "wind=1", "wind"),
        ("core", "camera.main_lens.magnification=-1", "magnification"),
        ("core", "volume.z_mm=[-5, 250]", "focal length"),
        ("core", "volume.x_mm=[1, -1]", "x_mm"),
        ("tank", "volume.z_mm=[-5, 190]", "wet face"),
        ("tank", "camera.medium.window_z_mm=900", "wanted air between the window and the main lens"),
        ("core", "camera.tilt={\"x_rad\": 0.3, \"y_rad\": 0}", "tilt"),
        ("core", "camera.vignetting=\"flat.exr\"", "vignetting"),
        ("core", "camera.centres={\"radius_mm\": 1, \"x_mm\": [1, 0], \"y_mm\": [0]}", "centres"),
        ("core", "particles.per_lenslet=1000", "per_lenslet"),
        ("core", "particles.per_lenslet=null", "per_lenslet"),
        ("core", "particles.diameter_px=3", "diameter_px"),
        ("core", "particles.ray_noise=0.1", "ray_noise"),
        ("core", "particles.intensity_spread=-1", "intensity_spread"),
        ("core", "light={\"profile\": \"top-hat\", \"thickness_mm\": 0}", "thickness_mm"),
        ("core", "diffraction.wavelength_mm=532", "wavelength_mm"),
        ("core", "coherent_light=true", "wavelength"),
        ("core", "second_stop={\"distance_mm\": 500, \"diameter_mm\": 3}", "distance_mm"),
        ("core", "flow={\"kind\": \"swirl\"}", "swirl"),
        ("core", "flow={\"kind\": \"tracks\", \"path\": \"there.csv\"}", "tracks"),
        ("core", "flow={\"kind\": \"sampled\", \"path\": \"there.exr\"}", "there.exr"),
        ("uniform", "flow={\"kind\": \"uniform\", \"displacement_mm\": [1e6, 0, 0]}", "flow into"),
        ("core", "frames=[1, 1]", "frames"),
        ("core", "frames=0", "frames"),
        ("core", "sensor_noise.bits=20", "bits"),
        ("core", light.as_str(), "light.exr"),
        ("target", "dots.depths_mm=[300]", "depths_mm"),
        ("target", "dots.spacing_mm=1e-4", "dots"),
    ] {
        // An invalid scene is not even printed.
        let printed = Call::new("lf-synth").words(["scene", name, "--set", key]).run();
        if !printed.status.success() {
            printed.refused(named);
            continue;
        }
        let folder = Folder::new();
        let output = folder.path("made");
        let task = if name == "target" { "dots" } else { "frames" };
        let call = Call::new("lf-synth").words([task, "-", "-o"]).word(&output);
        call.pipe(printed.stdout).run().refused(named);
        assert!(!output.exists(), "{key} left something behind");
    }
    let crowd = scene("core", &["particles.per_lenslet=null", "particles.count=50000000"]);
    let call = Call::new("lf-synth").words(["frames", "-", "--max-memory", "1", "-o", "nowhere"]);
    call.pipe(crowd).run().refused("GB");
    Call::new("lf-synth").words(["dots", "-", "-o", "nowhere"]).pipe(scene("core", &[])).run().refused("dots");
}

/// A volume that the sensor does not see whole is rendered with a warning.
#[test]
fn a_volume_outside_the_view_is_warned_of() {
    let folder = Folder::new();
    let text =
        scene("core", &["volume.x_mm=[-3, 3]", "truth=null", "particles.rays=100", "particles.per_lenslet=0.01"]);
    let ended = Call::new("lf-synth").words(["frames", "-", "-o"]).word(folder.root()).pipe(text).run().done();
    assert!(ended.stderr.contains("51.2 %") && ended.stderr.lines().count() == 1, "{}", ended.stderr);
}

/// The measured noise is at most the wanted noise.
#[test]
fn the_wanted_ray_noise_is_kept() {
    for (noise, most) in [("0.02", 2.0), ("0.005", 0.5)] {
        let keys = ["particles.rays=null", &format!("particles.ray_noise={noise}"), "truth=null"];
        let folder = Folder::new();
        let call = Call::new("lf-synth").words(["frames", "-", "--measure-noise", "-o"]).word(folder.root());
        let ended = call.pipe(scene("core", &keys)).run().done();
        let words = ended.stderr.split_once("ray noise ").expect("it is said").1;
        let measured: f64 = words.split_once(" %").unwrap().0.parse().unwrap();
        assert!(measured > 0.4 * most && measured <= most, "{measured} % for {noise}");
    }
}
