//! Stages of `scripts/examples` in place of our tools, and files that other libraries read. `PYTHON` names the Python
//! that runs them (python3). A test whose Python module is missing says so in one line and passes.

use glam::DVec2;
use lf_core::field::{MEASURED, NO_DATA};
use lf_core::{Camera, Field, Grid, History, Optics, VectorGrid, Volume, history::Step, volume};
use lf_tests::Call;
use lf_tests::tools::workspace;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};
use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// Python, if it has all modules.
pub fn python(modules: &[&str]) -> Option<Command> {
    let program = env::var_os("PYTHON").unwrap_or_else(|| OsString::from("python3"));
    // A path is relative to the workspace.
    let is_path = program.to_string_lossy().contains('/');
    let program = if is_path { workspace().join(program).into_os_string() } else { program };
    let find = "import importlib.util as u, sys; print(*(m for m in sys.argv[1:] if not u.find_spec(m)))";
    let answer = Command::new(&program).args(["-c", find]).args(modules).output();
    let missing = match answer {
        Ok(output) if output.status.success() => String::from_utf8_lossy(&output.stdout).trim().to_owned(),
        _ => "Python itself".into(),
    };
    if !missing.is_empty() {
        eprintln!("left out: {} has no {missing}", program.display());
        return None;
    }
    let mut command = Command::new(program);
    command.env("LF_HISTORY", "off").env("PYTHONDONTWRITEBYTECODE", "1");
    command.current_dir(workspace().join("scripts/python"));
    Some(command)
}

pub fn done(mut command: Command) -> Output {
    let output = command.output().expect("Python starts");
    assert!(output.status.success(), "{command:?}\n{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Folder with frame, camera, truth and support of a small scene.
struct Scene(TempDir);

const GRID: [&str; 6] = ["--pvr", "2,2,20", "--depth", "-5,5", "--bounds", "-0.385,0.385,-0.385,0.385"];

impl Scene {
    fn new(name: &str, settings: &[&str]) -> Self {
        let scene = Self(TempDir::new().unwrap());
        let always =
            ["frames=1", "seed=3", "camera.sensor.width=252", "camera.sensor.height=252", "particles.per_lenslet=0.3"];
        let volume = ["volume.x_mm=[-0.385,0.385]", "volume.y_mm=[-0.385,0.385]", "truth.pixels_per_voxel=[2,2,20]"];
        let mut call = Call::new("lf-synth").words(["scene", name]);
        for setting in always.iter().chain(&volume).chain(settings) {
            call = call.words(["--set", setting]);
        }
        let text = call.run().done().stdout;
        fs::write(scene.path("scene.json"), text).unwrap();
        Call::new("lf-synth").words(["frames", "scene.json", "-o", "."]).within(scene.0.path()).run().done();
        scene.tool("lf-prune", &[&["frame-0000.exr", "-o", "ours.lfv"][..], &GRID].concat());
        scene
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs one of our tools with the camera.
    fn tool(&self, tool: &str, words: &[&str]) {
        Call::new(tool).words(words).words(["-c", "camera.json"]).within(self.0.path()).run().done();
    }

    /// Runs one of the examples with the camera and returns its stats.
    fn example(&self, mut python: Command, file: &str, words: &[&str]) -> Value {
        python.arg(workspace().join("scripts/examples").join(file)).args(words);
        python.args(["-c", "camera.json", "--threads", "1", "--stats", "stats.json"]).current_dir(self.0.path());
        done(python);
        let stats: Value = serde_json::from_slice(&fs::read(self.path("stats.json")).unwrap()).unwrap();
        assert!(stats["seconds"].as_f64().unwrap() > 0.0 && stats["peak_bytes"].as_f64().unwrap() > 1e6, "{stats}");
        stats
    }

    /// Q of a volume.
    fn quality(&self, volume: &str) -> f64 {
        let call = Call::new("lf-validate").words(["quality", "truth-0000.lfv", volume]).within(self.0.path());
        let scores: Value = serde_json::from_slice(&call.run().done().stdout).unwrap();
        scores["q"].as_f64().unwrap()
    }
}

/// Number of voxels in both volumes, over the number in the larger one.
fn agreement(ours: &Path, theirs: &Path) -> f64 {
    let (ours, theirs) = (Volume::open(ours).unwrap(), Volume::open(theirs).unwrap());
    assert!(ours.grid().agrees_with(theirs.grid()), "{} {}", ours.grid(), theirs.grid());
    let common = ours.indices().iter().filter(|index| theirs.indices().binary_search(index).is_ok()).count();
    common as f64 / ours.count().max(theirs.count()) as f64
}

/// Every kind of camera: rays at random meet the sensor where those of lf-core do.
#[test]
fn python_traces_the_rays_of_every_camera() {
    let cameras = [
        json!({}),
        json!({"microlenses": {"layout": "hexagonal", "rotation_rad": 0.02, "gap_mm": 0.3}}),
        json!({"distortion": {"radial": [5, -30, 100], "tangential": [0.01, -0.02]}, "tilt": {"x_rad": 0.02, "y_rad": -0.01}}),
        json!({"centres": {"radius_mm": 3, "x_mm": [0.01, -0.02, 0.01, 0.003, -0.01], "y_mm": [0.0, 0.01, -0.01, 0.02, 0.01]}}),
        json!({"medium": {"index": 1.333, "window_z_mm": 30, "window_thickness_mm": 8, "window_index": 1.49},
            "distortion": {"radial": [5, 0, 0]}}),
        json!({"medium": {"index": 1.333, "window_z_mm": 30}, "main_lens": {"pupil_distance_mm": 300}}),
        json!({"main_lens": {"pupil_distance_mm": 500}, "microlenses": {"layout": "hexagonal"}}),
        json!({"main_lens": {"pupil_vergence_per_mm": -0.001},
            "aberrations": {"spherical_px": 1, "secondary_spherical_px": -1.5, "coma_px": -2, "coma_px_per_mm": 0.4,
                "astigmatism_px": 1.5, "field_curvature_px": -1}}),
        json!({"main_lens": {"telecentric": {"index": 1.33}, "working_f_number": 1.2}, "distortion": {"radial": [5, 0, 0]}}),
    ];
    let Some(mut python) = python(&["numpy"]) else { return };
    let folder = TempDir::new().unwrap();
    for (n, blocks) in cameras.iter().enumerate() {
        let mut camera = json!({"sensor": {"width": 700, "height": 560, "pixel_pitch_mm": 0.0055},
            "main_lens": {"focal_length_mm": 200, "magnification": 0.9, "working_f_number": 4, "aperture": "circle"},
            "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308, "rotation_rad": 0.003,
                "offset_mm": [0.01, -0.02]}});
        for (name, block) in blocks.as_object().unwrap() {
            match (camera[name].as_object_mut(), block) {
                (Some(keys), Value::Object(more)) => keys.extend(more.clone()),
                _ => camera[name] = block.clone(),
            }
        }
        let optics = Optics::new(&Camera::from_json(&camera.to_string()).unwrap());
        fs::write(folder.path().join(format!("{n}.json")), camera.to_string()).unwrap();
        let mut random = Pcg64Mcg::new(n as u128);
        let mut within = |half: f64| half * (2.0 * random.random::<f64>() - 1.0);
        let rays: String = (0..4000)
            .map(|_| {
                let (x, y, z) = (within(2.0), within(1.6), within(6.0));
                let [u, v] = [(); 2].map(|()| within(0.7 * optics.half_aperture_mm));
                let place = optics.place_px(optics.sensor_from_object(DVec2::new(x, y), z, DVec2::new(u, v)));
                format!("{x},{y},{z},{u},{v},{},{}\n", place.x, place.y)
            })
            .collect();
        fs::write(folder.path().join(format!("{n}.csv")), rays).unwrap();
    }
    python.arg("-c").arg(
        "import lf, numpy, sys\n\
         for n in range(int(sys.argv[2])):\n    \
             *ray, column, row = numpy.loadtxt(f'{sys.argv[1]}/{n}.csv', delimiter=',').T\n    \
             found = lf.Camera(f'{sys.argv[1]}/{n}.json').place_px(*ray)\n    \
             print(max(abs(found[0] - column).max(), abs(found[1] - row).max()))",
    );
    python.arg(folder.path()).arg(cameras.len().to_string());
    let apart = String::from_utf8(done(python).stdout).unwrap();
    let apart: Vec<f64> = apart.lines().map(|line| line.parse().unwrap()).collect();
    assert!(apart.len() == cameras.len() && apart.iter().all(|px| *px < 1e-4), "{apart:?} px");
}

#[test]
fn a_lfv_goes_through_python_byte_for_byte() {
    let Some(mut python) = python(&["numpy", "xxhash"]) else { return };
    let folder = TempDir::new().unwrap();
    let (ours, theirs) = (folder.path().join("ours.lfv"), folder.path().join("theirs.lfv"));
    let grid = Grid { shape: [7, 5, 3], spacing_mm: [0.0055, 0.1 + 0.2, 1.0], origin_mm: [-0.1, 2.0, -5.0] };
    let step =
        Step { tool: "lf-\u{e4}\"\t".into(), version: "0.1.0".into(), arguments: vec!["-o".into(), "a b".into()] };
    let history: History = [step].into_iter().collect();
    let extra = json!({"note": {"deep": [1, 2.5, null, "\u{1f600}"]}});
    let indices = [0u64, 3, 4, 50, 104];
    let columns: [(&str, &[f32]); 2] = [("score", &[1.0, 0.1, 3e-9, -0.0, 1e30]), ("intensity", &[5.0; 5])];
    let mut bytes = Vec::new();
    volume::write_with(&mut bytes, &grid, &indices, &columns, &history, extra.as_object().unwrap()).unwrap();
    fs::write(&ours, &bytes).unwrap();
    python.args(["-c", "import lf, sys; lf.write_volume(sys.argv[2], lf.read_volume(sys.argv[1]))"]);
    done({
        python.args([&ours, &theirs]);
        python
    });
    assert!(fs::read(&theirs).unwrap() == bytes);
    Call::new("lf-validate").word("info").word(&theirs).run().done();
}

#[test]
fn python_refuses_a_damaged_lfv_and_says_when_it_cannot_write_one() {
    let Some(mut python) = python(&["numpy", "xxhash"]) else { return };
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("damaged.lfv");
    let grid = Grid { shape: [2, 2, 2], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
    let mut bytes = Vec::new();
    volume::write(&mut bytes, &grid, &[1, 2], &[("score", &[1.0, 2.0])], &History::new()).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&file, &bytes).unwrap();
    let program = "
import lf, sys
def refused(work):
    try:
        work()
    except lf.Refused as refusal:
        print(refusal)
refused(lambda: lf.read_volume(sys.argv[1]))
sys.modules['xxhash'] = None
volume = lf.read_volume(sys.argv[1])
refused(lambda: lf.write_volume(sys.argv[1], volume))
";
    python.args(["-c", program]).arg(&file);
    let output = done(python);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() == 2 && lines[0].contains("damaged.lfv: damaged"), "{text}");
    assert!(lines[1].contains("xxhash") && lines[1].contains("pip install"), "{text}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("not checked for damage"));
    assert!(fs::read(&file).unwrap() == bytes);
}

/// prune.py keeps the voxels of lf-prune, which scores a voxel at a place up to a quarter of a voxel from its centre.
/// Voxels near the threshold differ; the reconstruction does not.
#[test]
fn the_numpy_support_is_ours() {
    let turned = ["camera.microlenses.rotation_rad=0.003", "camera.microlenses.offset_mm=[0.011,-0.007]"];
    for (name, settings) in [("demo", &[][..]), ("demo", &turned), ("core-hexagonal", &[])] {
        let Some(python) = python(&["numpy", "OpenEXR", "xxhash"]) else { return };
        // The numpy code for lattices that are not axis-aligned is slow, so a part of the volume must do.
        let bounds = if name == "demo" && settings.is_empty() { GRID[5] } else { "-0.11,0.11,-0.11,0.11" };
        let grid = ["--pvr", "2,2,20", "--depth", "-5,5", "--bounds", bounds];
        let scene = Scene::new(name, settings);
        let words = [&["frame-0000.exr", "--threshold", "auto"][..], &grid].concat();
        scene.tool("lf-prune", &[&words[..], &["-o", "part.lfv"]].concat());
        let stats = scene.example(python, "prune.py", &[&words[..], &["-o", "theirs.lfv"]].concat());
        let common = agreement(&scene.path("part.lfv"), &scene.path("theirs.lfv"));
        assert!(
            common > 0.92 && stats["counts"]["kept"].as_u64().unwrap() > 100,
            "{name} {settings:?}: {common} {stats}"
        );
        if bounds == GRID[5] {
            for (support, volume) in [("ours.lfv", "volume.lfv"), ("theirs.lfv", "their-volume.lfv")] {
                scene.tool("lf-mart", &[support, "-i", "frame-0000.exr", "-o", volume]);
            }
            let (ours, theirs) = (scene.quality("volume.lfv"), scene.quality("their-volume.lfv"));
            // Points, the default basis, have Q 0.77 here.
            assert!((ours - theirs).abs() < 0.01 && theirs > 0.7, "{theirs} for {ours}");
        }
    }
}

/// The example samples its weights and has another update, so its Q may be lower by a tenth.
#[test]
fn the_stored_matrix_reconstructs_nearly_as_well() {
    let Some(python) = python(&["numpy", "OpenEXR", "xxhash", "scipy"]) else { return };
    let scene = Scene::new("demo", &[]);
    scene.tool("lf-mart", &["ours.lfv", "-i", "frame-0000.exr", "-o", "volume.lfv"]);
    let words = ["ours.lfv", "-i", "frame-0000.exr", "--iterations", "60", "-o", "their-volume.lfv"];
    scene.example(python, "mart.py", &words);
    let (ours, theirs) = (scene.quality("volume.lfv"), scene.quality("their-volume.lfv"));
    assert!(theirs > ours - 0.12, "{theirs} for {ours}");
}

#[test]
fn examples_refuse_unknown_words_in_one_line() {
    let unknown = ["frame.exr", "-c", "camera.json", "--depth", "-5,5", "--keep-all"];
    for (example, words, named) in [
        ("prune.py", &unknown[..], "--keep-all"),
        ("beads", &["img_beads.tif", "img_bg.tif"], "img_beads.tif: no such file"),
        ("beads", &["img_beads.tif"], "IMG_BEADS IMG_BG [OUT]"),
    ] {
        let Some(mut python) = python(&["numpy", "PIL"]) else { return };
        let output = python.arg(format!("../examples/{example}")).args(words).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(
            text.starts_with(&format!("{example}: ")) && text.contains(named) && text.lines().count() == 1,
            "{text}"
        );
    }
}

/// A refocused volume has light at the particles, smeared along the rays.
#[test]
fn the_rust_stage_takes_the_place_of_lf_mart() {
    if env::var_os("LF_TOOLS").is_some_and(|folder| !Path::new(&folder).join("lf-refocus").exists()) {
        eprintln!("left out: LF_TOOLS has no lf-refocus");
        return;
    }
    let scene = Scene::new("demo", &[]);
    let words = ["ours.lfv", "-i", "frame-0000.exr", "--iterations", "60"];
    scene.tool("lf-refocus", &[&words[..], &["--threads", "1", "-o", "one.lfv"]].concat());
    scene.tool("lf-refocus", &[&words[..], &["--threads", "3", "-o", "three.lfv"]].concat());
    assert!(fs::read(scene.path("one.lfv")).unwrap() == fs::read(scene.path("three.lfv")).unwrap());
    let quality = scene.quality("one.lfv");
    assert!((0.15..0.8).contains(&quality), "{quality}");
}

/// A field with every flag, numbers of all sizes, and unknown uncertainties.
fn field() -> Field {
    let layout = VectorGrid {
        shape: [3, 4, 5],
        spacing_mm: [0.1 + 0.2, 0.7, 1.1],
        origin_mm: [-0.33, 0.0, 1e-3],
        voxel_mm: [0.0055, 0.0055, 0.055],
        window: [16, 16, 8],
        overlap: 0.75,
        dt_s: Some(0.003),
        history: History::new(),
    };
    let mut field = Field::empty(layout);
    for i in 0..field.len() {
        let value = |seed: f64| ((i as f64 + 1.0) * seed).sin() as f32 * 10f32.powi(i as i32 % 9 - 6);
        (field.u[i], field.v[i], field.w[i]) = (value(1.3), value(2.1), value(3.7));
        (field.peak[i], field.ratio[i]) = (value(0.7).abs(), 1.0 + value(0.9).abs());
        if i % 3 != 0 {
            (field.su[i], field.sv[i], field.sw[i], field.count[i]) = (value(0.2).abs(), 0.5, 1e-7, i as f32);
        }
        field.flag[i] = [MEASURED, 1.0, NO_DATA][i % 3];
    }
    field
}

#[test]
fn a_field_is_the_same_in_exr_csv_and_vti() {
    let folder = TempDir::new().unwrap();
    let [exr, csv, vti] = ["field.exr", "field.csv", "field.vti"].map(|name| folder.path().join(name));
    for file in [&exr, &csv, &vti] {
        field().save(file).unwrap();
    }
    if let Some(mut python) = python(&["numpy", "OpenEXR"]) {
        let program = "
import lf, numpy as np, sys
layout, field = lf.read_field(sys.argv[1])
names = open(sys.argv[2]).readline().strip().split(',')
table = dict(zip(names, np.loadtxt(sys.argv[2], delimiter=',', skiprows=1).T))
grid = lf.Grid(layout['shape'], layout['spacing_mm'], layout['origin_mm'])
places = grid.centres_mm(np.arange(len(grid), dtype=np.uint64))
assert len(field) == 10 and names[:3] == ['x_mm', 'y_mm', 'z_mm'], names
for name, place in zip(names, places):
    assert np.array_equal(table[name], place), name
for name, values in field.items():
    column = table.get(name, table.get(name + '_mm')).astype(np.float32)
    assert np.array_equal(column, values.ravel(), equal_nan=True), name
";
        python.args(["-c", program]).args([&exr, &csv]);
        done(python);
    }
    if let Some(mut python) = python(&["numpy", "OpenEXR", "vtk"]) {
        python.arg("../examples/check_vti.py").args([&vti, &exr]);
        done(python);
    }
    if let Some(mut python) = python(&["numpy", "OpenEXR", "matplotlib"]) {
        let picture = folder.path().join("field.png");
        python.args(["../examples/plot.py", "--slice", "y=0.6"]).arg(&exr).arg("-o").arg(&picture);
        done(python);
        assert!(fs::read(&picture).unwrap().starts_with(b"\x89PNG"));
    }
}

/// Twelve fields of a wave along x that swings in four phases.
#[test]
fn phases_lines_and_modes_of_a_swinging_wave() {
    let Some(mut python) = python(&["numpy", "OpenEXR"]) else { return };
    let folder = TempDir::new().unwrap();
    let layout = VectorGrid { shape: [16, 5, 4], spacing_mm: [0.1, 0.2, 0.3], ..VectorGrid::default() };
    for n in 0..12usize {
        let mut field = Field::empty(layout.clone());
        for i in 0..field.len() {
            let turn = std::f32::consts::TAU * (i % 16) as f32 / 8.0;
            field.u[i] = 0.5 + 0.02 * [0.0, 1.0, 0.0, -1.0][n % 4] * turn.cos();
            field.w[i] = 0.1;
        }
        field.flag.fill(MEASURED);
        field.save(&folder.path().join(format!("field-{n:02}.exr"))).unwrap();
    }
    python.arg(workspace().join("scripts/examples/ensemble.py")).current_dir(folder.path());
    python.args((0..12).map(|n| format!("field-{n:02}.exr")));
    python.args(["--phases", "4", "--along", "x", "--modes", "2", "--parts", "parts"]);
    let score: Value = serde_json::from_slice(&done(python).stdout).unwrap();
    let is_near = |pointer: &str, wanted: f64, tolerance: f64| {
        let found = score.pointer(pointer).and_then(Value::as_f64).unwrap();
        assert!((found - wanted).abs() < tolerance, "{pointer}: {found} for {wanted}");
    };
    // Half of 0.02^2, in half of the phases.
    let rms = 0.02 * 0.25f64.sqrt();
    is_near("/phases/coherent_mm/0", rms, 1e-6);
    is_near("/phases/incoherent_mm/0", 0.0, 1e-9);
    is_near("/modes/share/0", 1.0, 1e-6);
    is_near("/modes/rms_mm/0", rms, 1e-6);
    is_near("/lines/correlation/0/4", -1.0, 1e-6);
    // Two waves in 1.6 mm. A quarter of the wavelength of 0.8 mm times 2 / pi; trapezoids of an eighth of a wave in a
    // short line fall short of it by a tenth.
    is_near("/lines/wavenumber_1_mm/1", 1.25, 1e-9);
    let spectrum: Vec<f64> = serde_json::from_value(score["lines"]["spectrum_mm3"][0].clone()).unwrap();
    assert!((0..8).all(|n| spectrum[n] <= spectrum[1]), "{spectrum:?}");
    is_near("/lines/length_mm/0", 0.8 / std::f64::consts::TAU, 0.02);
    let phase = Field::open(&folder.path().join("parts/phase-01.exr")).unwrap();
    assert!((phase.u[0] - 0.52).abs() < 1e-6 && phase.v[0] == 0.0, "{}", phase.u[0]);
    let mode = Field::open(&folder.path().join("parts/mode-00.exr")).unwrap();
    assert!((f64::from(mode.u[0]).abs() / (rms * 2f64.sqrt()) - 1.0).abs() < 1e-5, "{}", mode.u[0]);
}
