//! The contract of lf-validate's command line.

use lf_core::field::{Field, Layout, MEASURED, NO_DATA, REPLACED};
use lf_core::grid::Grid;
use lf_core::{image, volume};
use serde_json::Value;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

const CAMERA: &str = r#"{
    "sensor": {"width": 280, "height": 280, "pixel_pitch_mm": 0.0055},
    "main_lens": {"focal_length_mm": 200.0, "magnification": 0.5, "working_f_number": 4.0, "aperture": "circle"},
    "microlenses": {"layout": "hexagonal", "pitch_mm": 0.077, "focal_length_mm": 0.231, "rotation_rad": 0.003,
                    "offset_mm": [0.0, 0.0]}
}"#;

struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), content).unwrap();
        self.path(name)
    }

    fn volume(&self, name: &str, indices: &[u64], intensity: &[f32]) -> PathBuf {
        self.volume_on(name, [4, 3, 2], "intensity", indices, intensity)
    }

    fn volume_on(&self, name: &str, shape: [usize; 3], column: &str, indices: &[u64], values: &[f32]) -> PathBuf {
        let grid = Grid { shape, spacing_mm: [0.1, 0.1, 1.0], origin_mm: [-0.15, -0.1, -0.5] };
        let mut bytes = Vec::new();
        volume::write(&mut bytes, &grid, indices, &[(column, values)], &Vec::new()).unwrap();
        self.file(name, bytes)
    }

    fn field(&self, name: &str, shape: [usize; 3], uvw: [f32; 3], flags: &[f32]) -> PathBuf {
        let mut field = Field::empty(Layout {
            shape,
            spacing_mm: [0.5; 3],
            origin_mm: [0.0; 3],
            voxel_mm: [0.01, 0.01, 0.1],
            window: [32, 32, 16],
            overlap: 0.75,
            dt_s: None,
            history: Vec::new(),
        });
        field.flag.fill(MEASURED);
        field.flag[..flags.len()].copy_from_slice(flags);
        for (component, value) in [&mut field.u, &mut field.v, &mut field.w].into_iter().zip(uvw) {
            component.fill(value);
        }
        field.save(&self.path(name)).unwrap();
        self.path(name)
    }
}

fn tool<P: AsRef<Path>>(words: &[&str], files: &[P]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lf-validate"));
    command.args(words).args(files.iter().map(AsRef::as_ref)).stdin(Stdio::null());
    command
}

fn run(words: &[&str], files: &[impl AsRef<Path>]) -> Output {
    tool(words, files).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error} in {output:?}"))
}

/// One line on standard error that starts with the tool's name, nothing on standard output, exit code 2.
fn refusal(output: &Output) -> String {
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(output.stdout.is_empty());
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(text.starts_with("lf-validate: "), "{text}");
    text
}

fn feed(mut command: Command, bytes: &[u8]) -> Output {
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(bytes).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn quality_by_hand_and_by_every_route() {
    let place = Place::new();
    let truth = place.volume("truth.lfv", &[1, 5, 9], &[3.0, 4.0, 5.0]);
    let volume = place.volume("volume.lfv", &[0, 5, 9], &[2.0, 6.0, 3.0]);
    let named = run(&["quality"], &[&truth, &volume]);
    assert_eq!(named.status.code(), Some(0));
    assert!(named.stderr.is_empty());
    let score = json(&named);
    assert!((score["q"].as_f64().unwrap() - 39.0 / 2450f64.sqrt()).abs() < 1e-12);
    assert!((score["ghost_share"].as_f64().unwrap() - 2.0 / 11.0).abs() < 1e-12);
    assert_eq!(score["shared_voxels"], 2);

    let bytes = fs::read(&volume).unwrap();
    let piped = feed(tool(&["quality"], &[&truth]), &bytes);
    let redirected =
        tool(&["quality"], &[truth.as_path(), Path::new("-")]).stdin(File::open(&volume).unwrap()).output().unwrap();
    let single = run(&["quality", "--threads", "1"], &[&truth, &volume]);
    for other in [piped, redirected, single] {
        assert_eq!(other.stdout, named.stdout);
    }
}

#[test]
fn min_q_decides_the_exit_code_and_the_score_is_printed_all_the_same() {
    let place = Place::new();
    let truth = place.volume("truth.lfv", &[1, 5], &[3.0, 4.0]);
    let volume = place.volume("volume.lfv", &[5], &[1.0]);
    for (min_q, code) in [("0.79", 0), ("0.8", 0), ("0.81", 1)] {
        let output = run(&["quality", "--min-q", min_q], &[&truth, &volume]);
        assert_eq!(output.status.code(), Some(code), "{min_q}");
        assert!((json(&output)["q"].as_f64().unwrap() - 0.8).abs() < 1e-12);
    }
    refusal(&run(&["quality", "--min-q", "NaN"], &[&truth, &volume]));
}

#[test]
fn dark_volumes_score_zero_and_say_so() {
    let place = Place::new();
    let truth = place.volume("truth.lfv", &[1], &[3.0]);
    for (name, indices, values) in [("none.lfv", &[][..], &[][..]), ("zeros.lfv", &[4][..], &[0.0][..])] {
        let volume = place.volume(name, indices, values);
        let output = run(&["quality"], &[&truth, &volume]);
        let score = json(&output);
        assert_eq!((&score["q"], &score["scale"]), (&Value::from(0.0), &Value::Null));
        let warning = String::from_utf8(output.stderr).unwrap();
        assert!(warning.contains(name) && warning.contains("dark"), "{warning}");
        assert_eq!(run(&["quality", "--min-q", "0.1"], &[&truth, &volume]).status.code(), Some(1));
    }
}

#[test]
fn volumes_that_cannot_be_compared_are_named() {
    let place = Place::new();
    let truth = place.volume("truth.lfv", &[1], &[3.0]);
    let larger = place.volume_on("larger.lfv", [5, 3, 2], "intensity", &[1], &[3.0]);
    let text = refusal(&run(&["quality"], &[&truth, &larger]));
    assert!(text.contains("larger.lfv") && text.contains("5 x 3 x 2") && text.contains("4 x 3 x 2"), "{text}");
    let support = place.volume_on("support.lfv", [4, 3, 2], "score", &[1], &[3.0]);
    let text = refusal(&run(&["quality"], &[&truth, &support]));
    assert!(text.contains("support.lfv") && text.contains("intensity") && text.contains("score"), "{text}");
    let text = refusal(&run(&["quality", "-", "-"], &[] as &[&str]));
    assert!(text.contains("twice"), "{text}");
}

#[test]
fn displacement_in_every_unit() {
    let place = Place::new();
    let truth = place.field("truth.exr", [3, 3, 3], [0.0; 3], &[]);
    let field = place.field("field.exr", [3, 3, 4], [0.022, -0.011, 0.1], &[NO_DATA, REPLACED]);
    let camera = place.file("camera.json", CAMERA);
    let words = ["displacement", "-c", camera.to_str().unwrap()];
    let output = run(&words, &[&truth, &field]);
    let score = json(&output);
    for (key, count) in [
        ("places", 36),
        ("measured", 34),
        ("replaced", 1),
        ("no_data", 1),
        ("outside_truth", 9),
        ("vectors", 26),
        ("outliers", 0),
    ] {
        assert_eq!(score[key], count, "{key}");
    }
    assert_eq!(score["measured_only"]["vectors"], 25);
    // A pixel is 0.0055 / 0.5 mm.
    for (key, wanted) in [("pixel_mm", 0.011), ("rms_u_px", 2.0), ("bias_v_px", -1.0), ("rms_w_vox", 1.0)] {
        assert!((score[key].as_f64().unwrap() - wanted).abs() < 1e-5, "{key} is {}", score[key]);
    }
    let piped = feed(tool(&words, &[&truth]), &fs::read(&field).unwrap());
    assert_eq!(piped.stdout, output.stdout);

    let bare = json(&run(&["displacement"], &[&truth, &field]));
    assert!(bare.get("rms_u_px").is_none() && bare.get("pixel_mm").is_none() && bare["rms_u_vox"].is_number());
}

#[test]
fn max_rms_judges_one_limit_or_three() {
    let place = Place::new();
    let truth = place.field("truth.exr", [3, 3, 3], [0.0; 3], &[]);
    let field = place.field("field.exr", [3, 3, 3], [0.011, -0.011, 0.11], &[]);
    let camera = place.file("camera.json", CAMERA);
    let camera = camera.to_str().unwrap();
    for (limit, code) in [("11", 0), ("9", 1), ("1.1,1.1,10.1", 0), ("1.1,0.9,10.1", 1)] {
        let output = run(&["displacement", "-c", camera, "--max-rms", limit], &[&truth, &field]);
        assert_eq!(output.status.code(), Some(code), "{limit}: {output:?}");
        assert!(json(&output)["rms_w_px"].is_number());
    }
    refusal(&run(&["displacement", "-c", camera, "--max-rms", "1,2"], &[&truth, &field]));
    assert!(refusal(&run(&["displacement", "--max-rms", "1"], &[&truth, &field])).contains("--camera"));
}

#[test]
fn a_field_without_data_gives_null_a_warning_and_no_pass() {
    let place = Place::new();
    let truth = place.field("truth.exr", [3, 3, 3], [0.0; 3], &[]);
    let field = place.field("field.exr", [2, 2, 2], [0.0; 3], &[NO_DATA; 8]);
    let camera = place.file("camera.json", CAMERA);
    let words = ["displacement", "-c", camera.to_str().unwrap(), "--max-rms", "1000"];
    let output = run(&words, &[&truth, &field]);
    assert_eq!(output.status.code(), Some(1));
    assert!(json(&output)["rms_u_px"].is_null());
    let warning = String::from_utf8(output.stderr).unwrap();
    assert!(warning.contains("field.exr") && warning.contains("8 without data"), "{warning}");
}

#[test]
fn info_knows_every_file_by_its_content() {
    let place = Place::new();
    let pixels = ndarray::arr2(&[[0.0f32, 4.0], [5.0, 7.0]]);
    image::save(&place.path("image.exr"), &pixels, &Vec::new()).unwrap();
    let volume = place.volume("volume.lfv", &[1, 5], &[3.0, 4.0]);
    let field = place.field("field.exr", [2, 3, 4], [0.25, 0.0, 0.0], &[NO_DATA]);
    let score = run(&["quality"], &[&volume, &volume]).stdout;
    run(&["quality", "--stats", place.path("stats.json").to_str().unwrap()], &[&volume, &volume]);
    let opened = Field::open(&field).unwrap();
    opened.save(&place.path("field.csv")).unwrap();
    opened.save(&place.path("field.vti")).unwrap();
    place.file("camera.json", CAMERA);
    place.file("scene.json", r#"{"camera": "camera.json", "particles": {"density": 0.5}, "seed": 1}"#);
    place.file("particles.csv", "frame,id,x_mm,y_mm,z_mm,intensity\n0,0,1,2,3,4\n");
    place.file("report.json", score);
    for (file, wanted) in [
        ("volume.lfv", "column intensity  min 3, max 4, mean 3.5, sum 7"),
        ("image.exr", "2 x 2 px"),
        ("field.exr", "2 x 3 x 4 = 24"),
        ("field.csv", "24"),
        ("field.vti", "ParaView"),
        ("camera.json", "pixel in focus"),
        ("scene.json", "\"camera.json\""),
        ("particles.csv", "1 in 1 frames"),
        ("report.json", "report of lf-validate"),
        ("stats.json", "statistics of a run"),
    ] {
        let path = place.path(file);
        let output = run(&["info"], &[&path]);
        let text = String::from_utf8(output.stdout).unwrap();
        assert_eq!(output.status.code(), Some(0), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(text.contains(wanted) && text.lines().count() <= 24, "{file}:\n{text}");
        let disguised = place.file("disguised.bin", fs::read(&path).unwrap());
        assert_eq!(run(&["info"], &[&disguised]).stdout, text.as_bytes(), "{file}");
        let piped = feed(tool(&["info", "-"], &[] as &[&str]), &fs::read(&path).unwrap());
        assert_eq!(piped.stdout, text.as_bytes(), "{file}");
    }
}

#[test]
fn info_refuses_what_it_does_not_know() {
    let place = Place::new();
    for (name, content, wanted) in [
        ("empty", &b""[..], "empty"),
        ("text", b"hello world", "hello wo"),
        ("other.json", b"{\"name\": 1}", "name"),
        ("cut.json", b"{\"name\": 1", "not JSON"),
        ("bad.csv", b"frame,id,x_mm,y_mm,z_mm,intensity\n0,0\n", "line 2"),
        ("latin.csv", b"frame,\xe9", "UTF-8"),
        ("cut.lfv", b"\x89LFV\r\n\x1a\n\x01\0", "cut.lfv"),
        ("cut.exr", b"\x76\x2f\x31\x01\x02\0\0\0", "cut.exr"),
        ("nearly.json", b"{\"sensor\": {}, \"main_lens\": {}}", "camera.json"),
    ] {
        let path = place.file(name, content);
        let text = refusal(&run(&["info"], &[&path]));
        assert!(text.contains(name) && text.contains(wanted), "{text}");
    }
}

#[test]
fn a_full_disk_and_a_closed_pipe_are_errors() {
    let place = Place::new();
    let volume = place.volume("volume.lfv", &[1, 5], &[3.0, 4.0]);
    let field = place.field("field.exr", [3, 3, 3], [0.0; 3], &[]);
    for (word, files) in [("quality", vec![&volume; 2]), ("displacement", vec![&field; 2]), ("info", vec![&volume])] {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let text = refusal(&tool(&[word], &files).stdout(full).stderr(Stdio::piped()).output().unwrap());
        assert!(text.contains("standard output"), "{text}");

        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let text = refusal(&tool(&[word], &files).stdout(writer).stderr(Stdio::piped()).output().unwrap());
        assert!(text.contains("standard output"), "{text}");
    }
}

#[test]
fn an_output_may_not_be_an_input() {
    let place = Place::new();
    let volume = place.volume("volume.lfv", &[1, 5], &[3.0, 4.0]);
    let before = fs::read(&volume).unwrap();
    let appended = File::options().append(true).open(&volume).unwrap();
    refusal(&tool(&["info"], &[&volume]).stdout(appended).stderr(Stdio::piped()).output().unwrap());
    refusal(&run(&["quality", "--stats", volume.to_str().unwrap()], &[&volume, &volume]));
    assert_eq!(fs::read(&volume).unwrap(), before);
}

#[test]
fn help_lists_what_is_built_and_nothing_else() {
    let output = run(&["--help"], &[] as &[&str]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0));
    for word in ["quality", "displacement", "info", "line", "curves", "trade", "--stats", "--threads"] {
        assert!(text.contains(word), "{word}");
    }
    assert!(!text.contains("elongation"));
    refusal(&run(&["quality"], &[] as &[&str]));
    refusal(&run(&["elongation"], &[] as &[&str]));
}
