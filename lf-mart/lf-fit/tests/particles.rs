//! Particles found again, refusals, and the same bytes for any number of threads.

use lf_core::camera::{LensletPattern, SensorNoise, Tilt};
use lf_core::lattice::Centres;
use lf_core::particles::{self, Particle};
use lf_core::statistics::upper_median;
use lf_core::{Camera, Volume, image};
use lf_tests::Workbench;

const CALL: &str = "scene/truth-0000.lfv -i scene/frame-0000.exr -c scene/camera.json";

/// A small scene by rays. Its truth stands for a reconstruction: the fit begins at the maxima of its voxels.
fn bench(keys: &[&str]) -> Workbench {
    let bench = Workbench::new(env!("CARGO_BIN_EXE_lf-fit"));
    let small = [
        "camera.sensor.width=476",
        "camera.sensor.height=420",
        "volume.x_mm=[-0.5,0.5]",
        "volume.y_mm=[-0.4,0.4]",
        "particles.per_lenslet=0.4",
        "particles.rays=60000",
        "truth.pixels_per_voxel=[2,2,10]",
        "seed=2",
    ];
    let keys: Vec<&str> = small.iter().chain(keys).copied().collect();
    bench.scene("core", &keys);
    bench.folder_run("lf-synth frames scene.json -o scene");
    bench
}

/// Runs a line in the folder of a bench.
trait FolderRun {
    fn folder_run(&self, line: &str);
}

impl FolderRun for Workbench {
    fn folder_run(&self, line: &str) {
        std::ops::Deref::deref(self).run(line);
    }
}

fn table(bench: &Workbench, name: &str) -> Vec<Particle> {
    particles::read(&bench.text(name)).unwrap()
}

/// Errors and standard uncertainties of the particles found at the true ones: within 1.5 pixels, or three times the
/// uncertainty if that is more, but without the part of a lenslet's cone that it states in depth in focus, and near it
/// for the shape of particles. Each is found at one true particle, so that two that look like one count once.
fn matched(truth: &[Particle], found: &[Particle]) -> Vec<([f64; 3], [f64; 3])> {
    let mut free: Vec<&Particle> = found.iter().collect();
    let near = |particle: &Particle| {
        let off_and_std = |other: &Particle| {
            let std = other.uncertainty.unwrap().std_mm().to_array();
            let off: [f64; 3] = std::array::from_fn(|k| other.place_mm[k] - particle.place_mm[k]);
            let cone = match other.place_mm[2].abs() {
                ..0.033 => f64::INFINITY,
                ..0.3388 => 0.04 * 0.308,
                _ => 0.0,
            };
            let most = |k: usize| 3.0 * (std[k].powi(2) - if k == 2 { cone * cone } else { 0.0 }).max(0.0).sqrt();
            (0..3).all(|k| off[k].abs() < f64::max(1.5 * 0.0055, most(k))).then_some((off, std))
        };
        let at = free.iter().position(|other| off_and_std(other).is_some())?;
        off_and_std(free.swap_remove(at))
    };
    truth.iter().filter_map(near).collect()
}

/// Both stops and both lattices: nearly all particles are found, none too many, and the errors are what is stated.
#[test]
fn particles_of_a_scene_are_found_to_their_stated_uncertainty() {
    for keys in [
        &[][..],
        &[
            "camera.microlenses.layout=\"hexagonal\"",
            "camera.microlenses.rotation_rad=0.003",
            "camera.main_lens.aperture=\"circle\"",
        ],
    ] {
        let bench = bench(keys);
        let said = bench.done(&format!("{CALL} --particles found.csv -o drawn.lfv --stats stats.json --log log.jsonl"));
        assert!(said.stderr.is_empty(), "{}", said.stderr);
        let (truth, found) = (table(&bench, "scene/particles.csv"), table(&bench, "found.csv"));
        let pairs = matched(&truth, &found);
        let share = pairs.len() as f64 / truth.len() as f64;
        assert!(share >= 0.95 && found.len() as f64 <= 1.03 * truth.len() as f64, "{share} {}", found.len());
        // Depths of particles that are not blind: their errors against the uncertainties.
        let known: Vec<f64> =
            pairs.iter().filter(|(_, std)| std[2] < 0.01).map(|(off, std)| (off[2] / std[2]).abs()).collect();
        let within = known.iter().filter(|off| **off < 1.0).count() as f64 / known.len() as f64;
        assert!(known.len() > truth.len() / 2 && (0.5..0.9).contains(&within), "{within} of {}", known.len());
        let stats = bench.json("stats.json");
        assert!((stats["counts"]["size_px"].as_f64().unwrap() - 0.75).abs() < 0.02, "{stats}");
        assert_eq!(stats["counts"]["size_spread"], 0.0);
        assert_eq!(bench.text("log.jsonl").lines().next().unwrap().chars().next(), Some('{'));
        let drawn = Volume::open(&bench.path("drawn.lfv")).unwrap();
        let light: f64 = drawn.column("intensity").unwrap().iter().map(|value| f64::from(*value)).sum();
        let all: f64 = found.iter().map(|particle| particle.intensity).sum();
        assert!((light / all - 1.0).abs() < 0.02, "{light} of {all}");
    }
}

/// Particles that differ in size by a fifth: with one size for all, more of them are lost. One scene has only 54.
#[test]
fn sizes_that_differ_are_found_and_make_no_ghosts() {
    let blur = "camera.blur={\"wavelength_nm\": 532, \"sigma_px\": 0.3}";
    let noise = "sensor_noise={\"photon_noise\": true}";
    let call = format!("{CALL} --particles found.csv --stats stats.json");
    // Particles that are there, are matched and are found, without sizes of their own and with them.
    let mut sums = [[0; 3]; 2];
    for seed in ["seed=2", "seed=3", "seed=4"] {
        let bench = bench(&[blur, noise, "particles.rays=400000", "particles.size_spread=0.2", seed]);
        let truth = table(&bench, "scene/particles.csv");
        for (words, sum) in ["--hold sizes", ""].into_iter().zip(&mut sums) {
            bench.done(&format!("{call} {words}"));
            let found = table(&bench, "found.csv");
            let counts = [truth.len(), matched(&truth, &found).len(), found.len()];
            sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
            let spread = bench.json("stats.json")["counts"]["size_spread"].as_f64().unwrap();
            let is_right = if words.is_empty() { (spread - 0.2).abs() < 0.1 } else { spread == 0.0 };
            assert!(is_right, "{seed} {spread}");
        }
        if seed == "seed=2" {
            // The usual size may be held beside sizes that differ.
            bench.done(&format!("{call} --hold size --size 0.8"));
            let counts = &bench.json("stats.json")["counts"];
            assert!(counts["size_px"] == 0.8 && counts["size_spread"].as_f64() > Some(0.1), "{counts}");
        }
    }
    let [held, own] = sums.map(|[all, matched, found]| [matched, found].map(|count| count as f64 / all as f64));
    assert!(own[0] >= 0.97 && own[1] <= 1.02, "{own:?}");
    assert!(held[0] < 0.95, "{held:?}");
}

/// The lattice of the camera is off by a fifth of a pixel: the fit finds it, says so and writes the right camera.
#[test]
fn a_drift_is_found_said_and_written() {
    let bench = bench(&[]);
    let mut camera = Camera::open(&bench.path("scene/camera.json")).unwrap();
    camera.microlenses.offset_mm = [0.0011, -0.0005];
    bench.write("off.json", camera.to_json());
    let call = "scene/truth-0000.lfv -i scene/frame-0000.exr -c off.json --particles found.csv --camera-out right.json";
    let said = bench.done(call).stderr;
    assert!(said.contains("warning: the lattice has drifted by (-0.2"), "{said}");
    let [x, y] = Camera::open(&bench.path("right.json")).unwrap().microlenses.offset_mm;
    assert!(x.abs() < 3e-5 && y.abs() < 3e-5, "{x} {y}");
    let held = bench.done(&format!("{call} --hold drift")).stderr;
    assert!(!held.contains("drifted") && held.contains("noise does not explain the image"), "{held}");
}

/// A lattice too wide by 0.02 %, turned by 0.2 mrad and bent by 0.2 px, and a tilted sensor: `lf-calib refine` corrects
/// them by the evidence of the frame, and leaves the true camera as it is.
#[test]
fn the_evidence_of_a_frame_corrects_the_camera() {
    let bench = bench(&["particles.per_lenslet=0.2", "camera.blur={\"wavelength_nm\": 532, \"sigma_px\": 0.3}"]);
    let truth = Camera::open(&bench.path("scene/camera.json")).unwrap();
    let mut off = truth.clone();
    off.microlenses.pitch_mm *= 1.0002;
    off.microlenses.rotation_rad += 2e-4;
    off.tilt = Some(Tilt { x_rad: 2e-3, y_rad: 0.0 });
    let mm = 0.2 * truth.sensor.pixel_pitch_mm;
    off.centres = Some(Centres { radius_mm: 238.0 * 0.0055, x_mm: vec![0.0, 0.0, mm, 0.0, 0.0], y_mm: vec![0.0; 5] });
    bench.write("off.json", off.to_json());
    let refined = |camera: &str| {
        let call = format!("scene/truth-0000.lfv -i scene/frame-0000.exr -c {camera} --particles found.csv");
        bench.done(&format!("{call} --evidence evidence.json"));
        bench.folder_run(&format!("lf-calib refine evidence.json -c {camera} -o refined.json"));
        Camera::open(&bench.path("refined.json")).unwrap()
    };

    // Lenslets from the middle to a corner lie where they are.
    let found = refined("off.json");
    for place in [(0, 0), (10, 0), (-12, 8), (14, 14)] {
        let [there, wanted, before] = [&found, &truth, &off].map(|camera| camera.lattice().centre_mm(place.0, place.1));
        let [left, given] = [there, before].map(|centre| centre.distance(wanted) / truth.sensor.pixel_pitch_mm);
        assert!(left < 0.02, "{place:?}: {left} px, {given} before");
    }
    let tilt = found.tilt.clone().unwrap();
    assert!(tilt.x_rad.abs() < 2e-4 && tilt.y_rad.abs() < 2e-4, "{tilt:?}");
    let f_number = found.main_lens.working_f_number / truth.main_lens.working_f_number;
    assert!((f_number - 1.0).abs() < 5e-4, "{f_number}");

    let same = refined("scene/camera.json");
    assert_eq!((&same.microlenses, &same.main_lens, &same.tilt), (&truth.microlenses, &truth.main_lens, &truth.tilt));
    assert!(bench.run("a.lfv b.lfv -i a.exr -i b.exr -c a.json -c b.json --evidence e.json").status.code() == Some(2));
}

/// A bright reflection under the mask changes nothing, and most particles behind it are found by other lenslets.
#[test]
fn a_masked_reflection_changes_nothing() {
    let bench = bench(&[]);
    bench.reflection("scene/frame-0000.exr");
    for (frame, table) in [("scene/frame-0000.exr", "one.csv"), ("bright.exr", "two.csv")] {
        let words = format!("scene/truth-0000.lfv -i {frame} -c scene/camera.json --mask mask.exr --particles {table}");
        assert_eq!(bench.done(&words).stderr, "");
    }
    assert!(bench.bytes("one.csv") == bench.bytes("two.csv"));
    let (truth, found) = (table(&bench, "scene/particles.csv"), table(&bench, "one.csv"));
    let share = matched(&truth, &found).len() as f64 / truth.len() as f64;
    assert!(share > 0.85 && found.len() <= truth.len(), "{share}, {} of {}", found.len(), truth.len());
    bench.refused(&format!("{CALL} --mask mask.exr --mask mask.exr"), &["--mask: given 2 times; wanted one mask"]);
}

/// A thin volume is fitted in 4 x 2 tiles of 210 x 210 pixels. Particles at their borders are found once.
#[test]
fn bytes_do_not_depend_on_threads_or_pipes_and_tiles_meet() {
    let bench = bench(&[
        "particles.per_lenslet=0.15",
        "camera.sensor.width=840",
        "volume.x_mm=[-1.6,1.6]",
        "volume.z_mm=[-0.5,0.5]",
    ]);
    bench.done(&format!("{CALL} --particles one.csv --threads 1"));
    let wanted = bench.bytes("one.csv");
    for threads in ["2", "4"] {
        bench.done(&format!("{CALL} --particles more.csv --threads {threads}"));
        assert!(bench.bytes("more.csv") == wanted, "{threads} threads");
    }
    let volume = bench.bytes("scene/truth-0000.lfv");
    let piped = bench.feed("-i scene/frame-0000.exr -c scene/camera.json", volume).done();
    assert!(piped.stdout == wanted);
    let is_at_border = |particle: &Particle| {
        let tile_mm = 210.0 * 0.0055;
        let off = |mm: f64| (mm / tile_mm - (mm / tile_mm).round()).abs() * tile_mm;
        off(particle.place_mm[0]).min(off(particle.place_mm[1])) < 0.08
    };
    let at_border = |name: &str| -> Vec<Particle> {
        table(&bench, name).into_iter().filter(|particle| particle.frame == 0 && is_at_border(particle)).collect()
    };
    let (truth, found) = (at_border("scene/particles.csv"), at_border("one.csv"));
    let share = matched(&truth, &table(&bench, "one.csv")).len() as f64 / truth.len() as f64;
    assert!(truth.len() > 20 && share >= 0.9, "{share} of {}", truth.len());
    assert!(found.len() <= truth.len() + truth.len() / 10, "{} for {}", found.len(), truth.len());
}

#[test]
fn bad_input_is_refused_in_one_line() {
    let bench = bench(&["particles.per_lenslet=0.1"]);
    let refused = |words: &str, named: &[&str]| {
        bench.refused(words, named);
        assert!(!bench.path("p.csv").exists(), "{words} leaves a table");
    };
    let call = |more: &str| format!("{CALL} --particles p.csv {more}");
    refused(&call("--size 0"), &["--size: 0; wanted 0.15 to 5"]);
    refused(&call("--gain -1"), &["--gain"]);
    refused(&call("-o -  --log -"), &["standard output"]);
    refused(&call("-o scene/truth-0000.lfv"), &["truth-0000.lfv", "is also an input"]);
    refused("scene/truth-0000.lfv -i scene/frame-0000.exr -c no.json --particles p.csv", &["no.json"]);
    refused("scene/frame-0000.exr -i scene/frame-0000.exr -c scene/camera.json --particles p.csv", &["frame-0000.exr"]);
    // Without light there is nothing to fit.
    bench.image("dark.exr", &ndarray::Array2::zeros((420, 476)));
    refused(
        "scene/truth-0000.lfv -i dark.exr -c scene/camera.json --particles p.csv",
        &["dark.exr: no pixel has light"],
    );
    let dull = std::fs::read_to_string(bench.path("scene/camera.json")).unwrap();
    let dull: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&dull).unwrap();
    let dull: serde_json::Value = dull.into_iter().chain([("vignetting".to_owned(), "flat.exr".into())]).collect();
    std::fs::write(bench.path("flat.json"), dull.to_string()).unwrap();
    bench.image("flat.exr", &ndarray::Array2::ones((420, 476)));
    let over = "scene/truth-0000.lfv -i scene/frame-0000.exr -c flat.json --particles flat.exr";
    refused(over, &["flat.exr", "input"]);
    let limited = ["truth-0000.lfv: a fit to ", " would take about ", "wanted 0.01 GB at most, as --max-memory allows"];
    refused(&call("--max-memory 0.01"), &limited);
}

#[test]
fn memory_is_estimated() {
    let bench = bench(&[]);
    let estimate = bench.done(&format!("{CALL} --estimate")).stdout;
    let estimated: serde_json::Value = serde_json::from_slice(&estimate).unwrap();
    bench.done(&format!("{CALL} --particles found.csv --stats stats.json"));
    let peak = bench.json("stats.json")["peak_bytes"].as_f64().unwrap();
    let ratio = estimated["memory_bytes"].as_f64().unwrap() / peak;
    assert!((0.95..2.0).contains(&ratio), "{estimated} for {peak}");
}

/// The scene, and the same particles before a camera at 90 degrees; volumes of both by lf-prune and lf-mart.
fn two_cameras() -> Workbench {
    let keys = ["volume.z_mm=[-0.6,0.6]", "truth=null", "particles.per_lenslet=0.5"];
    let bench = bench(&keys);
    let scene = bench.text("scene.json");
    let mut scene: serde_json::Value = serde_json::from_str(&scene).unwrap();
    // Its focal plane stands beside the volume.
    scene["camera"]["pose"] = serde_json::json!({"rotation": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        "translation_mm": [0, 0, 1.0]});
    bench.write("aside.json", scene.to_string());
    bench.folder_run("lf-synth frames aside.json -o aside");
    for (camera, depth) in [("scene", "-0.6,0.6"), ("aside", "0.4,1.6")] {
        bench.folder_run(&format!(
            "lf-prune {camera}/frame-0000.exr -c {camera}/camera.json --depth={depth} -o {camera}.support.lfv"
        ));
        bench.folder_run(&format!(
            "lf-mart {camera}.support.lfv -i {camera}/frame-0000.exr -c {camera}/camera.json -o {camera}.lfv"
        ));
    }
    bench
}

const BOTH: &str = "scene.lfv aside.lfv -i scene/frame-0000.exr -i aside/frame-0000.exr -c scene/camera.json \
    -c aside/camera.json";

/// Where one camera is nearly blind in depth, two at 90 degrees are not. The bytes are the same for any number of
/// threads.
#[test]
fn two_cameras_at_right_angles_know_depth_as_well_as_the_rest() {
    let bench = two_cameras();
    assert_eq!(bench.text("scene/particles.csv"), bench.text("aside/particles.csv"));
    bench.done("scene.lfv -i scene/frame-0000.exr -c scene/camera.json --particles one.csv");
    bench.done(&format!("{BOTH} --hold pose --particles two.csv --stats stats.json --log log.jsonl --threads 1"));
    bench.done(&format!("{BOTH} --hold pose --particles again.csv --threads 3"));
    assert!(bench.bytes("two.csv") == bench.bytes("again.csv"));
    let truth = table(&bench, "scene/particles.csv");
    let [one, two] = ["one.csv", "two.csv"].map(|name| {
        let found = table(&bench, name);
        let pairs = matched(&truth, &found);
        let rms = (pairs.iter().map(|(off, _)| off[2] * off[2]).sum::<f64>() / pairs.len() as f64).sqrt() / 0.0055;
        (pairs.len() as f64 / truth.len() as f64, found.len() as f64 / truth.len() as f64, rms)
    });
    assert!(two.0 > 0.97 && two.0 >= one.0 && two.1 < 1.03, "{one:?} {two:?}");
    assert!(two.2 < 0.15 && two.2 < 0.2 * one.2, "{one:?} {two:?}");
    let cameras = &bench.json("stats.json")["counts"]["cameras"];
    assert!((cameras[1]["light"].as_f64().unwrap() - 1.0).abs() < 0.02, "{cameras}");
    assert!(bench.text("log.jsonl").contains("round together"));
}

/// A pose that is off by a tenth of a degree and some pixels is found and written.
#[test]
fn a_pose_is_found_and_lists_that_do_not_agree_are_refused() {
    let bench = two_cameras();
    let mut camera = Camera::open(&bench.path("aside/camera.json")).unwrap();
    let true_pose = camera.pose.unwrap();
    let (sin, cos) = 2e-3f64.sin_cos();
    let pose = camera.pose.as_mut().unwrap();
    (pose.rotation, pose.translation_mm) =
        ([[0.0, -sin, -cos], [0.0, cos, -sin], [1.0, 0.0, 0.0]], [0.004, 0.0, 0.995]);
    bench.write("near.json", camera.to_json());
    let call = BOTH.replace("aside/camera.json", "near.json");
    bench.done(&format!("{call} --particles two.csv --camera-out a.json --camera-out b.json"));
    let found = Camera::open(&bench.path("b.json")).unwrap().pose.unwrap();
    for place in [[0.5, 0.4, 0.6], [-0.5, 0.4, -0.6], [0.5, -0.4, -0.6]] {
        let (is, wanted) = (found.to_camera(place), true_pose.to_camera(place));
        (0..2).for_each(|k| assert!((is[k] - wanted[k]).abs() < 0.2 * 0.0055, "{is:?} for {wanted:?}"));
        assert!((is[2] - wanted[2]).abs() < 0.0055, "{is:?} for {wanted:?}");
    }
    let refused = |words: &str, named: &[&str]| bench.refused(words, named);
    refused(&BOTH.replace(" -c aside/camera.json", ""), &["--camera: given 1 times; wanted 2, as there are 2 images"]);
    refused(&BOTH.replace(" aside.lfv", ""), &["volume: given 1 times; wanted 2, as there are 2 images"]);
    refused(&format!("{BOTH} -b scene/frame-0000.exr"), &["--background: given 1 times; wanted 2"]);
    let limited = format!("{BOTH} --max-memory 0.01 --particles p.csv");
    refused(&limited, &["scene.lfv: a fit to ", "wanted 0.01 GB at most, as --max-memory allows"]);
    let turned = bench.text("near.json").replace("1.0,\n", "0.9,\n");
    bench.write("turned.json", turned);
    refused(&BOTH.replace("aside/camera.json", "turned.json"), &["turned.json: pose.rotation"]);
    let estimate = bench.done(&format!("{BOTH} --estimate")).stdout;
    let estimated: serde_json::Value = serde_json::from_slice(&estimate).unwrap();
    bench.done(&format!("{BOTH} --particles p.csv --stats stats.json"));
    let ratio = estimated["memory_bytes"].as_f64().unwrap() / bench.json("stats.json")["peak_bytes"].as_f64().unwrap();
    assert!((0.95..2.0).contains(&ratio), "{estimated}: {ratio}");
}

/// Lenslets that diffract and a blurred sensor: with the block in the camera, and without.
#[test]
fn a_blur_is_found_whether_the_camera_names_it_or_not() {
    for keys in [
        &["camera.microlenses.rotation_rad=0.003"][..],
        &[
            "camera.microlenses.layout=\"hexagonal\"",
            "camera.microlenses.rotation_rad=0.003",
            "camera.main_lens.aperture=\"circle\"",
        ],
    ] {
        let blur = "camera.blur={\"wavelength_nm\": 532, \"sigma_px\": 0.3}";
        let noise = "sensor_noise={\"photon_noise\": true}";
        let bench = bench(&[keys, &[blur, noise, "particles.rays=400000"]].concat());
        let truth = table(&bench, "scene/particles.csv");
        let mut camera = Camera::open(&bench.path("scene/camera.json")).unwrap();
        camera.blur = None;
        bench.write("sharp.json", camera.to_json());
        for file in ["scene/camera.json", "sharp.json"] {
            let call = CALL.replace("scene/camera.json", file);
            let said = bench.done(&format!("{call} --particles found.csv --stats stats.json")).stderr;
            assert_eq!(
                said.contains("the image is blurred and camera.json does not say so"),
                file == "sharp.json",
                "{said}"
            );
            let found = table(&bench, "found.csv");
            let share = matched(&truth, &found).len() as f64 / truth.len() as f64;
            assert!(
                share >= 0.95 && found.len() as f64 <= 1.04 * truth.len() as f64,
                "{file}: {share} {}",
                found.len()
            );
            let sigma_px = bench.json("stats.json")["counts"]["blur_px"].as_f64().unwrap();
            assert!((sigma_px - 0.3).abs() < 0.03, "{file}: {sigma_px}");
        }
    }
}

/// Lenslets that show Fresnel's pattern: the fit finds it where the camera names no pattern, and says so. With the far
/// field, depths are worse and the size is wrong.
#[test]
fn fresnels_pattern_is_found_and_said() {
    for layout in ["square", "hexagonal"] {
        let layout = format!("camera.microlenses.layout={layout}");
        let blur = r#"camera.blur={"wavelength_nm": 532, "sigma_px": 0.3, "pattern": "fresnel"}"#;
        let noise = r#"sensor_noise={"photon_noise": true, "read_noise_electrons": 3}"#;
        let turn = "camera.microlenses.rotation_rad=0.003";
        let bench = bench(&[&layout, turn, blur, noise, "particles.per_lenslet=0.2"]);
        let truth = table(&bench, "scene/particles.csv");
        let mut camera = Camera::open(&bench.path("scene/camera.json")).unwrap();
        // Median error of depth, mm, and the size, px.
        let mut measure = |pattern: Option<LensletPattern>| {
            camera.blur.as_mut().unwrap().pattern = pattern;
            bench.write("camera.json", camera.to_json());
            let call = CALL.replace("scene/camera.json", "camera.json");
            let said = bench.done(&format!("{call} --particles found.csv --stats stats.json")).stderr;
            assert_eq!(said.contains("lenslets show Fresnel's pattern"), pattern.is_none(), "{said}");
            let found = table(&bench, "found.csv");
            assert!(pattern == Some(LensletPattern::Fraunhofer) || found.len() <= truth.len() + 2, "{}", found.len());
            let off = |true_one: &Particle| {
                let near =
                    |other: &&Particle| (0..2).all(|k| (other.place_mm[k] - true_one.place_mm[k]).abs() < 1.5 * 0.0055);
                let off = found.iter().filter(near).map(|other| (other.place_mm[2] - true_one.place_mm[2]).abs());
                off.fold(f64::INFINITY, f64::min)
            };
            let mut off: Vec<f64> = truth.iter().filter(|one| one.place_mm[2].abs() > 0.5).map(off).collect();
            off.sort_by(f64::total_cmp);
            [off[off.len() / 2], bench.json("stats.json")["counts"]["size_px"].as_f64().unwrap()]
        };
        let [far, open, named] =
            [Some(LensletPattern::Fraunhofer), None, Some(LensletPattern::Fresnel)].map(&mut measure);
        for [off_mm, size_px] in [open, named] {
            // A bias of 1 um away from focus is left, which is as large as the noise.
            assert!(off_mm < 0.00195 && off_mm < 0.5 * far[0], "{layout}: {far:?} {open:?} {named:?}");
            assert!((size_px - 0.75).abs() < 0.04, "{layout}: {far:?} {open:?} {named:?}");
        }
    }
}

/// A camera with a wrong f-number, gap, pitch or rotation: the fit corrects it, says so, and loses no particle by it.
#[test]
fn a_camera_that_does_not_explain_the_image_is_corrected() {
    let bench = bench(&[]);
    let truth = Camera::open(&bench.path("scene/camera.json")).unwrap();
    let particles = table(&bench, "scene/particles.csv");
    type Change = fn(&mut Camera, f64);
    let wrong: [(&str, f64, Change); 4] = [
        ("f_number_percent", 5.0, |camera, by| camera.main_lens.working_f_number *= 1.0 + 0.01 * by),
        // A gap that is given counts as measured.
        ("lenslet_focus_percent", 3.0, |camera, by| {
            camera.microlenses.gap_mm = Some(camera.gap_mm());
            camera.microlenses.focal_length_mm /= 1.0 + 0.01 * by;
        }),
        ("pitch_percent", 0.2, |camera, by| camera.microlenses.pitch_mm *= 1.0 + 0.01 * by),
        ("rotation_mrad", 3.0, |camera, by| camera.microlenses.rotation_rad += 0.001 * by),
    ];
    for (key, off, change) in wrong {
        let mut camera = truth.clone();
        change(&mut camera, off);
        bench.write("off.json", camera.to_json());
        let call = CALL.replace("scene/camera.json", "off.json");
        let said = bench.done(&format!("{call} --particles found.csv --stats stats.json --camera-out out.json")).stderr;
        assert!(said.contains("the camera does not explain the image: the "), "{said}");
        assert!(said.contains("too large; the fit corrects it") && !said.contains("noise does not"), "{said}");
        assert_eq!(said.contains("--vignetting"), key == "f_number_percent", "{said}");
        assert_eq!(said.contains("gap_mm that is as much off"), key == "lenslet_focus_percent", "{said}");
        let counts = bench.json("stats.json")["counts"].clone();
        let [step, std] = [0, 1].map(|n| counts[key][n].as_f64().unwrap());
        assert!((step / off + 1.0).abs() < 0.06 && std < 0.02 * off, "{key}: {step} +- {std}");
        let found = table(&bench, "found.csv");
        let share = matched(&particles, &found).len() as f64 / particles.len() as f64;
        assert!(share >= 0.95, "{key}: {share}");
        let out = Camera::open(&bench.path("out.json")).unwrap();
        let f_number = out.main_lens.working_f_number - truth.main_lens.working_f_number;
        let pitch = out.microlenses.pitch_mm - truth.microlenses.pitch_mm;
        let turn = out.microlenses.rotation_rad - truth.microlenses.rotation_rad;
        assert!(f_number.abs() < 0.012 && pitch.abs() < 1e-5 && turn.abs() < 2e-4, "{key}: {f_number} {pitch} {turn}");
    }
}

/// Scar: cameras that are blind to a part of the pixels. Blind pixels had no light, also none that spreads to others:
/// of this good frame chi2 was 1.13 with each half of the pupil, and 23 in the pixels that were held out.
#[test]
fn light_spreads_from_blind_pixels() {
    let blur = "camera.blur={\"wavelength_nm\": 532, \"sigma_px\": 0.4}";
    let noise = "sensor_noise={\"photon_noise\": true, \"read_noise_electrons\": 3}";
    let bench = bench(&[blur, noise, "particles.rays=400000"]);
    for (by, part) in [("pupil", "a"), ("pupil", "b"), ("pixels", "a")] {
        bench.folder_run(&format!("lf-validate split scene/frame-0000.exr -c scene/camera.json --by {by} -o ."));
        let call = CALL.replace("scene/camera.json", &format!("{part}.json"));
        let more = "--gain 1 --read-noise 3 --hold camera,drift --particles found.csv --expected expected.exr";
        let said = bench.done(&format!("{call} {more} --stats stats.json")).stderr;
        let chi2 = bench.json("stats.json")["counts"]["chi2"].as_f64().unwrap();
        assert!(chi2 < 1.1 && !said.contains("warning"), "{by} {part}: {chi2} {said}");
    }
    let call = "lf-validate self -i scene/frame-0000.exr -c b.json --expected expected.exr --gain 1 --read-noise 3";
    bench.folder_run(&format!("{call} --max-chi2 1.2"));
}

/// A dry objective of NA 0.5 over water, whose lenslets spread light over 2.3 px.
const MICROSCOPE: &str = r#"camera={"sensor": {"width": 300, "height": 300, "pixel_pitch_mm": 0.005},
    "main_lens": {"focal_length_mm": 10.0, "magnification": 20.0, "working_f_number": 20.0, "aperture": "circle",
        "telecentric": {"index": 1.333}},
    "microlenses": {"layout": "hexagonal", "pitch_mm": 0.1, "focal_length_mm": 1.95, "rotation_rad": 0.0,
        "offset_mm": [0.0, 0.0]},
    "blur": {"sigma_px": 0.2, "wavelength_nm": 590.0}}"#;

/// Scar: diffraction as wide as two pixels. The far light was held for so much of the fit that it did not come to its
/// end: a lone particle had 0.947 of its light, and lay 0.08 px aside.
#[test]
fn wide_diffraction_is_fitted_to_the_end() {
    let f_number = "camera.main_lens.working_f_number=40";
    let sides = ["volume.x_mm=[0.001,0.0011]", "volume.y_mm=[0.0013,0.0014]", "volume.z_mm=[0.0199,0.02]"];
    let lone = ["particles.per_lenslet=null", "particles.count=1", "particles.rays=2000000", "truth=null", "frames=1"];
    let bench = Workbench::new(env!("CARGO_BIN_EXE_lf-fit"));
    bench.scene("core", &[&[MICROSCOPE, f_number], &sides[..], &lone].concat());
    bench.folder_run("lf-synth frames scene.json -o scene");
    bench
        .folder_run("lf-prune scene/frame-0000.exr -c scene/camera.json --pvr 4,4,r --depth -0.04,0.04 -o support.lfv");
    let noise = "--gain 1 --read-noise 0.5 --hold camera,drift,sizes";
    bench.done(&format!("support.lfv -i scene/frame-0000.exr -c scene/camera.json {noise} --particles found.csv"));
    let (truth, found) = (table(&bench, "scene/particles.csv"), table(&bench, "found.csv"));
    assert_eq!(found.len(), 1);
    let light = found[0].intensity / truth[0].intensity;
    let off_px = (0..2).map(|k| (found[0].place_mm[k] - truth[0].place_mm[k]) / 0.00025);
    assert!(
        (light - 1.0).abs() < 0.004 && off_px.clone().all(|off| off.abs() < 0.01),
        "{light} {:?}",
        off_px.collect::<Vec<_>>()
    );
}

/// Scar: a dry objective over water. The fit found the spherical aberration and gave it up, because squared differences
/// alone decided and the particles stayed at their old depths: chi2 was 1.2, neighbours correlated by 0.41.
#[test]
fn the_spherical_aberration_of_a_microscope_is_corrected() {
    let aberrations = "camera.aberrations={\"spherical_px\": 6.8}";
    let noise = "sensor_noise={\"photon_noise\": true, \"read_noise_electrons\": 3}";
    let sides = ["volume.x_mm=[-0.035,0.035]", "volume.y_mm=[-0.035,0.035]", "volume.z_mm=[-0.03,0.03]"];
    let more = [MICROSCOPE, aberrations, noise, "truth=null", "frames=1", "particles.per_lenslet=0.1", "seed=2"];
    let bench = Workbench::new(env!("CARGO_BIN_EXE_lf-fit"));
    bench.scene("core", &[&sides[..], &more, &["particles.rays=40000"]].concat());
    bench.folder_run("lf-synth frames scene.json -o scene");
    let mut plain = Camera::open(&bench.path("scene/camera.json")).unwrap();
    plain.aberrations = None;
    bench.write("plain.json", plain.to_json());
    bench.folder_run("lf-prune scene/frame-0000.exr -c plain.json --pvr 4,4,r --depth -0.04,0.04 -o support.lfv");
    let call = "support.lfv -i scene/frame-0000.exr -c plain.json --particles found.csv --stats stats.json";
    let said = bench.done(call).stderr;
    assert!(said.contains("depths then count from") && !said.contains("noise does not explain"), "{said}");
    let found = bench.json("stats.json")["counts"]["spherical_px"][0].as_f64().unwrap();
    assert!((found - 6.8).abs() < 0.7, "{found}");
    assert!(bench.text("found.csv").contains("# camera corrected: {\"spherical_px\":["));
}

/// A sensor beyond the focus of the lenslets: the fit finds the gap, and says what else it may be.
#[test]
fn a_gap_that_no_file_gives_is_found() {
    let bench = bench(&["camera.microlenses.gap_mm=0.31724"]);
    let mut camera = Camera::open(&bench.path("scene/camera.json")).unwrap();
    let off = camera.gap_mm() / camera.microlenses.focal_length_mm;
    // White images show the width of lenslet images, which the f-number and the gap determine together.
    camera.main_lens.working_f_number /= off;
    camera.microlenses.gap_mm = None;
    bench.write("off.json", camera.to_json());
    let call = CALL.replace("scene/camera.json", "off.json");
    let said = bench.done(&format!("{call} --particles found.csv --stats stats.json --camera-out out.json")).stderr;
    let words = ["the gap between lenslets and sensor", "focal length of the lenslets that is as much off"];
    assert!(words.iter().all(|words| said.contains(words)) && !said.contains("noise does not"), "{said}");
    let [step, std] = [0, 1].map(|n| bench.json("stats.json")["counts"]["gap_percent"][n].as_f64().unwrap());
    assert!((step / (100.0 * (off - 1.0)) - 1.0).abs() < 0.06 && std < 0.06, "{step} +- {std}");
    let (particles, found) = (table(&bench, "scene/particles.csv"), table(&bench, "found.csv"));
    assert!(matched(&particles, &found).len() as f64 >= 0.95 * particles.len() as f64);
    let out = Camera::open(&bench.path("out.json")).unwrap();
    assert!((out.gap_mm() / camera.microlenses.focal_length_mm - off).abs() < 2e-3, "{}", out.gap_mm());
}

/// With the camera held, it is said that noise does not explain the image. chi2 shows it where the noise is right, and
/// neighbouring pixels where it is stated too large.
#[test]
fn what_noise_does_not_explain_is_said() {
    let bench = bench(&[]);
    for (gain_counts, percent, sign) in
        [(1.0, 5.0, "chi2 is"), (5.0, 3.0, "differences of neighbouring pixels correlate by")]
    {
        let mut camera = Camera::open(&bench.path("scene/camera.json")).unwrap();
        camera.sensor_noise = Some(SensorNoise { gain_counts, read_noise_counts: 1.0 });
        camera.main_lens.working_f_number *= 1.0 + 0.01 * percent;
        bench.write("off.json", camera.to_json());
        let call = CALL.replace("scene/camera.json", "off.json");
        let said = bench.done(&format!("{call} --hold camera --particles found.csv --stats stats.json")).stderr;
        assert!(said.contains(&format!("noise does not explain the image: {sign}")), "{said}");
        let counts = bench.json("stats.json")["counts"].clone();
        let [gain, chi2, alike] =
            ["gain_counts", "chi2", "residual_correlation"].map(|name| counts[name].as_f64().unwrap());
        assert!(gain == gain_counts && (chi2 > 1.4) == (gain == 1.0) && alike > 0.15, "{counts}");
    }
}

/// From the frame to the particles through a pipe. No volume stands between, and the threads change no byte.
#[test]
fn a_support_is_enough() {
    let keys = ["camera.microlenses.layout=\"hexagonal\"", "truth=null", "frames=1", "particles.per_lenslet=0.2"];
    let bench = bench(&keys);
    bench.folder_run("lf-prune scene/frame-0000.exr -c scene/camera.json --pvr 2,2,20 --depth -5,5 -o support.lfv");
    let call = "-i scene/frame-0000.exr -c scene/camera.json";
    bench.feed(&format!("{call} -o drawn.lfv --particles found.csv"), bench.bytes("support.lfv")).done();
    let (truth, found) = (table(&bench, "scene/particles.csv"), table(&bench, "found.csv"));
    let share = matched(&truth, &found).len() as f64 / truth.len() as f64;
    assert!(share >= 0.94 && found.len() as f64 <= 1.06 * truth.len() as f64, "{share}, {}", found.len());
    assert!(Volume::open(&bench.path("drawn.lfv")).unwrap().count() > 0);
    let said = bench.done(&format!("support.lfv {call} --particles one.csv --threads 1")).stderr;
    assert!(!said.contains("at the end of the depths"), "{said}");
    assert!(bench.bytes("one.csv") == bench.bytes("found.csv"));
}

/// Fits a blurred, noisy frame on its support. Gives the bench, with `found.csv`, and what was said.
fn found_on_a_support(keys: &[&str]) -> (Workbench, String) {
    let blur = "camera.blur={\"wavelength_nm\": 532, \"sigma_px\": 0.3}";
    let noise = "sensor_noise={\"photon_noise\": true, \"read_noise_electrons\": 3}";
    let bench = bench(&[keys, &[blur, noise, "truth=null", "frames=1", "particles.rays=100000"]].concat());
    bench.folder_run("lf-prune scene/frame-0000.exr -c scene/camera.json --pvr 4,4,r --depth -5,5 -o support.lfv");
    let call = "support.lfv -i scene/frame-0000.exr -c scene/camera.json --particles found.csv --stats stats.json";
    let said = bench.done(call).stderr;
    (bench, said)
}

/// Scar: beside bright particles, those with a twentieth of their light were no maxima: 46 of 54 were found.
#[test]
fn faint_particles_beside_bright_ones_are_found() {
    let (bench, _) = found_on_a_support(&["particles.intensity_spread=2"]);
    let (truth, found) = (table(&bench, "scene/particles.csv"), table(&bench, "found.csv"));
    let count = matched(&truth, &found).len();
    assert!(count + 2 >= truth.len() && found.len() <= truth.len() + 2, "{count} of {}", truth.len());
}

/// Scar: at the edges of a Gaussian sheet particles are dim. A third was missing, and the blur that was fitted without
/// them, 0.319 px, hid them from later looks.
#[test]
fn dim_particles_at_the_edges_of_a_sheet_are_found() {
    let sheet = "light={\"profile\": \"gaussian\", \"centre_mm\": 0, \"thickness_mm\": 6}";
    let lattice = "camera.microlenses.layout=\"hexagonal\"";
    let (bench, _) = found_on_a_support(&[sheet, lattice, "particles.intensity_spread=0.6", "particles.per_lenslet=1"]);
    let (truth, found) = (table(&bench, "scene/particles.csv"), table(&bench, "found.csv"));
    let count = matched(&truth, &found).len();
    assert!(100 * count > 78 * truth.len() && found.len() < count + 10, "{count} of {}, {}", truth.len(), found.len());
    let blur = bench.json("stats.json")["counts"]["blur_px"].as_f64().unwrap();
    assert!((blur - 0.3).abs() < 0.01, "{blur}");
}

/// Scar: clipped pixels were taken as they are. With a pixel in fifty clipped there were 66 particles for 54, x was off
/// by 0.06 px, and the camera was said to be tilted.
#[test]
fn clipped_pixels_say_nothing() {
    let (bench, _) = found_on_a_support(&["particles.intensity_spread=0.7"]);
    let mut frame = image::open(&bench.path("scene/frame-0000.exr")).unwrap();
    let mut values: Vec<f32> = frame.pixels.iter().copied().collect();
    values.sort_by(f32::total_cmp);
    let level = values[values.len() * 49 / 50];
    frame.pixels.mapv_inplace(|value| value.min(level));
    image::save(&bench.path("clipped.exr"), &frame.pixels, &frame.history).unwrap();
    let said = bench.done("support.lfv -i clipped.exr -c scene/camera.json --particles found.csv").stderr;
    assert!(said.contains("2.0 % of the pixels are clipped") && !said.contains("does not explain"), "{said}");
    are_found(&bench);
}

/// Asserts that `found.csv` has the true particles at their places.
fn are_found(bench: &Workbench) {
    let (truth, found) = (table(bench, "scene/particles.csv"), table(bench, "found.csv"));
    let pairs = matched(&truth, &found);
    let median = upper_median(&mut pairs.iter().map(|(off, _)| off[0].abs()).collect::<Vec<_>>()).unwrap();
    assert!(pairs.len() + 2 >= truth.len() && found.len() <= truth.len() + 2, "{} of {}", pairs.len(), truth.len());
    assert!(median < 0.04 * 0.0055, "{median}");
}

/// Scar: with a pixel in 2000 hot, a dead column and a bright row there were 77 particles for 54, and nothing was said.
#[test]
fn hot_pixels_and_dead_lines_are_left_out() {
    let (bench, said) = found_on_a_support(&["particles.intensity_spread=0.7"]);
    assert!(!said.contains("hot or dead"), "{said}");
    let mut frame = image::open(&bench.path("scene/frame-0000.exr")).unwrap();
    let brightest = frame.pixels.fold(0f32, |most, value| most.max(*value));
    for n in 1..=100 {
        let place = |by: f64, end: f64| ((n as f64 * by).fract() * end) as usize;
        frame.pixels[(place(0.754_878, 420.0), place(0.569_840, 476.0))] += brightest * n as f32 / 100.0;
    }
    frame.pixels.column_mut(230).fill(0.0);
    frame.pixels.row_mut(190).mapv_inplace(|value| value + 0.02 * brightest);
    image::save(&bench.path("hot.exr"), &frame.pixels, &frame.history).unwrap();
    let call = "support.lfv -i hot.exr -c scene/camera.json --particles found.csv --stats stats.json";
    let said = bench.done(call).stderr;
    assert!(said.contains("pixels, columns [230], rows [190] are hot or dead"), "{said}");
    let pixels = bench.json("stats.json")["counts"]["defects"]["pixels"].as_u64().unwrap();
    assert!((60..=100).contains(&pixels), "{pixels}");
    are_found(&bench);
}

/// Scar: light of particles beyond the rim of the frame was taken for particles within it: 232 for 149.
#[test]
fn particles_beyond_the_rim_make_no_ghosts() {
    let sides = ["volume.x_mm=[-1.7,1.7]", "volume.y_mm=[-1.55,1.55]", "particles.per_lenslet=0.15"];
    let (bench, said) = found_on_a_support(&sides);
    assert!(!said.contains("does not explain"), "{said}");
    let (truth, found) = (table(&bench, "scene/particles.csv"), table(&bench, "found.csv"));
    let is_inside = |particle: &&Particle| particle.place_mm[0].abs() < 1.31 && particle.place_mm[1].abs() < 1.155;
    let inside = truth.iter().filter(is_inside).count();
    assert!(found.iter().all(|particle| is_inside(&particle)), "a particle beyond the volume");
    let count = matched(&truth, &found).len();
    assert!(count as f64 >= 0.96 * inside as f64 && found.len() <= count + 5, "{count} of {inside}, {}", found.len());
}

/// The commonest slip: the volume ends before the particles do.
#[test]
fn depths_that_end_before_the_particles_are_said() {
    let bench = bench(&["truth=null", "frames=1", "particles.per_lenslet=0.2"]);
    bench.folder_run("lf-prune scene/frame-0000.exr -c scene/camera.json --depth=-3,5 -o support.lfv");
    let said = bench.done("support.lfv -i scene/frame-0000.exr -c scene/camera.json --particles found.csv").stderr;
    assert!(said.contains("particles lie at the end of the depths, -3.0 mm, where "), "{said}");
    assert!(!said.contains("at the end of the depths, 5"), "{said}");
}

/// Particles of the frame before, led by the true flow and without every eighth of them, are a start: the others are
/// found in what they leave. Without the flow they are 12 px off: this is said, and changes no byte of the result.
#[test]
fn particles_of_the_frame_before_are_a_start() {
    let flow = r#"flow={"kind": "uniform", "displacement_mm": [0.06, -0.03, 0.3]}"#;
    let blur = r#"camera.blur={"wavelength_nm": 532, "sigma_px": 0.3}"#;
    let noise = r#"sensor_noise={"photon_noise": true, "read_noise_electrons": 3}"#;
    let bench = bench(&["frames=2", "particles.per_lenslet=0.4", flow, blur, noise]);
    let truth: Vec<Particle> = table(&bench, "scene/particles.csv");
    let text = bench.text("scene/particles.csv");
    let header = text.lines().filter(|line| !line.starts_with(|c: char| c.is_ascii_digit()));
    let others = text.lines().filter(|line| line.starts_with("0,")).enumerate().filter(|(n, _)| n % 8 != 0);
    let lines: Vec<&str> = header.chain(others.map(|(_, line)| line)).collect();
    bench.write("before.csv", lines.join("\n") + "\n");

    bench.folder_run("lf-prune scene/frame-0001.exr -c scene/camera.json --pvr 2,2,20 --depth -5,5 -o support.lfv");
    let call = "support.lfv -i scene/frame-0001.exr -c scene/camera.json --frame 1";
    let flow = "--start before.csv --start-field scene/flow.exr";
    let said = bench.done(&format!("{call} {flow} --particles led.csv --log led.jsonl"));
    assert!(said.stderr.is_empty(), "{}", said.stderr);
    let truth: Vec<Particle> = truth.into_iter().filter(|particle| particle.frame == 1).collect();
    let found = table(&bench, "led.csv");
    let share = matched(&truth, &found).len() as f64 / truth.len() as f64;
    assert!(share >= 0.96 && found.len() as f64 <= 1.04 * truth.len() as f64, "{share}, {}", found.len());
    let added = bench.text("led.jsonl").lines().find(|line| line.contains("what is left")).map(str::to_owned);
    let added: serde_json::Value = serde_json::from_str(&added.unwrap()).unwrap();
    assert!(added["added"].as_u64().unwrap() as usize >= truth.len() / 12, "{added}");

    let said = bench.done(&format!("{call} --start before.csv --particles lost.csv"));
    assert!(said.stderr.contains("the particles of --start are not those of this image"), "{}", said.stderr);
    bench.done(&format!("{call} --particles anew.csv"));
    assert!(bench.bytes("lost.csv") == bench.bytes("anew.csv"));
    // The table of all frames has those of the frame before, and none before the first.
    bench.done(&format!("{call} --start scene/particles.csv --start-field scene/flow.exr --particles both.csv"));
    let first = "support.lfv -i scene/frame-0001.exr -c scene/camera.json --start scene/particles.csv";
    bench.refused(first, &["particles.csv: holds frames 0 to 1; wanted particles of the frame before --frame"]);
}
