//! The command line of lf-calib.

use crate::scenes;
use crate::workbench::{self, workbench};
use lf_core::{Camera, camera::Layout, camera::MainLens, image};
use lf_tests::Workbench;
use ndarray::Array2;
use serde_json::Value;
use std::fs::{self, File};

use std::path::Path;

/// The tool in a folder with a camera, a white image of it and three frames.
fn camera_and_images() -> Workbench {
    let bench = workbench();
    bench.write("nominal.json", scenes::nominal(&truth()).to_json());
    bench.image("white.exr", &scenes::discs(&truth(), 0.9));
    for n in 0..3 {
        let frame = Array2::from_shape_fn((5, 7), |(row, column)| ((row * 7 + column + 5 * n) % 13) as f32);
        bench.image(&format!("frame-{n}.exr"), &frame);
    }
    bench
}

/// Runs a line without its warnings; it must be refused with exactly this message.
fn refused(bench: &Workbench, line: &str, message: &str) {
    workbench::refused(bench, &format!("{line} -q"), message);
}

fn truth() -> Camera {
    scenes::camera(280, Layout::Hexagonal, 0.003, [0.0123, -0.0257])
}

#[test]
fn the_camera_is_the_nominal_one_with_measured_microlenses() {
    let bench = camera_and_images();
    bench.done("lattice white.exr -c nominal.json -o out");
    let camera = Camera::open(&bench.path("out")).unwrap();
    let (truth, nominal) = (truth(), scenes::nominal(&truth()));
    assert_eq!(camera.sensor, nominal.sensor);
    // Discs of 0.9 pitches of 14 px; the data sheet says 14 px.
    assert!((camera.main_lens.working_f_number * 0.9 / 4.0 - 1.0).abs() < 0.005, "{:?}", camera.main_lens);
    let lens = MainLens { working_f_number: nominal.main_lens.working_f_number, ..camera.main_lens.clone() };
    assert_eq!(lens, nominal.main_lens);
    assert_eq!(camera.microlenses.layout, Layout::Hexagonal);
    assert!(scenes::farthest_px(&camera, &truth) < 0.003);
    let measured = &camera.calibration.unwrap()["lattice"];
    for key in
        ["image_pitch_px", "residual_rms_px", "departure_degree", "lenslets", "contrast", "micro_image_px", "fill"]
    {
        assert!(measured[key].as_f64().is_some(), "{key} in {measured}");
    }
    for key in ["pitch_mm", "rotation_rad", "offset_mm"] {
        assert!(measured["standard_uncertainty"][key].as_f64().unwrap() > 0.0, "{key}");
    }
}

#[test]
fn file_pipe_and_redirect_give_the_same_bytes() {
    let bench = camera_and_images();
    let from_file = bench.done("lattice white.exr -c nominal.json").stdout;
    bench.done("lattice white.exr -c nominal.json -o out");
    assert_eq!(bench.bytes("out"), from_file);
    let white = || bench.bytes("white.exr");
    assert_eq!(bench.feed("lattice -c nominal.json", white()).stdout, from_file);
    assert_eq!(bench.feed("lattice - -c nominal.json", white()).stdout, from_file);
    let redirected = bench.call("lattice -c nominal.json").redirect(&bench.path("white.exr")).run();
    assert_eq!(redirected.stdout, from_file);

    let from_files = bench.done("background frame-0.exr frame-1.exr").stdout;
    let frame = bench.bytes("frame-0.exr");
    assert_eq!(bench.feed("background - frame-1.exr", frame).stdout, from_files);
}

#[test]
fn any_number_of_threads_and_a_second_run_give_the_same_bytes() {
    let bench = camera_and_images();
    for line in ["lattice white.exr -c nominal.json", "background frame-0.exr frame-1.exr frame-2.exr --quantile 0.3"] {
        let once = bench.done(line).stdout;
        for threads in [1, 2, 4] {
            assert_eq!(bench.done(&format!("{line} --threads {threads}")).stdout, once, "{line}, {threads} threads");
        }
    }
}

#[test]
fn several_whites_are_averaged() {
    let bench = camera_and_images();
    let white = image::open(&bench.path("white.exr")).unwrap().pixels;
    bench.image("dim.exr", &white.mapv(|value| 0.5 * value));
    bench.image("bright.exr", &white.mapv(|value| 1.5 * value));
    let one = bench.done("lattice white.exr -c nominal.json").stdout;
    let two = bench.done("lattice dim.exr bright.exr -c nominal.json").stdout;
    let pitch =
        |text: &[u8]| serde_json::from_slice::<Value>(text).unwrap()["microlenses"]["pitch_mm"].as_f64().unwrap();
    assert!((pitch(&one) - pitch(&two)).abs() < 1e-9);
}

#[test]
fn history_and_earlier_calibration_are_kept() {
    let bench = camera_and_images();
    let mut nominal = scenes::nominal(&truth());
    nominal.calibration = Some(serde_json::json!({"focus": {"depth_mm": 0.25}}));
    bench.write("nominal.json", nominal.to_json());
    bench.call("lattice white.exr -c nominal.json -o once").with_history().run().done();
    bench.call("lattice white.exr -c once -o twice").with_history().run().done();
    let calibration = Camera::open(&bench.path("twice")).unwrap().calibration.unwrap();
    assert_eq!(calibration["focus"]["depth_mm"], 0.25);
    assert_eq!(calibration["history"].as_array().unwrap().len(), 2);
    assert_eq!(calibration["history"][0]["tool"], "lf-calib");
}

#[test]
fn background_is_the_minimum_or_a_quantile() {
    let bench = camera_and_images();
    bench.done("background frame-0.exr frame-1.exr frame-2.exr -o lowest.exr");
    bench.done("background frame-0.exr frame-1.exr frame-2.exr --quantile 0.25 -o low.exr");
    let [lowest, low] = ["lowest.exr", "low.exr"].map(|name| image::open(&bench.path(name)).unwrap().pixels);
    // Pixel 3 counts 3, 8 and 0; pixel 9 counts 9, 1 and 6. The quantile 0.25 lies half way from the lowest to the
    // next.
    assert_eq!((lowest[(0, 3)], low[(0, 3)]), (0.0, 1.5));
    assert_eq!((lowest[(1, 2)], low[(1, 2)]), (1.0, 3.5));
}

// Scar: one broken file among hundreds stopped a whole campaign.
#[test]
fn a_background_leaves_out_frames_of_other_cameras() {
    let bench = camera_and_images();
    let mut small = scenes::nominal(&truth());
    (small.sensor.width, small.sensor.height) = (7, 5);
    bench.write("small.json", small.to_json());
    let whole = bench.bytes("frame-1.exr");
    bench.write("cut.exr", &whole[..whole.len() / 2]);
    bench.done("background frame-0.exr frame-2.exr --quantile 0.3 -o two.exr");
    let lenient = bench
        .done("background cut.exr frame-0.exr none.exr white.exr frame-2.exr -c small.json --quantile 0.3 -o some.exr");
    let [two, some] = ["two.exr", "some.exr"].map(|name| image::open(&bench.path(name)).unwrap().pixels);
    assert_eq!(two, some);
    let said = lenient.stderr;
    let left_out = said.lines().filter(|line| line.starts_with("lf-calib: warning: left out: ")).count();
    assert!(left_out == 3 && said.lines().count() == 4 && said.contains("in all 2 frames"), "{said}");
    assert!(said.contains("white.exr: 280 x 280 px; wanted 7 x 5 px, the camera's sensor"), "{said}");
    let lost = "cut.exr: cannot be decoded (invalid: reference to missing bytes); wanted a whole, valid file";
    refused(&bench, "background cut.exr -c small.json -o out.exr", lost);
    assert!(!bench.path("out.exr").exists());
}

#[test]
fn stats_count_the_lenslets() {
    let bench = camera_and_images();
    bench.done("lattice white.exr -c nominal.json -o out --stats stats.json");
    let stats: Value = bench.json("stats.json");
    assert!(stats["counts"]["lenslets"].as_u64().unwrap() > 400);
    assert!(stats["phases"]["lattice"].as_f64().is_some());
}

#[test]
fn whites_that_cannot_be_used() {
    let bench = camera_and_images();
    bench.image("small.exr", &Array2::zeros((20, 30)));
    refused(
        &bench,
        "lattice white.exr small.exr -c nominal.json -o out",
        "small.exr: image of 30 x 20 px; wanted the camera's 280 x 280 px",
    );
    refused(&bench, "lattice none.exr -c nominal.json -o out", "none.exr: no such file; wanted a file to read");
    let wanted = "wanted a white image with dark gaps between the discs of the lenslets";
    bench.image("flat.exr", &Array2::from_elem((280, 280), 7.0));
    refused(&bench, "lattice flat.exr -c nominal.json -o out", &format!("flat.exr: flat, 7 everywhere; {wanted}"));
    let square = scenes::squares(&scenes::camera(280, Layout::Square, 0.0, [0.0, 0.0]), 1.0);
    bench.image("square.exr", &square);
    let line = "lattice square.exr -c nominal.json -o out";
    refused(
        &bench,
        line,
        &format!("square.exr: no lattice: the periodic part has a contrast of 0.38 %; {wanted} (at least 2 %)"),
    );
    let mut dark = Array2::zeros((280, 280));
    dark[(3, 4)] = f32::NAN;
    bench.image("nan.exr", &dark);
    refused(
        &bench,
        "lattice nan.exr -c nominal.json -o out",
        "nan.exr: 1 pixel is not finite, the first NaN at x 4, y 3; wanted finite values",
    );
    // Twelve bits, as they are and shifted left.
    for (full, scale) in [("4095", 1.0), ("65520", 16.0)] {
        let mut clipped = scenes::discs(&truth(), 0.9) * 4.5 + 50.0;
        scenes::noisy(&mut clipped, 0.05);
        bench.image("clipped.exr", &clipped.mapv(|value| value.round().min(4095.0) * scale));
        let message = bench.run("lattice clipped.exr -c nominal.json -o out").refused("clipped.exr").stderr;
        let found = format!("at {full}, the highest count; wanted at most 2 %");
        assert!(message.contains("saturated") && message.contains(&found), "{message}");
    }
    assert!(!bench.path("out").exists());
}

#[test]
fn colour_needs_a_channel() {
    let bench = camera_and_images();
    let colour = ::image::RgbImage::from_fn(7, 5, |x, y| ::image::Rgb([x as u8, (3 * y) as u8, 0]));
    colour.save(bench.path("colour.png")).unwrap();
    let wanted = "wanted equal channels, or --channel r, g, b or luma";
    let found = "colour.png: colour, 34 pixels are not grey, the first at x 1, y 0 (red 1, green 0, blue 0)";
    refused(&bench, "background colour.png -o out", &format!("{found}; {wanted}"));
    refused(&bench, "lattice colour.png -c nominal.json -o out", &format!("{found}; {wanted}"));
    assert!(!bench.path("out").exists());
    bench.done("background colour.png --channel g -o green.exr");
    let green = image::open(&bench.path("green.exr")).unwrap().pixels;
    assert_eq!(green, Array2::from_shape_fn((5, 7), |(y, _)| 3.0 * y as f32));
}

#[test]
fn arguments_that_cannot_be_used() {
    let bench = camera_and_images();
    refused(
        &bench,
        "lattice white.exr -c nominal.json -o white.exr",
        "white.exr: is also an input; wanted another file to write to",
    );
    refused(&bench, "lattice - -c - -o out", "standard input: named more than once; wanted - for one input only");
    refused(&bench, "background frame-0.exr --quantile 0.7 -o out.exr", "--quantile: 0.7; wanted 0 to 0.5");
    refused(&bench, "background frame-0.exr --quantile NaN -o out.exr", "--quantile: NaN; wanted 0 to 0.5");
    refused(
        &bench,
        "background frame-0.exr frame-1.exr white.exr -o out.exr",
        "white.exr: image of 280 x 280 px; wanted 7 x 5 px like the first",
    );
    refused(
        &bench,
        "lattice white.exr -c nominal.json -o none/out",
        "none/out: its folder does not exist; wanted an existing folder",
    );
    for line in ["", "lattice", "lattice white.exr", "volume white.exr -c nominal.json"] {
        bench.run(line).refused("");
    }
}

#[test]
fn a_full_disk_is_an_error() {
    if !Path::new("/dev/full").exists() {
        return;
    }
    let bench = camera_and_images();
    for line in ["lattice white.exr -c nominal.json -q -o /dev/full", "background frame-0.exr -o /dev/full"] {
        bench.run(line).refused("");
    }
}

#[test]
fn micro_images_that_do_not_fill_the_pitch_are_warned_of_with_the_figure() {
    let bench = camera_and_images();
    let words = |line: &str| bench.done(line).stderr;
    let line = "lattice white.exr -c nominal.json -o out";
    // Discs of 0.9 pitches of 14 px; the data sheet says 14 px.
    assert!(words(line).contains("warning: lenslet images are 12.6"), "{}", words(line));
    let mut nominal = scenes::nominal(&truth());
    nominal.main_lens.working_f_number = 4.0 / 0.9;
    bench.write("nominal.json", nominal.to_json());
    assert!(words(line).contains("warning: lenslet images underfill the pitch: 12.6"), "{}", words(line));
    let said = words(line);
    let (_, unused) = said.split_once("12.61 of 14.01 px, 10.0 +- 0.").unwrap_or_else(|| panic!("{said}"));
    assert!(unused[1..].starts_with(" % unused; f-number 4.0"), "{said}");
    assert!(bench.done("lattice white.exr -c nominal.json -q").stderr.is_empty());
}

#[test]
fn a_dark_image_is_subtracted() {
    let bench = camera_and_images();
    let white = image::open(&bench.path("white.exr")).unwrap().pixels;
    let dark = Array2::from_shape_fn(white.dim(), |(row, column)| ((row / 40 + column / 40) % 3 * 200) as f32);
    bench.image("raised.exr", &(&white + &dark));
    bench.image("dark.exr", &dark);
    let pitch = |line: &str| {
        let camera: Value = serde_json::from_slice(&bench.done(line).stdout).unwrap();
        camera["microlenses"]["pitch_mm"].as_f64().unwrap()
    };
    let plain = pitch("lattice white.exr -c nominal.json");
    assert!((pitch("lattice raised.exr --dark dark.exr -c nominal.json") / plain - 1.0).abs() < 1e-7);
    // Scar: a white image less a dark one, pixels of which were negative, was refused.
    bench.image("less.exr", &(&white - 30.0));
    assert!((pitch("lattice less.exr -c nominal.json") / plain - 1.0).abs() < 1e-7);
    bench.image("small.exr", &Array2::zeros((20, 30)));
    refused(
        &bench,
        "lattice white.exr --dark small.exr -c nominal.json -o out",
        "small.exr: image of 30 x 20 px; wanted the camera's 280 x 280 px",
    );
    refused(
        &bench,
        "lattice white.exr --dark none.exr -c nominal.json -o out",
        "none.exr: no such file; wanted a file to read",
    );
}

#[test]
fn every_lenslet_that_was_read_is_a_line_of_the_table() {
    let bench = camera_and_images();
    bench.done("lattice white.exr -c nominal.json -o out --centres out.csv");
    let table = bench.text("out.csv");
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("i,j,x_px,y_px,residual_x_px,residual_y_px,kept"));
    let (lattice, mut count) = (Camera::open(&bench.path("out")).unwrap().lattice(), 0);
    for line in lines {
        let n: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        let fitted = lattice.centre_mm(n[0] as i64, n[1] as i64) * 1.00077 / 0.0055 + 140.0;
        assert!((n[2] - n[4] - fitted.x).abs() < 1e-4 && (n[3] - n[5] - fitted.y).abs() < 1e-4, "{line}");
        count += 1;
    }
    assert!(count > 400, "{count}");
}

#[test]
fn a_vignetted_frame_over_the_flat_field_is_the_plain_one() {
    let bench = camera_and_images();
    let truth = truth();
    let plain = scenes::discs(&truth, 1.0);
    let half = 140.0f32;
    let share = |row: usize, column: usize| {
        let place = [column, row].map(|n| (n as f32 + 0.5 - half) / half);
        1.0 - 0.3 * (place[0] * place[0] + place[1] * place[1])
    };
    let dead = lf_core::lattice::Lattice::centre_mm(&truth.lattice(), 4, -3) * 1.00077 / 0.0055 + 140.0;
    let is_dead = |row: usize, column: usize| (column as f64 + 0.5 - dead.x).hypot(row as f64 + 0.5 - dead.y) < 5.0;
    let seen = |light: &Array2<f32>| {
        Array2::from_shape_fn(light.dim(), |(row, column)| {
            if is_dead(row, column) { 0.0 } else { light[(row, column)] * share(row, column) }
        })
    };
    bench.image("white.exr", &seen(&plain));
    // A frame that is brighter to the right.
    let frame = Array2::from_shape_fn(plain.dim(), |(row, column)| plain[(row, column)] * (50 + column) as f32);
    bench.image("frame.exr", &seen(&frame));
    bench.done("lattice white.exr -c nominal.json -o out --vignetting flat.exr");
    let camera = Camera::open(&bench.path("out")).unwrap();
    assert_eq!(camera.vignetting.as_deref(), Some(Path::new("flat.exr")));
    let mended = image::open_frame(&bench.path("frame.exr"), Default::default(), &camera, &bench.path("out"), None)
        .unwrap()
        .pixels;
    let scale = mended[(140, 140)] / frame[(140, 140)];
    let mut blind = 0;
    assert!(plain[(140, 140)] > 999.0);
    for ((row, column), value) in mended.indexed_iter() {
        if is_dead(row, column) {
            assert!(value.is_nan() || plain[(row, column)] < 100.0, "{row} {column}: {value}");
            blind += usize::from(value.is_nan());
        } else if plain[(row, column)] > 500.0 {
            // At the rim, an error of 0.01 px changes the light of a pixel by a few per cent.
            let limit = if plain[(row, column)] > 999.0 { 5e-3 } else { 0.06 };
            let ratio = value / frame[(row, column)];
            assert!((ratio / scale - 1.0).abs() < limit, "{row} {column}: {ratio}, not {scale}");
        }
    }
    assert!((scale - 0.8).abs() < 0.1 && blind > 60, "{scale} {blind}");
}

#[test]
fn the_camera_names_a_flat_field_in_another_folder_by_its_full_path() {
    let bench = camera_and_images();
    fs::create_dir(bench.path("maps")).unwrap();
    let output = bench.done("lattice white.exr -c nominal.json -o out --vignetting maps/flat.exr");
    let words = output.stderr;
    assert!(words.contains("the camera names its flat field by its full path"), "{words}");
    let camera = Camera::open(&bench.path("out")).unwrap();
    assert!(image::open(&camera.flat_field(&bench.path("out")).unwrap()).is_ok());
    // A second calibration keeps the flat field of its nominal camera.
    bench.done("lattice white.exr -c out -o maps/again.json -q");
    let again = Camera::open(&bench.path("maps/again.json")).unwrap();
    assert!(image::open(&again.flat_field(&bench.path("maps/again.json")).unwrap()).is_ok());
}

#[test]
fn the_picture_is_an_svg_with_units() {
    let bench = camera_and_images();
    bench.done("lattice white.exr -c nominal.json -o out --plot out.svg -q");
    let svg = bench.text("out.svg");
    for words in ["<svg", "</svg>", "Lenslet images: hexagonal, pitch 14.0", "px RMS", "residual: measured", "280 px"] {
        assert!(svg.contains(words), "{words}");
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused() {
    let bench = camera_and_images();
    let line = "lattice white.exr -c nominal.json -o out";
    refused(
        &bench,
        &format!("{line} --plot p.jpg"),
        "p.jpg: the name of a .jpg file; wanted FILE.svg, FILE.png or FILE.pdf, the formats drawn",
    );
    let wanted = "wanted FILE.exr, which the camera can name";
    refused(&bench, &format!("{line} --vignetting v.tif"), &format!("v.tif: not the name of an EXR; {wanted}"));
    refused(&bench, &format!("{line} --vignetting -"), &format!("standard output: not the name of an EXR; {wanted}"));
    refused(&bench, &format!("{line} --centres out"), "out: named for two outputs; wanted a file for each");
    refused(
        &bench,
        &format!("{line} --centres white.exr"),
        "white.exr: is also an input; wanted another file to write to",
    );
    refused(
        &bench,
        &format!("{line} --centres none/t.csv"),
        "none/t.csv: its folder does not exist; wanted an existing folder",
    );
}

/// A TIFF of 16-bit pages that differ by their number.
fn stack(path: &Path, pages: u16) {
    let mut encoder = tiff::encoder::TiffEncoder::new(File::create(path).unwrap()).unwrap();
    for page in 0..pages {
        let pixels: Vec<u16> = (0..35).map(|n| (n + 5 * page) % 13).collect();
        encoder.write_image::<tiff::encoder::colortype::Gray16>(7, 5, &pixels).unwrap();
    }
}

#[test]
fn pages_of_a_stack_are_frames() {
    let bench = camera_and_images();
    stack(&bench.path("stack.tif"), 3);
    for options in ["", " --quantile 0.25"] {
        let files = bench.done(&format!("background frame-0.exr frame-1.exr frame-2.exr{options}")).stdout;
        assert_eq!(bench.done(&format!("background stack.tif{options}")).stdout, files, "{options}");
        let bytes = bench.bytes("stack.tif");
        assert_eq!(bench.feed(&format!("background -{options}"), bytes).stdout, files, "{options}");
    }
    stack(&bench.path("two.tif"), 2);
    let files = bench.done("background frame-0.exr frame-1.exr frame-2.exr").stdout;
    assert_eq!(bench.done("background two.tif frame-2.exr").stdout, files);
    // Pages by name; the file stays an input.
    let files = bench.done("background frame-2.exr frame-0.exr").stdout;
    assert_eq!(bench.done("background stack.tif:2 stack.tif:0").stdout, files);
    let message = "stack.tif: is also an input; wanted another file to write to";
    refused(&bench, "background stack.tif:2 -o stack.tif", message);
    let message = "stack.tif:3: no page 3, the file has 3 pages; wanted a page from 0 to 2";
    refused(&bench, "background stack.tif:3", message);
    // Every page is a white image; where one image is wanted, a page must be named.
    let message = "stack.tif:0: image of 7 x 5 px; wanted the camera's 280 x 280 px";
    refused(&bench, "lattice stack.tif -c nominal.json -o out", message);
    let message = "stack.tif: 3 pages; wanted one of them, stack.tif:0 to stack.tif:2";
    refused(&bench, "lattice white.exr --dark stack.tif -c nominal.json -o out", message);
    let input = bench.feed("lattice -c nominal.json -o out", bench.bytes("stack.tif")).stderr;
    assert!(input.contains("standard input: 3 pages; wanted one of them, FILE:0 to FILE:2"), "{input}");
}

#[test]
fn stacks_that_cannot_be_used_leave_no_background() {
    let bench = camera_and_images();
    stack(&bench.path("stack.tif"), 3);
    let whole = bench.bytes("stack.tif");
    for length in [whole.len() - 4, whole.len() / 2, 200, 9] {
        bench.write("cut.tif", &whole[..length]);
        bench.run("background cut.tif -o out.exr").refused("lf-calib: cut.tif");
        assert!(!bench.path("out.exr").exists());
    }
    bench.image("other.exr", &Array2::zeros((5, 8)));
    refused(
        &bench,
        "background other.exr stack.tif -o out.exr",
        "stack.tif:0: image of 7 x 5 px; wanted 8 x 5 px like the first",
    );
}
