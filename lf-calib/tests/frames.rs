//! `lf-calib frame`, and the backgrounds beside the quantile.

use crate::workbench::workbench;
use lf_core::image;
use lf_tests::Workbench;
use ndarray::Array2;

/// Five pairs of frames: a particle that moves, a hot pixel, a second laser with half the light, pixels of two
/// sensitivities.
fn bench() -> Workbench {
    let bench = workbench();
    let sensitivity = Array2::from_shape_fn((12, 16), |(_, x)| if x % 2 == 0 { 1.0 } else { 0.5f32 });
    for n in 0..5 {
        for (laser, light) in [("a", 100.0), ("b", 50.0)] {
            let mut frame = Array2::from_elem((12, 16), 10.0f32);
            frame[(8, 2 * n)] += light;
            frame[(8, 2 * n + 1)] += light;
            frame *= &sensitivity;
            frame[(3, 4)] += 500.0;
            bench.image(&format!("{n}{laser}.exr"), &frame);
        }
    }
    bench.image("flat.exr", &sensitivity.mapv(|share| 1000.0 * share));
    std::fs::create_dir(bench.path("out")).unwrap();
    bench
}

#[test]
fn corrections_give_even_frames_without_hot_pixels() {
    let bench = bench();
    let firsts = "0a.exr 1a.exr 2a.exr 3a.exr 4a.exr";
    let seconds = "0b.exr 1b.exr 2b.exr 3b.exr 4b.exr";
    let line = format!("frame {firsts} --second {seconds} --flat flat.exr --hot 12 --equalise -o out");
    let ended = bench.done(&line);
    assert!(ended.stderr.contains("1 hot pixels") && ended.stderr.contains("multiplied by 2.0000"), "{}", ended.stderr);
    let table = String::from_utf8(ended.stdout).unwrap();
    assert_eq!(table.lines().count(), 11, "{table}");
    let first = image::open(&bench.path("out/2a.exr")).unwrap().pixels;
    let second = image::open(&bench.path("out/2b.exr")).unwrap().pixels;
    // Sensitivities are those over their median, 0.75.
    assert!((first[(8, 4)] - first[(8, 5)]).abs() < 1e-4 && (first[(8, 4)] - 0.75 * 110.0).abs() < 1e-3);
    assert!((first[(3, 4)] - first[(3, 6)]).abs() < 4.0, "the hot pixel is like its neighbours: {}", first[(3, 4)]);
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
