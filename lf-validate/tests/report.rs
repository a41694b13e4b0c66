//! `lf-validate report`: what the page holds; its look is checked in a browser.

use crate::workbench::{CAMERA, field, save_field, workbench};
use lf_core::field::{NO_DATA, REPLACED};
use lf_core::history::Step;
use lf_core::{Grid, particles};
use lf_tests::Workbench;
use serde_json::Value;
use std::fs;

/// A folder of a run with two fields, a volume, its sweeps, particles, a camera, stats and logs.
fn run(bench: &Workbench) {
    fs::create_dir_all(bench.path("out/log")).unwrap();
    fs::write(bench.path("out/camera.json"), CAMERA).unwrap();
    for (n, name) in ["out/field-a-b.exr", "out/field-c-d.exr", "out/mean.exr"].into_iter().enumerate() {
        let mut field =
            field([6, 5, 4], |[x, y, z]| [(0.01 * x + 0.001 * n as f64) as f32, (0.01 * y) as f32, -z as f32]);
        (field.flag[3], field.flag[4]) = (REPLACED, NO_DATA);
        field.su.fill(0.002);
        field.layout.history =
            vec![Step { tool: "lf-xcorr".into(), version: "1".into(), arguments: vec!["</script><b>".into()] }];
        save_field(bench, name, &field);
    }
    let grid = Grid { shape: [4, 3, 2], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [-0.15, -0.1, -0.5] };
    bench.volume("out/volume-a.lfv", &grid, &[0, 7, 17], &[("intensity", &[1.0, 2.5, 4.0])]);
    bench.volume("out/support-a.lfv", &grid, &[0, 7, 17], &[("score", &[1.0, 2.5, 4.0])]);
    let sweeps = "{\"iteration\":1,\"misfit\":0.3}\n{\"iteration\":2,\"misfit\":0.1}\n";
    fs::write(bench.path("out/volume-a.sweeps.jsonl"), sweeps).unwrap();
    let stats = r#"{"tool": "lf-mart", "version": "1", "threads": 2, "seconds": 12.5, "phases": {"read": 1.5},
        "peak_bytes": 250000000, "counts": {}}"#;
    fs::write(bench.path("out/volume-a.stats.json"), stats).unwrap();
    let rows: String = (0..3001).map(|n| format!("0,{n},0.123456,0,{},1\n", 1e-3 * f64::from(n))).collect();
    let table = format!("{}\nframe,id,x_mm,y_mm,z_mm,intensity\n{rows}", particles::FRAME_LINE);
    fs::write(bench.path("out/particles-a.csv"), table).unwrap();
    let log = "lf-mart: kept 3\nlf-mart: warning: <dark> frame\n";
    fs::write(bench.path("out/log/volume-a.txt"), log).unwrap();
}

/// A list that the page's script reads.
fn data(page: &str, id: &str) -> Value {
    let text = page.split_once(&format!("id=\"{id}\">")).unwrap().1.split_once("</script>").unwrap().0;
    serde_json::from_str(text).unwrap()
}

#[test]
fn a_page_holds_the_run_and_nothing_from_elsewhere() {
    let bench = workbench();
    run(&bench);
    bench.done(&["report", "out", "-o", "page.html"]);
    let page = bench.text("page.html");
    for anchor in ["field", "inside", "statistics", "reconstruction", "pruning", "camera", "stages", "commands"] {
        assert!(page.contains(&format!("<section id=\"{anchor}\">")), "no section {anchor}");
    }
    assert!(page.contains("1 warning<") && page.contains("lf-mart: &lt;dark&gt; frame"), "the warning");
    assert!(page.contains("12.5 s in all stages, 250 MB"), "the summary");
    // u is 0.01 times 0 to 2.5 mm: its spread is 0.0085 mm, its uncertainty 0.002 mm.
    assert!(page.contains("that of u is 0.23 of its spread") && page.contains("98.3 % (at least 80 %)"), "judged");
    assert!(page.contains("lf-xcorr 1: &lt;/script&gt;&lt;b&gt;"), "the commands");
    let outside = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http:") && !outside.contains("https:") && !outside.contains("{{"), "links to elsewhere");
    assert_eq!(page.matches("</script>").count(), 3, "nothing ends a script early");
    // Two of three hundred and sixty vectors each: 240 places in two fields, two of each kind.
    assert!(page.contains("98.3 % measured, 0.8 % replaced, 0.8 % without data"), "the kinds of vectors");
}

#[test]
fn the_script_gets_every_vector() {
    let bench = workbench();
    run(&bench);
    bench.done(&["report", "out", "-o", "page.html"]);
    let page = bench.text("page.html");
    let fields = data(&page, "fields-data");
    let names: Vec<&str> = fields.as_array().unwrap().iter().map(|field| field["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["mean of all fields", "field-a-b.exr", "field-c-d.exr"]);
    assert_eq!(fields[0]["shape"], serde_json::json!([6, 5, 4]));
    // 120 numbers of two bytes as base64.
    assert_eq!(fields[1]["vector"][2]["data"].as_str().unwrap().len(), 320);
    assert_eq!(fields[1]["flags"].as_str().unwrap().len(), 160);
}

#[test]
fn the_volume_holds_as_many_vectors_and_particles_as_the_page_says() {
    let bench = workbench();
    run(&bench);
    bench.done(&["report", "out", "-o", "page.html"]);
    let page = bench.text("page.html");
    assert!(
        page.contains("Shown: 119 of 119 vectors of mean.exr; 3000 of 3001 particles of particles-a.csv."),
        "counts"
    );
    let space = data(&page, "space-data");
    let [vectors, particles] = ["vectors", "particles"].map(|name| space[name].as_array().unwrap());
    assert_eq!([vectors.len(), particles.len()], [119, 3000]);
    // The third vector is replaced, the fourth has no data: x, y, z and u, v, w, in the mean of the folder.
    assert_eq!(vectors[3], serde_json::json!([1.5, 0.0, 0.0, 0.017, 0.0, 0.0, 1.0]));
    assert_eq!(vectors[4], serde_json::json!([2.5, 0.0, 0.0, 0.027, 0.0, 0.0, 0.0]));
    assert_eq!(particles[1000], serde_json::json!([0.1235, 0.0, 1.0]));
    assert_eq!(space["box"], serde_json::json!([[-0.2, 0.2], [-0.15, 0.15], [-1.0, 1.0]]));
    // A pixel is 0.011 mm in focus.
    assert!((space["px"].as_f64().unwrap() - 1.0 / 0.011).abs() < 1e-9, "{}", space["px"]);
}

#[test]
fn a_damaged_file_is_named_and_the_page_is_made() {
    let bench = workbench();
    run(&bench);
    fs::write(bench.path("out/field-c-d.exr"), "cut").unwrap();
    fs::write(bench.path("out/volume-b.lfv"), "cut").unwrap();
    let ended = bench.done(&["report", "out", "-o", "page.html"]);
    let lines = ended.stderr;
    assert!(lines.contains("warning: left out: ") && lines.contains("volume-b.lfv"), "{lines}");
    let page = bench.text("page.html");
    assert!(page.contains("3 warnings<") && page.contains("field-c-d.exr: "), "the page names both");
}

#[test]
fn files_that_are_too_much_are_named_and_the_page_is_made() {
    let bench = workbench();
    run(&bench);
    let grid = Grid { shape: [2, 2, 1 << 40], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] };
    bench.volume("out/volume-b.lfv", &grid, &[1, 4 << 39], &[("intensity", &[1.0, 2.0])]);
    let mut aside = field([6, 5, 4], |_| [0.0; 3]);
    aside.layout.origin_mm[0] = 9.0;
    save_field(&bench, "out/field-e-f.exr", &aside);
    // Records of other tools hide no sweeps.
    for name in ["a", "b", "c", "d"] {
        fs::write(bench.path(format!("out/{name}.jsonl")), "{}\n").unwrap();
    }
    bench.done(&["report", "out", "-o", "page.html"]);
    let page = bench.text("page.html");
    assert!(page.contains("volume-b.lfv: 1099511627776 slices, too many for a curve by depth"), "the deep volume");
    assert!(page.contains("field-e-f.exr: x from ") && page.contains("statistics leave it out"), "the field aside");
    assert!(page.contains("Misfit of the image, by sweep"), "the sweeps");
}

#[test]
fn a_page_replaces_none_of_its_files() {
    let bench = workbench();
    run(&bench);
    for name in ["camera.json", "field-a-b.exr", "log/volume-a.txt"] {
        let output = format!("out/{name}");
        bench.refused(&["report", "out", "-o", &output], &[&output, "is also an input"]);
    }
    bench.done(&["report", "out", "-o", "out/report.html"]);
    bench.done(&["report", "out", "-o", "out/report.html"]);
}

#[test]
fn a_folder_without_a_run_is_refused() {
    let bench = workbench();
    fs::create_dir(bench.path("empty")).unwrap();
    bench.refused(&["report", "empty", "-o", "page.html"], &["empty: no file of a run; wanted the folder of a run"]);
    bench.refused(&["report", "none", "-o", "page.html"], &["none: no such folder; wanted"]);
    assert!(!bench.path("page.html").exists());
}

#[test]
fn many_large_fields_stay_below_five_megabytes() {
    let bench = workbench();
    fs::create_dir(bench.path("out")).unwrap();
    for n in 0..4 {
        let name = format!("out/field-{n}.exr");
        save_field(&bench, &name, &field([60, 60, 42], |[x, y, z]| [x.sin() as f32, y.cos() as f32, z as f32]));
    }
    bench.done(&["report", "out", "-o", "page.html"]);
    let page = bench.text("page.html");
    assert!((2_000_000..5_000_000).contains(&page.len()), "{} bytes", page.len());
    assert!(page.contains("the others are in the folder"));
    let shown = data(&page, "space-data")["vectors"].as_array().unwrap().len();
    assert!((700..=1500).contains(&shown), "{shown} vectors");
    assert!(page.contains(&format!("Shown: {shown} of 151200 vectors of field-0.exr (one of ")), "what is shown");
}
