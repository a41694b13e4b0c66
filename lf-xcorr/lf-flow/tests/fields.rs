//! lf-flow from the outside: files in, files out.

use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::{Field, VectorGrid};
use lf_tests::Call;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder with a field of a slow vortex, with errors and a gap.
fn folder() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let layout = VectorGrid {
        shape: [9, 8, 7],
        spacing_mm: [0.2; 3],
        origin_mm: [-0.8, -0.7, -0.6],
        voxel_mm: [0.01; 3],
        window: [40; 3],
        overlap: 0.5,
        dt_s: Some(1e-3),
        history: Vec::new(),
    };
    let mut field = Field::empty(layout);
    for i in 0..field.len() {
        let [x, y, z] = field.place_mm(i).map(|mm| mm as f32);
        let wobble = ((7 * i % 13) as f32 - 6.0) / 6.0;
        (field.u[i], field.v[i], field.w[i]) = (-0.01 * y, 0.01 * x + 0.004 * z, 0.004 * wobble);
    }
    field.flag.fill(MEASURED);
    field.su.fill(2e-4);
    field.sv.fill(2e-4);
    field.sw.fill(3e-3);
    (field.flag[100], field.u[100]) = (NO_DATA, 0.0);
    field.flag[200] = REPLACED;
    let path = folder.path().join("field.exr");
    field.save(&path).unwrap();
    (folder, path)
}

fn flow(words: &[&str], field: &Path) -> Call {
    Call::new("lf-flow").word(words[0]).word(field).words(words[1..].iter().copied())
}

#[test]
fn a_divergence_free_field_is_the_same_by_any_number_of_threads_and_remembers_its_run() {
    let (folder, field) = folder();
    let made = |name: &str, words: &[&str]| {
        let path = folder.path().join(name);
        let said = flow(words, &field).word("-o").word(&path).env("LF_HISTORY", "on").run().done().stderr;
        (fs::read(&path).unwrap(), said, Field::open(&path).unwrap())
    };
    for task in ["solenoidal", "smooth"] {
        let (one, said, found) = made("one.exr", &[task]);
        assert!(found.layout.history.last().is_some_and(|step| step.tool == "lf-flow"));
        assert_eq!((found.flag[100], found.flag[200], found.flag[0]), (REPLACED, REPLACED, MEASURED));
        assert!(said.contains("moved by"), "{said}");
        let silent = |threads: &str| {
            let path = folder.path().join("threads.exr");
            flow(&[task, "--threads", threads, "-o"], &field).word(&path).run().done();
            fs::read(path).unwrap()
        };
        assert!(silent("1") == silent("4") && !one.is_empty(), "{task}");
    }
    let (_, said, found) = made("free.exr", &["solenoidal"]);
    assert!(said.contains("divergence RMS"), "{said}");
    let derived = folder.path().join("derived.exr");
    let said = flow(&["derive", "-o"], &folder.path().join("free.exr")).word(&derived).run().done().stderr;
    let number: f64 = said.split("divergence RMS ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    // Per second; a frame takes a millisecond.
    assert!(number * 1e-3 < 1e-6, "{said}");
    // The field with its channels is still the field.
    assert_eq!(Field::open(&derived).unwrap().w, found.w);
}

#[test]
fn a_smooth_field_that_is_not_solved_is_warned_of() {
    let (folder, field) = folder();
    let output = folder.path().join("stiff.exr");
    let said = |strength: &str| {
        let call = flow(&["smooth", "--strength", strength, "-o"], &field).word(&output);
        call.run().done().stderr
    };
    assert!(!said("1,1,100").contains("stopped before its goal"));
    let stiff = said("1e20,1,1");
    assert!(stiff.contains("smooth field stopped before its goal") && stiff.contains("smaller --strength"), "{stiff}");
}

#[test]
fn every_form_of_derived_numbers_can_be_written() {
    let (folder, field) = folder();
    let text = |name: &str, words: &[&str]| {
        let path = folder.path().join(name);
        flow(words, &field).word("-o").word(&path).run().done();
        String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned()
    };
    let table = text("derived.csv", &["derive"]);
    let header = table.lines().next().unwrap();
    for name in ["vorticity_z_1_s", "s_vorticity_z_1_s", "strain_xy_1_s", "q_criterion_1_s2", "energy_mm2_s2"] {
        assert!(header.split(',').any(|column| column == name), "{name} in {header}");
    }
    assert_eq!(table.lines().count(), 1 + 9 * 8 * 7);
    let column = header.split(',').position(|column| column == "vorticity_z_1_s").unwrap();
    let middle: f64 =
        table.lines().nth(1 + 4 + 9 * (4 + 8 * 3)).unwrap().split(',').nth(column).unwrap().parse().unwrap();
    assert!((middle - 20.0).abs() < 1e-3, "{middle}");
    assert!(text("derived.vti", &["derive"]).contains(r#"Name="lambda_2_1_s2""#));
    let netcdf = text("derived.nc", &["derive"]);
    assert!(netcdf.starts_with("CDF") && netcdf.contains("lambda_2_1_s2"));
    flow(&["derive", "--form", "vti", "-o"], &field).word(folder.path().join("d.csv")).run().refused("--form: given");
    assert!(!folder.path().join("d.csv").exists());
    let pressure = text("p.csv", &["pressure", "--density", "1000"]);
    assert!(pressure.lines().next().unwrap().ends_with("pressure_pa,s_pressure_pa"));
}

#[test]
fn many_fields_fill_a_folder() {
    let (folder, field) = folder();
    let second = folder.path().join("second.exr");
    fs::copy(&field, &second).unwrap();
    let out = folder.path().join("out");
    let stats = folder.path().join("stats.json");
    flow(&["solenoidal"], &field).word(&second).word("-o").word(&out).word("--stats").word(&stats).run().done();
    let counts: Value = serde_json::from_slice(&fs::read(&stats).unwrap()).unwrap();
    let count = |key: &str| counts["counts"][key].as_u64();
    assert_eq!([count("fields"), count("vectors"), count("filled")], [Some(2), Some(2 * 504), Some(4)], "{counts}");
    assert!(counts["counts"]["misfit"].as_f64().is_some_and(|misfit| misfit > 0.0), "{counts}");
    assert!(fs::read(out.join("field.exr")).unwrap() == fs::read(out.join("second.exr")).unwrap());
    flow(&["derive", "--form", "vti"], &field).word(&second).word("-o").word(&out).run().done();
    assert!(out.join("second.vti").is_file());
    flow(&["smooth"], &field).word(&second).word("-o").word(&field).run().refused("field.exr");
    flow(&["smooth"], &field).word(&second).run().refused("wanted a folder");
    flow(&["smooth"], &field).word(&field).word("-o").word(folder.path().join("new")).run().refused("another name");
    assert!(!folder.path().join("new").exists());
}

#[test]
fn lines_and_planes() {
    let (_folder, field) = folder();
    let line = flow(&["profile", "--from", "-0.8,0,0", "--to", "0.8,0,0", "--points", "9"], &field).run().done();
    let line = String::from_utf8(line.stdout).unwrap();
    let last: Vec<&str> = line.lines().last().unwrap().split(',').collect();
    assert_eq!((line.lines().count(), last[1]), (10, "1.6"));
    assert!((last[6].parse::<f64>().unwrap() - 0.008).abs() < 1e-6, "{line}");
    let plane = flow(&["profile", "--plane", "x=0"], &field).run().done().stdout;
    let plane: Value = serde_json::from_slice(&plane).unwrap();
    let flux = &plane["planes"][0];
    assert!(flux["flux_mm3_s"].is_number() && flux["share"].as_f64().unwrap() > 0.9, "{plane}");
    flow(&["profile"], &field).run().refused("--plane");
    flow(&["profile", "--plane", "x=0", "--points", "9"], &field).run().refused("--points");
    for words in [&["--plane", "x=0"][..], &["--from", "-0.8,0,0", "--to", "0.8,0,0", "--points", "1000000"]] {
        let most = ["--max-memory", if words.len() > 2 { "0.1" } else { "0.001" }];
        flow(&[&["profile"], words, &most].concat(), &field).run().refused("as --max-memory allows");
    }
    flow(&["profile", "--plane", "x=7"], &field).run().refused("outside the field");
    flow(&["profile", "--from", "7,7,7", "--to", "8,8,8"], &field).run().refused("no vectors along the line");
}

#[test]
fn fields_that_lack_what_a_task_needs_are_refused_with_a_remedy() {
    let (folder, field) = folder();
    let mut bare = Field::open(&field).unwrap();
    bare.sw.fill(f32::NAN);
    bare.layout.dt_s = None;
    let path = folder.path().join("bare.exr");
    bare.save(&path).unwrap();
    let out = folder.path().join("out.exr");
    flow(&["solenoidal", "-o"], &path).word(&out).run().refused("--sigma");
    flow(&["solenoidal", "--sigma", "0,1,1"], &path).run().refused("--sigma");
    flow(&["pressure", "--density", "1000", "-o"], &path).word(&out).run().refused("--dt");
    flow(&["pressure", "--dt", "1"], &path).run().refused("--density");
    let mut slower = Field::open(&field).unwrap();
    slower.layout.dt_s = Some(2e-3);
    let next = folder.path().join("next.exr");
    slower.save(&next).unwrap();
    let pair = |words: &[&str]| {
        let call = flow(&["pressure", "--density", "1000", "--interval", "0.01", "-o"], &field).word(&out);
        call.word(&next).words(words.iter().copied()).run()
    };
    pair(&[]).refused("next.exr: 0.002 s between its volumes; wanted 0.001 s, as in");
    assert!(!out.exists());
    pair(&["--dt", "0.001"]).done();
    fs::remove_file(&out).unwrap();
    flow(&["smooth", "--max-memory", "0.001"], &field).run().refused("--max-memory");
    assert!(!out.exists());
    let said = flow(&["solenoidal", "--sigma", "1e-4,1e-4,1e-3", "-o"], &path).word(&out).run().done().stderr;
    assert!(!said.contains("--sigma"), "{said}");
    let said = flow(&["solenoidal", "--sigma", "1e-4,1e-4,1e-3", "-o"], &field).word(&out).run().done().stderr;
    assert!(said.contains("warning") && said.contains("--sigma changes nothing"), "{said}");
    bare.u.iter_mut().zip(&bare.v).for_each(|(u, v)| *u = 10.0 * v);
    bare.save(&path).unwrap();
    let said = flow(&["solenoidal", "--sigma", "1e-5,1e-5,1e-5", "-o"], &path).word(&out).run().done().stderr;
    assert!(said.contains("warning") && said.contains("times what the uncertainties explain"), "{said}");
}
