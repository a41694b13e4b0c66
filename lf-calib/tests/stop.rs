//! The stop that lenslet images show: widths, f-numbers, and when they are written.

use crate::scenes::{camera, discs, noisy, shaded_discs, squares};
use crate::workbench::workbench;
use lf_calib::{Calibrated, Keep, calibrate, find_lattice};
use lf_core::camera::{Aperture, Layout};
use lf_core::{Camera, image};
use ndarray::Array2;
use serde_json::Value;

/// A camera of matched f-numbers with lenslets of `pitch_px`.
fn matched(shape: Aperture, layout: Layout, turn: f64, pitch_px: f64, side: usize) -> Camera {
    let mut truth = camera(side, layout, turn, [0.0123, -0.0257]);
    truth.main_lens.aperture = shape;
    truth.microlenses.pitch_mm *= pitch_px / 14.0;
    truth.microlenses.focal_length_mm *= pitch_px / 14.0;
    truth
}

/// A white image of the camera with a stop of `fill` times its stop.
fn white(truth: &Camera, fill: f64, noise: f64) -> Array2<f32> {
    let mut image = match truth.main_lens.aperture {
        Aperture::Circle => discs(truth, fill),
        Aperture::Square => squares(truth, fill),
    };
    noisy(&mut image, noise);
    image
}

fn calibrated(image: &Array2<f32>, nominal: &Camera) -> Calibrated {
    calibrate(&find_lattice(image, &|_| ()).unwrap(), nominal, Keep::default()).unwrap()
}

#[test]
fn a_stop_of_another_size_is_measured() {
    // Each noise with each lattice, and with each fill of a stop.
    let lattices = [(Layout::Square, 0.0), (Layout::Square, 0.02), (Layout::Hexagonal, 0.003)];
    for shape in [Aperture::Circle, Aperture::Square] {
        for (row, (layout, turn)) in lattices.into_iter().enumerate() {
            // Squares of 0.87 of the pitch touch in a hexagonal lattice.
            let fills = match (shape, layout) {
                (Aperture::Circle, _) => [0.88, 1.0, 1.05],
                (Aperture::Square, Layout::Square) => [0.84, 0.88, 0.94],
                (Aperture::Square, Layout::Hexagonal) => [0.8, 0.84, 0.88],
            };
            for (column, fill) in fills.into_iter().enumerate() {
                let noise = [0.0, 0.02, 0.1][(row + column) % 3];
                let truth = matched(shape, layout, turn, 14.0, 420);
                let found = calibrated(&white(&truth, fill, noise), &truth);
                let measured = found.fill.unwrap();
                let wrong = measured.f_number() * fill / 4.0 - 1.0;
                let what = format!("{shape:?} {layout:?} {turn} {fill} {noise}");
                let uncertainty = measured.f_number_uncertainty() / 4.0;
                println!("{what}: {:+.2} %, +- {:.2}", 100.0 * wrong, 100.0 * uncertainty);
                assert!(wrong.abs() < 0.01, "{what}: {wrong:.4} {measured:?}");
                let written = found.camera.main_lens.working_f_number;
                let wanted = if fill == 1.0 { 4.0 } else { measured.f_number() };
                assert_eq!(written, wanted, "{what}");
                assert_eq!(found.camera_of_white().main_lens.working_f_number, wanted, "{what}");
            }
        }
    }
}

/// Noise is not written into a camera, and a stated uncertainty holds.
#[test]
fn widths_of_3_to_70_px_in_noise() {
    // Each noise with each width; lattices and fills take turns.
    let kinds = [(Layout::Square, 0.8), (Layout::Hexagonal, 0.95), (Layout::Square, 0.95), (Layout::Hexagonal, 0.8)];
    let mut kinds = kinds.into_iter().cycle();
    for width in [3.0, 5.0, 8.0, 23.0, 70.0] {
        for (noise, (layout, fill)) in [0.0, 0.05, 0.1].into_iter().zip(kinds.by_ref()) {
            let side = if width > 50.0 { 900 } else { 360 };
            let truth = matched(Aperture::Circle, layout, 0.003, width / fill, side);
            let Ok(lattice) = find_lattice(&white(&truth, fill, noise), &|_| ()) else {
                println!("{layout:?} {width} {noise} {fill}: no lattice");
                // Small discs that nearly touch may hide the lattice.
                assert!(width < 5.0 || (width < 6.0 && fill > 0.9), "{layout:?} {width} {noise} {fill}");
                continue;
            };
            let found = lattice.disc;
            let what = format!("{layout:?} {width} {noise} {fill}");
            println!("{what}: {found:.3?}");
            // Small discs that nearly touch have hardly an edge left.
            let Some(found) = found else {
                assert!(width <= 5.0 && fill > 0.9, "{what}");
                continue;
            };
            assert!((found.width_px / width - 1.0).abs() < 0.01, "{what}: {found:?}");
            assert!((found.width_px - width).abs() < 3.0 * found.uncertainty_px, "{what}: {found:?}");
        }
    }
}

#[test]
fn the_measured_f_number_is_written_unless_the_nominal_one_is_to_be_kept() {
    let bench = workbench();
    let truth = matched(Aperture::Circle, Layout::Hexagonal, 0.003, 14.0, 280);
    bench.write("nominal.json", truth.to_json());
    bench.image("white.exr", &white(&truth, 0.88, 0.01));
    let f_number = |line: &str| {
        let done = bench.done(line);
        let camera: Value = serde_json::from_slice(&done.stdout).unwrap();
        let stated = camera["calibration"]["lattice"]["working_f_number"].as_f64().unwrap();
        let uncertainty = &camera["calibration"]["lattice"]["standard_uncertainty"]["working_f_number"];
        assert!((stated * 0.88 / 4.0 - 1.0).abs() < 0.005 && uncertainty.as_f64().unwrap() < 0.05, "{camera}");
        (camera["main_lens"]["working_f_number"].as_f64().unwrap(), stated, done.stderr)
    };
    let (written, stated, line) = f_number("lattice white.exr -c nominal.json --vignetting flat.exr");
    assert_eq!(written, stated);
    assert!(
        line.contains("px wide, but the nominal f-number 4 gives 14.00 px: the stop is smaller than stated"),
        "{line}"
    );
    assert!(line.contains("the camera gets the measured f-number 4.5"), "{line}");
    let (kept, _, line) = f_number("lattice white.exr -c nominal.json --keep-f-number --vignetting kept.exr");
    assert_eq!(kept, 4.0);
    assert!(line.contains("--keep-f-number keeps 4, 4.5"), "{line}");
    // The flat field is that of the white image's stop in both cases.
    let flat = |name: &str| image::open(&bench.path(name)).unwrap().pixels;
    assert_eq!(flat("flat.exr"), flat("kept.exr"));
    let blind = flat("flat.exr").iter().filter(|share| **share < image::BLIND).count();
    assert!((blind as f64) < 0.02 * flat("flat.exr").len() as f64, "{blind} blind pixels");
}

#[test]
fn a_stop_that_agrees_leaves_the_camera_as_it_is_without_a_word() {
    let bench = workbench();
    let truth = matched(Aperture::Circle, Layout::Square, 0.003, 14.0, 280);
    bench.write("nominal.json", truth.to_json());
    bench.image("white.exr", &white(&truth, 1.0, 0.05));
    let done = bench.done("lattice white.exr -c nominal.json");
    let camera: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(camera["main_lens"]["working_f_number"], 4.0);
    assert_eq!(done.stderr, "");
    assert!(bench.done("lattice white.exr -c nominal.json -v").stderr.contains("agrees with that and is kept"));
}

/// Shading looks like another f-number to lf-fit. It is named, unless a flat field takes it.
#[test]
fn shading_of_the_lenslet_images_is_measured() {
    let bench = workbench();
    for layout in [Layout::Square, Layout::Hexagonal] {
        let truth = matched(Aperture::Circle, layout, 0.003, 14.0, 280);
        bench.write("nominal.json", truth.to_json());
        for falls in [0.04, 0.1] {
            let mut image = shaded_discs(&truth, falls);
            noisy(&mut image, 0.05);
            bench.image("white.exr", &image);
            let said = bench.done("lattice white.exr -c nominal.json -o camera.json").stderr;
            let named = format!("lenslet images are {:.0} % darker at their rims", 100.0 * falls);
            assert!(said.contains(&named), "{layout:?} {falls}: {said}");
            let line = "lattice white.exr -c nominal.json --vignetting flat.exr -o camera.json";
            assert!(!bench.done(line).stderr.contains("darker"), "{layout:?} {falls}");
        }
    }
}

#[test]
fn an_exact_pitch_gives_the_exit_pupil() {
    for layout in [Layout::Square, Layout::Hexagonal] {
        let bench = workbench();
        let mut truth = matched(Aperture::Circle, layout, 0.003, 14.0, 420);
        // A bench camera of long lenslets: k = 0.02.
        truth.microlenses.focal_length_mm = 8.0;
        truth.main_lens.working_f_number = 8.0 / 0.077;
        bench.write("nominal.json", truth.to_json());
        truth.main_lens.pupil_distance_mm = Some(502.0);
        bench.image("white.exr", &white(&truth, 0.95, 0.01));
        let done = bench.done("lattice white.exr -c nominal.json --keep-pitch");
        let camera = Camera::from_json(&String::from_utf8(done.stdout).unwrap()).unwrap();
        let pupil = camera.main_lens.pupil_distance_mm.unwrap();
        assert!((pupil - 502.0).abs() < 1.0, "{layout:?}: {pupil}");
        assert!((camera.microlenses.pitch_mm / 0.077 - 1.0).abs() < 1e-6);
        assert!((camera.main_lens.working_f_number * 0.95 / truth.main_lens.working_f_number - 1.0).abs() < 0.01);
        let stated = &camera.calibration.unwrap()["lattice"];
        assert_eq!(stated["pupil_distance_mm"], pupil);
        let uncertainty = stated["standard_uncertainty"]["pupil_distance_mm"].as_f64().unwrap();
        assert!((pupil - 502.0).abs() < 3.0 * uncertainty && uncertainty < 1.0, "{pupil} +- {uncertainty}");

        let line = bench.done("lattice white.exr -c nominal.json").stderr;
        assert!(line.contains("-0.40 % from the nominal 0.07700 mm: another array, or an exit pupil"), "{line}");
        assert!(line.contains("give --keep-pitch: the pupil then stands 50"), "{line}");

        // Images nearer to each other than lenslets of 0.08 mm have their pupil behind the array, here by 361 mm: no
        // pupil stands as near as lenslets of 0.15 mm would need.
        truth.microlenses.pitch_mm = 0.08;
        bench.write("wide.json", truth.to_json());
        let done = bench.done("lattice white.exr -c wide.json --keep-pitch -v");
        let camera = Camera::from_json(&String::from_utf8(done.stdout).unwrap()).unwrap();
        let images_mm = 0.077 * (1.0 + 8.0 / 502.0);
        let behind = camera.pupil_distance_mm();
        assert!((behind / (8.0 / (images_mm / 0.08 - 1.0)) - 1.0).abs() < 2e-3 && behind < -350.0, "{behind}");
        assert!(done.stderr.contains("mm behind the array"), "{}", done.stderr);
        truth.microlenses.pitch_mm = 0.15;
        bench.write("wide.json", truth.to_json());
        bench
            .run("lattice white.exr -c wide.json --keep-pitch -o out")
            .refused("px apart, of an array of exactly 27.2727 px");
        assert!(!bench.path("out").exists());
    }
}
