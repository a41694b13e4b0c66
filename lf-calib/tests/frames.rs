//! `lf-calib frame`, and the backgrounds beside the quantile.

use crate::workbench::workbench;
use lf_core::history::Step;
use lf_core::image;
use lf_tests::Workbench;
use ndarray::{Array2, s};
use std::fs::File;

/// Five pairs of frames: a particle that moves, a hot and a dead pixel, a second laser with half the light, pixels of
/// two sensitivities.
fn bench() -> Workbench {
    let bench = workbench();
    let sensitivity = Array2::from_shape_fn((12, 16), |(_, x)| if x % 2 == 0 { 1.0 } else { 0.5f32 });
    for n in 0..5 {
        for (laser, light) in [("a", 100.0), ("b", 50.0)] {
            let mut frame = Array2::from_elem((12, 16), 10.0f32);
            frame.slice_mut(s![6..11, 2 * n..2 * n + 2]).mapv_inplace(|count| count + light);
            frame *= &sensitivity;
            frame[(3, 4)] += 500.0;
            frame[(2, 11)] = 0.0;
            bench.image(&format!("{n}{laser}.exr"), &frame);
        }
    }
    let mut flat = sensitivity.mapv(|share| 1000.0 * share);
    flat[(2, 11)] = 7.0;
    bench.image("flat.exr", &flat);
    std::fs::create_dir(bench.path("out")).unwrap();
    bench
}

#[test]
fn corrections_give_even_frames_without_hot_and_dead_pixels() {
    let bench = bench();
    let firsts = "0a.exr 1a.exr 2a.exr 3a.exr 4a.exr";
    let seconds = "0b.exr 1b.exr 2b.exr 3b.exr 4b.exr";
    let line = format!("frame {firsts} --second {seconds} --flat flat.exr --hot 12 --equalise -o out");
    let ended = bench.done(&line);
    for said in ["1 hot pixels", "--hot takes 0.5 % of the pixels", "1 dead pixels", "multiplied by 2.0000"] {
        assert!(ended.stderr.contains(said), "{}", ended.stderr);
    }
    let table = String::from_utf8(ended.stdout).unwrap();
    assert_eq!(table.lines().count(), 11, "{table}");
    let first = image::open(&bench.path("out/2a.exr")).unwrap().pixels;
    let second = image::open(&bench.path("out/2b.exr")).unwrap().pixels;
    // Sensitivities are those over their median, 0.75.
    assert!((first[(8, 4)] - first[(8, 5)]).abs() < 1e-4 && (first[(8, 4)] - 0.75 * 110.0).abs() < 1e-3);
    for bad in [(3, 4), (2, 11)] {
        assert!((first[bad] - 7.5).abs() < 1e-4, "{bad:?} is like its neighbours: {}", first[bad]);
    }
    let light = |frame: &Array2<f32>| frame[(8, 4)] - frame[(1, 4)];
    assert!((light(&second) - light(&first)).abs() < 1e-3);
}

#[test]
fn nothing_is_done_unless_asked_for() {
    let bench = bench();
    bench.refused("frame 0a.exr -o out", &["frame: no correction; wanted --flat, --hot or --equalise"]);
    bench.refused("frame 0a.exr 1a.exr --hot 12 -o out", &["--hot: 2 frames; wanted 5 or more"]);
    bench.refused(
        "frame 0a.exr --equalise -o out",
        &["--equalise: frames of one laser only; wanted the frames of the second"],
    );
    bench.refused("frame 0a.exr --flat flat.exr -o none", &["none: no such folder; wanted an existing folder"]);
    bench.image("dark.exr", &Array2::zeros((12, 16)));
    bench.refused("frame 0a.exr --flat dark.exr -o out", &["dark.exr: half of its pixels have 0 counts or less"]);
    let pipe = "-: a stream, which can be read only once; wanted a file: --hot and --equalise read every frame twice";
    bench.refused("frame 0a.exr 1a.exr 2a.exr 3a.exr - --hot 12 -o out", &[&pipe.replace("-: ", "standard input: ")]);
    bench.image("small.exr", &Array2::ones((8, 16)));
    let other = "small.exr: image of 16 x 8 px; wanted 16 x 12 px like the first";
    bench.refused("frame 0a.exr small.exr --flat flat.exr -o out", &[other]);
    bench.refused("background 0a.exr small.exr --sliding 3 -o out", &[other]);
    let memory = "--sliding: 2 frames of 16 x 12 px would take about";
    bench.refused("background 0a.exr 1a.exr --sliding 3 --max-memory 0.001 -o out", &[memory]);
    bench.refused("background 0a.exr 1a.exr --max-memory 0.001 -o out.exr", &["background: the minimum of 2 frames"]);
    bench.write("camera.json", "{}");
    bench.refused("background 0a.exr 1a.exr --sliding 3 -c camera.json -o out", &["--sliding", "--camera"]);
    assert_eq!(std::fs::read_dir(bench.path("out")).unwrap().count(), 0);
}

#[test]
fn a_mean_and_a_sliding_minimum() {
    let bench = bench();
    bench.done("background 0a.exr 0b.exr --mean -o mean.exr");
    let mean = image::open(&bench.path("mean.exr")).unwrap().pixels;
    assert_eq!((mean[(8, 0)], mean[(3, 4)]), (85.0, 510.0));
    bench.done("background 0a.exr 1a.exr 2a.exr 3a.exr --sliding 3 -o out");
    let sliding = |name: &str| image::open(&bench.path(name)).unwrap().pixels;
    // The particle is at columns 2 and 3 in frame 1 only.
    assert_eq!(sliding("out/1a.exr")[(8, 2)], 10.0);
    assert_eq!(std::fs::read_dir(bench.path("out")).unwrap().count(), 4);
    bench.refused("background 0a.exr --sliding 4 -o out", &["wanted an odd number from 3 to 1001"]);
}

#[test]
fn a_background_of_few_frames_is_warned_of() {
    let bench = bench();
    let said = |words: &str| bench.done(&format!("background {words} -o out.exr")).stderr;
    assert!(said("0a.exr").contains("the background of one frame is the frame itself"));
    assert!(said("0a.exr 1a.exr").contains("in all 2 frames stays in the background"));
    assert_eq!(said("0a.exr --mean"), "");
    let five = "0a.exr 1a.exr 2a.exr 3a.exr 0b.exr";
    assert!(said(five).contains("far apart"));
    assert_eq!(said(&format!("{five} {five}")), "");
}

/// A stream of one frame is read once. Pixels that the image of even light does not show are counted.
#[test]
fn a_stream_is_corrected_by_an_image_of_even_light() {
    let bench = bench();
    let mut flat = Array2::from_elem((12, 16), 100.0);
    [(0, 0), (0, 1), (1, 0), (5, 5)].iter().for_each(|place| flat[*place] = 1.0);
    bench.image("flat.exr", &flat);
    let words = ["frame", "-", "--flat", "flat.exr", "-o", "out"];
    let ended = bench.feed(&words, bench.bytes("0a.exr")).done();
    for said in ["1 dead pixels", "3 pixels (1.56 %) are left as they are"] {
        assert!(ended.stderr.contains(said), "{}", ended.stderr);
    }
}

/// Counts that fill a range and end in a pile, as a saturated sensor gives them. The corrected frame ends in one too.
#[test]
fn clipped_frames_are_warned_of_and_stay_clipped() {
    let bench = bench();
    let clipped = Array2::from_shape_fn((60, 60), |(y, x)| ((y * 60 + x) as f32 % 400.0).min(300.0) + 700.0);
    bench.image("clipped.exr", &clipped);
    bench.image("even.exr", &Array2::from_shape_fn((60, 60), |(y, x)| 1000.0 + ((7 * y + 3 * x) % 11) as f32));
    let text = bench.done("frame clipped.exr --flat even.exr -o out").stderr;
    assert!(
        text.contains("warning: clipped.exr: 25.0 % of the pixels are clipped, at 1000 counts; 1 frames"),
        "{text}"
    );
    let corrected = image::open(&bench.path("out/clipped.exr")).unwrap();
    assert_eq!(image::clipped_share(corrected.pixels.view()).unwrap().1, 0.25);
}

#[test]
fn pages_of_a_series_are_named_in_their_order() {
    let bench = bench();
    let mut file = tiff::encoder::TiffEncoder::new(File::create(bench.path("run.tif")).unwrap()).unwrap();
    for _ in 0..11 {
        file.write_image::<tiff::encoder::colortype::Gray8>(16, 12, &[10; 12 * 16]).unwrap();
    }
    bench.done("background run.tif --sliding 3 -o out");
    let names: Vec<String> = bench.files("out").into_keys().collect();
    assert_eq!((names.len(), names[2].as_str(), names[10].as_str()), (11, "run-02.exr", "run-10.exr"));
}

/// A background names the steps of its own frame.
#[test]
fn a_sliding_background_has_the_history_of_its_frame() {
    let bench = bench();
    let step = |n: usize| Step { tool: format!("camera-{n}"), version: "1".into(), arguments: Vec::new() };
    for n in 0..4 {
        let frame = Array2::from_elem((12, 16), 10.0f32);
        image::save(&bench.path(format!("h{n}.exr")), &frame, &vec![step(n)]).unwrap();
    }
    bench.call("background h0.exr h1.exr h2.exr h3.exr --sliding 3 -o out").with_history().run().done();
    for n in 0..4 {
        let history = image::open(&bench.path(format!("out/h{n}.exr"))).unwrap().history;
        assert_eq!(history[0].tool, format!("camera-{n}"));
    }
}

/// A frame of haze, 0.7 of the white image on 50 counts, and a bright lenslet: the haze is the frame without it.
#[test]
fn haze_follows_the_white_image() {
    let bench = workbench();
    let nominal = "nominal --sensor 112x98 --pixel 5.5um --f 200 --magnification 1 --f-number 4 --pitch 77um \
         --lenslet-f 308um -o camera.json";
    bench.done(nominal);
    let aside = |n: usize| (n % 14) as f32 - 6.5;
    let white =
        Array2::from_shape_fn((98, 112), |(y, x)| 20.0 + 380.0 * (-0.05 * aside(x).hypot(aside(y)).powi(2)).exp());
    let haze = white.mapv(|light| 50.0 + 0.7 * light);
    let mut frame = haze.clone();
    frame.slice_mut(s![42..56, 42..56]).mapv_inplace(|count| count + 500.0);
    bench.image("white.exr", &white);
    bench.image("frame.exr", &frame);

    let call = "background frame.exr --haze white.exr -c camera.json";
    let said = bench.done(&format!("{call} -v -o haze.exr")).stderr;
    assert!(said.contains("haze: 0.700 of the white image on 50.0 counts"), "{said}");
    let found = image::open(&bench.path("haze.exr")).unwrap().pixels;
    let off = (found - &haze).mapv(f32::abs).fold(0f32, |most, off| most.max(*off));
    assert!(off < 0.5, "{off}");

    // Without the light of the particles nothing but haze is left.
    bench.image("light.exr", &(&frame - &haze));
    bench.done(&format!("{call} --expected light.exr -o without.exr"));
    let found = image::open(&bench.path("without.exr")).unwrap().pixels;
    let off = (found - &haze).mapv(f32::abs).fold(0f32, |most, off| most.max(*off));
    assert!(off < 0.01, "{off}");
    bench.image("small.exr", &Array2::ones((8, 16)));
    bench.refused(
        &call.replace("white", "small"),
        &["small.exr: image of 16 x 8 px; wanted 112 x 98 px like the first"],
    );
    bench.refused(&format!("{call} --reach 0"), &["--reach: 0; wanted 0.5 to 1000 lenslets"]);
    bench.refused("background frame.exr --haze white.exr", &["--camera"]);
}
