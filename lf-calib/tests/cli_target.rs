//! The command lines of `volume` and `refine`: refusals that leave nothing behind, and the camera they write.

use crate::scenes::points;
use crate::workbench::{refused, workbench};
use lf_core::Camera;
use lf_tests::Workbench;
use ndarray::Array2;
use serde_json::json;
use std::fs;

/// The tool in a folder with a camera of 20 lenslets, dark images of its size, and one of another size.
fn camera_and_images() -> Workbench {
    let bench = workbench();
    bench.write("camera.json", points::camera(20).to_json());
    for name in ["a.exr", "b.exr", "c.exr"] {
        bench.image(name, &Array2::from_elem((280, 280), 3.0));
    }
    bench.image("small.exr", &Array2::from_elem((20, 30), 3.0));
    bench.write("target.csv", "# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n0,0,0,0,3,1\n1,0,0,0,-3,1\n");
    fs::create_dir(bench.path("empty")).unwrap();
    bench
}

#[test]
fn targets_that_cannot_be_used() {
    let bench = camera_and_images();
    let unusable =
        |rest: &str, message: &str| refused(&bench, &format!("volume -c camera.json -o out {rest}"), message);
    let grid = "--spacing 0.3 --depths 3,-3";
    unusable(
        "a.exr small.exr --spacing 0.3 --depths 3,-3",
        "small.exr: image of 30 x 20 px; wanted the camera's 280 x 280 px",
    );
    unusable(
        &format!("a.exr b.exr {grid}"),
        "a.exr: no target: 0 of the 9 dots in view; wanted bright dots on a dark ground, where the target has them",
    );
    unusable(
        "a.exr b.exr --spacing 0.3 --depths 0,3",
        "the target: 1 of 2 images at depths out of focus; wanted 2 depths or more beyond -1.55 and 1.53 mm, where a \
         dot lights 5 lenslets across",
    );
    unusable("a.exr b.exr --spacing 0.3 --depths 3", "--depths: 1 depths for 2 images; wanted one for each image");
    unusable(
        "z+11.exr z+3.exr --spacing 0.3 --depths 3,11",
        "--depths: the names of the images say 11,3 in this order; wanted the order of the images, or no --depths",
    );
    unusable(
        "a.exr b.exr --spacing 0.3 --depths 3,x",
        "--depths: 3,x; wanted numbers between commas, mm, or a table FILE.csv",
    );
    unusable("a.exr b.exr --spacing -1 --depths 3,4", "--spacing: -1; wanted a positive length, mm");
    unusable(
        "a.exr b.exr --spacing 0.3 --depths 3,395",
        "the target: depth 395 mm is too near the main lens, which stands 400.0 mm before the focal plane; wanted depths \
         in front of the main lens",
    );
    let wanted = "wanted --spacing MM, with --depths or with depths in the images' names; or --target FILE";
    unusable("a.exr b.exr", &format!("the target: not given; {wanted}"));
    unusable("a.exr b.exr --depths 3,-3", &format!("the target: not given; {wanted}"));
    let wanted = "wanted z and a number in every name, such as dots_z-2.70.tif or z+4mm.tif, or --depths";
    unusable("a.exr b.exr --spacing 0.3", &format!("a.exr: no depth in its name; {wanted}"));
    bench.write("depths.csv", "file,depth_mm\na.exr,3\n");
    unusable(
        "a.exr b.exr --spacing 0.3 --depths depths.csv",
        "depths.csv: no depth of b.exr; wanted a line for each image, with its name and depth",
    );
    unusable("a.exr b.exr --spacing 0.3 --depths none.csv", "none.csv: no such file; wanted a file to read");
    unusable(
        &format!("a.exr b.exr --target target.csv {grid}"),
        "--target: given with --spacing or --depths; wanted one or the other",
    );
    unusable(
        "a.exr b.exr c.exr --target target.csv",
        "target.csv: dots of 2 frames for 3 images; wanted the table of a target's dots",
    );
    unusable("a.exr b.exr --target none.csv", "none.csv: no such file; wanted a file to read");
    unusable("none.exr b.exr --target target.csv", "none.exr: no such file; wanted a file to read");
    unusable("empty", "empty: no TIFF, PNG or EXR; wanted a folder of images of a target");
    refused(
        &bench,
        &format!("volume a.exr b.exr {grid} -c camera.json -o a.exr"),
        "a.exr: is also an input; wanted another file to write to",
    );
    bench.run("volume -c camera.json -o out").refused("");
}

#[test]
fn evidence_that_cannot_be_used() {
    let bench = camera_and_images();
    let camera = Camera::open(&bench.path("camera.json")).unwrap();
    let evidence = |camera: Camera, key: &str, value: f64| {
        json!({"camera": camera, "frame": 3, "particles": 9, "chi2": 1.0, "parameters": [key], "value_px": [value],
            "gradient": [0.0], "information": [[1e6]]})
    };
    let other = Camera { blur: Some(Default::default()), ..camera.clone() };
    bench.write("other.json", evidence(other, "drift_x_px", 0.1).to_string());
    bench.write("unknown.json", evidence(camera.clone(), "zoom", 0.1).to_string());
    let mut short = evidence(camera.clone(), "drift_x_px", 0.1);
    short["gradient"] = json!([]);
    bench.write("short.json", short.to_string());
    bench.write("good.json", evidence(camera, "drift_x_px", 0.1).to_string());
    let unusable =
        |rest: &str, message: &str| refused(&bench, &format!("refine -c camera.json -o out {rest}"), message);
    unusable("good.json other.json", "other.json: of another camera; wanted lf-fit -c camera.json");
    unusable("unknown.json", "unknown.json: parameter 'zoom'; wanted what lf-fit --evidence wrote");
    let uneven = "its lists differ in length or are not numbers; wanted what lf-fit --evidence wrote";
    unusable("short.json", &format!("short.json: {uneven}"));
    unusable("none.json", "none.json: no such file; wanted a file to read");
    refused(
        &bench,
        "refine good.json -c camera.json -o good.json",
        "good.json: is also an input; wanted another file to write to",
    );

    // A camera that is off by what its frame says.
    let said = bench.run("refine good.json -c camera.json -o refined.json --stats stats.json");
    let wanted = "the place of the lenslets along x is 0.1000 +- 0.0018 px too small";
    assert!(said.stderr.contains(wanted), "{}", said.stderr);
    let [refined, given] = ["refined.json", "camera.json"].map(|name| Camera::open(&bench.path(name)).unwrap());
    let moved = refined.microlenses.offset_mm[0] - given.microlenses.offset_mm[0];
    assert!((moved / given.sensor.pixel_pitch_mm - 0.1).abs() < 1e-9 && refined.calibration.is_some());
}

/// A folder as `lf-synth dots` writes it gives a camera that keeps the other contents of its file, with the same bytes
/// for any number of threads.
#[test]
fn a_folder_of_images_gives_a_camera() {
    let bench = camera_and_images();
    let mut camera = points::camera(46);
    camera.calibration = Some(serde_json::json!({"lattice": {"lenslets": 7}}));
    bench.write("camera.json", camera.to_json());
    let mut table = "# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n".to_string();
    fs::create_dir(bench.path("target")).unwrap();
    for (n, z) in [-3.5, 3.5].into_iter().enumerate() {
        let dots = points::grid(3, 0.8, z);
        let pixels = points::image(&camera, &dots, 0.03, 4e5);
        bench.image(&format!("target/dots-000{n}.exr"), &pixels);
        for (id, dot) in dots.iter().enumerate() {
            table += &format!("{n},{id},{},{},{},1\n", dot.x, dot.y, dot.z);
        }
    }
    bench.write("target/dots.csv", table);
    let one = bench.run("volume target -c camera.json --threads 1 --stats stats.json");
    assert!(one.status.success(), "{one:?}");
    assert_eq!(bench.run("volume target -c camera.json --threads 3").stdout, one.stdout);
    let grid = "volume target/dots-0000.exr target/dots-0001.exr -c camera.json --spacing 0.8 --depths -3.5,3.5";
    let by_grid = bench.run(grid);
    assert!(by_grid.status.success(), "{by_grid:?}");
    // The names, and a table, of images in a folder give the same depths.
    fs::create_dir(bench.path("named")).unwrap();
    for (n, z) in ["z-3.5", "z+3.5mm"].into_iter().enumerate() {
        fs::copy(bench.path(format!("target/dots-000{n}.exr")), bench.path(format!("named/dots_{z}.exr"))).unwrap();
    }
    let without_history = |run: &lf_tests::Ended| {
        let mut camera = run.json();
        camera["calibration"].as_object_mut().unwrap().remove("history");
        camera
    };
    // The images are sorted by their names: '+' stands before '-'.
    let by_name = bench.run("volume named -c camera.json --spacing 0.8");
    assert!(by_name.status.success(), "{by_name:?}");
    fs::copy(bench.path("named/dots_z-3.5.exr"), bench.path("named/other.exr")).unwrap();
    bench.write("depths.csv", "file,depth_mm\ndots_z-3.5.exr,-3.5\ndots_z+3.5mm.exr,3.5mm\n");
    let by_table = bench.run("volume named -c camera.json --spacing 0.8 --depths depths.csv");
    assert!(by_table.status.success(), "{by_table:?}");
    assert!(by_table.stderr.contains("named/other.exr is left out: depths.csv does not list it"));
    assert_eq!(without_history(&by_name), without_history(&by_table));
    let magnification = |camera: &serde_json::Value| camera["main_lens"]["magnification"].as_f64().unwrap();
    let [names, grid] = [&by_name, &by_grid].map(|run| magnification(&without_history(run)));
    assert!((names - grid).abs() < 1e-6, "{names} {grid}");
    let found: serde_json::Value = serde_json::from_slice(&one.stdout).unwrap();
    assert_eq!(found["calibration"]["lattice"]["lenslets"], 7);
    let volume = &found["calibration"]["volume"];
    assert!(volume["parameters"]["magnification"]["standard_uncertainty"].as_f64().unwrap() > 0.0);
    // A lattice measured from a white image is kept. The traverse may still be skew.
    assert!(volume["parameters"]["offset_x_mm"].is_null() && !volume["parameters"]["traverse_skew_x_rad"].is_null());
    let stats: serde_json::Value = serde_json::from_str(&bench.text("stats.json")).unwrap();
    assert_eq!(stats["counts"]["dots"], 9);
}
