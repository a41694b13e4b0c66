//! Scores of a case of the benchmark.

use crate::workbench::{CAMERA, field, workbench};
use lf_tests::Workbench;
use serde_json::{Value, json};
use std::fs;

/// 1 px at the focal plane, mm.
const PIXEL: f64 = 0.011;
const HEAD: &str = "# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n";
/// A shear of 0.02 along x across z, and 0.04 mm along y.
const SCENE: &str = r#"{
    "frame": "right-handed", "camera": "camera.json",
    "volume": {"x_mm": [-1, 3], "y_mm": [-1, 3], "z_mm": [-1, 3]},
    "flow": [{"kind": "shear", "along": "x", "across": "z", "rate": 0.02},
             {"kind": "uniform", "displacement_mm": [0, 0.04, 0]}]
}"#;

/// A table of rows of frame, id, x, y, z.
fn table(rows: &[(usize, u64, [f64; 3])]) -> String {
    let row = |(frame, id, [x, y, z]): &(usize, u64, [f64; 3])| format!("{frame},{id},{x},{y},{z},9\n");
    HEAD.to_owned() + &rows.iter().map(row).collect::<String>()
}

/// A case of three particles in two frames, and an empty result.
fn case(bench: &Workbench) {
    for folder in ["case/truth", "result"] {
        fs::create_dir_all(bench.path(folder)).unwrap();
    }
    bench.write("case/truth/camera.json", CAMERA);
    bench.write("case/truth/scene.json", SCENE);
    let std = json!([0.5 * PIXEL, 0.5 * PIXEL]);
    let bound = json!({"by_depth": {"z_mm": [0, 2], "sx_mm": std, "sy_mm": std, "sz_mm": [null, 2.0 * PIXEL]}});
    bench.write("case/truth/bound.json", bound.to_string());
    let places = [[0.0, 0.0, 0.5], [1.0, 0.5, 2.0], [2.0, 1.0, 1.0]];
    let mut rows = Vec::new();
    for ([x, y, z], id) in places.into_iter().zip(0..) {
        rows.extend([(0, id, [x, y, z]), (1, id, [x + 0.02 * z, y + 0.04, z])]);
    }
    bench.write("case/truth/particles.csv", table(&rows));
}

fn near(found: &Value, wanted: f64) -> bool {
    found.as_f64().is_some_and(|found| (found - wanted).abs() < 1e-4)
}

/// By hand: the second particle is found in both frames, 1 px too far along x and, in frame 1, 10 px along z.
#[test]
fn particles_and_tracks_by_hand() {
    let bench = workbench();
    case(&bench);
    let found =
        [(0, 7, [1.0 + PIXEL, 0.5, 2.0]), (1, 7, [1.04 + PIXEL, 0.54, 2.0 + 10.0 * PIXEL]), (1, 8, [0.0, 0.04, 2.0])];
    bench.write("result/particles.csv", table(&found));
    bench.write("result/tracks.csv", table(&found));
    bench.write("result/cost.json", r#"{"seconds": 3.5, "peak_bytes": 1000}"#);
    let score = bench.run("score case result").silent_json();
    let particles = &score["particles"];
    assert_eq!([&particles["truth"], &particles["found"], &particles["matched"]], [6, 3, 2], "{score}");
    assert!(near(&particles["rms_x_px"], 1.0) && near(&particles["p90_z_px"], 9.0), "{particles}");
    // Errors of 1 px over a bound of 0.5, and of 0 and 10 px over 2.
    assert!(near(&particles["over_bound_x"], 2.0 * 1.4826) && near(&particles["over_bound_z"], 2.5 * 1.4826));
    let tracks = &score["tracks"];
    assert_eq!([&tracks["truth"], &tracks["found"], &tracks["matched"]], [3, 1, 1]);
    assert!(near(&tracks["rms_z_px"], 5.0) && near(&tracks["rms_w_px"], 10.0) && near(&tracks["rms_v_px"], 0.0));
    assert_eq!((&score["seconds"], &score["peak_bytes"], score.get("field")), (&json!(3.5), &json!(1000), None));
}

#[test]
fn a_field_is_scored_from_exr_and_netcdf_alike() {
    let bench = workbench();
    case(&bench);
    let measured = field([3, 3, 3], |[_, _, z]| [(0.02 * z + 2.0 * PIXEL) as f32, 0.04, 0.0]);
    let scores = ["field.exr", "field.nc"].map(|name| {
        measured.save(&bench.path(format!("result/{name}"))).unwrap();
        let score = bench.run("score case result").silent_json();
        fs::remove_file(bench.path(format!("result/{name}"))).unwrap();
        score["field"].clone()
    });
    assert!(near(&scores[0]["rms_u_px"], 2.0) && near(&scores[0]["rms_v_px"], 0.0), "{}", scores[0]);
    // A mean over any cube is the same in a shear.
    assert_eq!((&scores[0]["vectors"], &scores[0]["resolution_mm"]), (&json!(27), &Value::Null));
    assert_eq!(scores[0], scores[1]);
}

#[test]
fn what_lacks_is_named() {
    let bench = workbench();
    case(&bench);
    bench.run("score case result").refused("result: no result");
    bench.write("result/particles.csv", table(&[(0, 7, [1.0, 0.5, 2.0])]));
    fs::remove_file(bench.path("case/truth/bound.json")).unwrap();
    bench.run("score case result").refused("case/truth/bound.json");
    bench.write("case/truth/bound.json", "{}");
    bench.run("score case result").refused("case/truth/bound.json");
}
