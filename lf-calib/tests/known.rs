//! Lattices whose answer is known: discs and squares drawn exactly, and rays through the shared optics.

use crate::scenes::{self, camera, discs, farthest_px, noisy, nominal, rays, squares};
use lf_calib::{ImageLattice, Keep, calibrate, find_lattice};
use lf_core::{Camera, camera::Layout};
use ndarray::Array2;

const LAYOUTS: [Layout; 2] = [Layout::Square, Layout::Hexagonal];
const ASIDE: [f64; 2] = [0.0123, -0.0257];

/// Calibrates with an image. Pitch (relative) and rotation (rad) must be within `limit`, places within `limit_px`.
fn check(what: &str, truth: &Camera, image: &Array2<f32>, limit: f64, limit_px: f64) -> ImageLattice {
    let found = find_lattice(image, &|_| ()).unwrap_or_else(|refusal| panic!("{what}: {refusal:?}"));
    let camera = calibrate(&found, &nominal(truth), Keep::default()).unwrap().camera;
    let (mine, wanted) = (&camera.microlenses, &truth.microlenses);
    let pitch = (mine.pitch_mm / wanted.pitch_mm - 1.0).abs();
    let turn = (mine.rotation_rad - wanted.rotation_rad).abs();
    let offset_px = [0, 1].map(|axis| (mine.offset_mm[axis] - wanted.offset_mm[axis]).abs() / 0.0055);
    let worst = farthest_px(&camera, truth);
    let figures =
        format!("pitch {pitch:.1e}, rotation {turn:.1e} rad, offset {offset_px:.4?} px, farthest {worst:.4} px");
    println!("{what}: {figures}, residual {:.4} px, {} lenslets", found.residual_rms_px, found.kept());
    assert_eq!(mine.layout, wanted.layout, "{what}");
    assert!(pitch < limit && turn < limit, "{what}: {figures}");
    assert!(offset_px[0].max(offset_px[1]) < limit_px && worst < 3.0 * limit_px, "{what}: {figures}");
    assert!(found.kept() as f64 > 0.95 * found.in_frame as f64, "{what}: {} of {}", found.kept(), found.in_frame);
    found
}

#[test]
fn touching_discs_without_noise() {
    for layout in LAYOUTS {
        for (rotation, offset) in [(0.0, [0.0, 0.0]), (0.0, ASIDE), (0.003, ASIDE), (0.05, ASIDE)] {
            let truth = camera(560, layout, rotation, offset);
            let what = format!("{layout:?} {rotation} {offset:?}");
            let found = check(&what, &truth, &discs(&truth, 1.0), 1e-5, 0.003);
            assert!(found.residual_rms_px < 0.003, "{what}: {}", found.residual_rms_px);
        }
    }
}

#[test]
fn one_per_cent_of_noise_and_a_stated_uncertainty_that_holds() {
    for layout in LAYOUTS {
        let truth = camera(840, layout, 0.003, ASIDE);
        let mut image = discs(&truth, 1.0);
        noisy(&mut image, 0.01);
        let found = check(&format!("{layout:?}"), &truth, &image, 1e-5, 0.003);
        let pitch_px = truth.pitch_px() * (1.0 + truth.demagnification());
        assert!((found.pitch_px - pitch_px).abs() < 3.0 * found.pitch_uncertainty_px);
        assert!((found.rotation_rad - 0.003).abs() < 3.0 * found.rotation_uncertainty_rad);
    }
}

#[test]
fn rays_of_the_shared_optics() {
    for layout in LAYOUTS {
        let truth = camera(420, layout, 0.003, ASIDE);
        check(&format!("{layout:?}"), &truth, &rays(&truth, 60), 3e-5, 0.01);
    }
}

// Scar: overlapping discs are brightest between the lenslets, and the lattice came out half a pitch aside.
#[test]
fn stopped_down_and_overlapping_discs() {
    for layout in LAYOUTS {
        let truth = camera(420, layout, 0.003, ASIDE);
        for fill in [0.3, 0.6, 1.05, 1.2] {
            check(&format!("{layout:?} {fill}"), &truth, &discs(&truth, fill), 1e-5, 0.003);
        }
    }
}

#[test]
fn a_square_stop_stopped_down() {
    for layout in LAYOUTS {
        let truth = camera(560, layout, 0.003, ASIDE);
        check(&format!("{layout:?}"), &truth, &squares(&truth, 0.6), 3e-5, 0.01);
    }
}

#[test]
fn any_rotation_is_found_and_the_nearest_to_nominal_is_written() {
    for layout in LAYOUTS {
        for rotation in [0.3, 0.5, 0.78, -1.2, 3.0] {
            let truth = camera(420, layout, rotation, ASIDE);
            check(&format!("{layout:?} {rotation}"), &truth, &discs(&truth, 1.0), 1e-5, 0.003);
        }
    }
}

#[test]
fn lenslets_of_7_to_66_px_in_noise() {
    for layout in LAYOUTS {
        for pitch_px in [7.3, 23.7, 66.7] {
            let mut truth = camera(560, layout, 0.003, ASIDE);
            truth.microlenses.focal_length_mm *= pitch_px / 14.0;
            truth.microlenses.pitch_mm *= pitch_px / 14.0;
            let mut image = discs(&truth, 0.95);
            noisy(&mut image, 0.05);
            check(&format!("{layout:?} {pitch_px}"), &truth, &image, 2e-5, 0.006);
        }
    }
}

// A falling brightness moves centroids to the bright side: 0.01 px at the corners of this frame.
#[test]
fn brightness_that_falls_to_the_corners() {
    for layout in LAYOUTS {
        let truth = camera(560, layout, 0.003, ASIDE);
        let mut image = discs(&truth, 1.0);
        for ((row, column), value) in image.indexed_iter_mut() {
            let distance = (row as f64 - 280.0).hypot(column as f64 - 280.0) / 280.0;
            *value *= (1.0 - 0.4 * distance * distance) as f32;
        }
        check(&format!("{layout:?}"), &truth, &image, 1e-5, 0.003);
    }
}

#[test]
fn frames_of_few_lenslets_and_of_one_long_strip() {
    for layout in LAYOUTS {
        for (width, height) in [(100, 80), (2000, 60)] {
            let mut truth = camera(0, layout, 0.003, ASIDE);
            (truth.sensor.width, truth.sensor.height) = (width, height);
            check(&format!("{layout:?} {width} x {height}"), &truth, &discs(&truth, 1.0), 1e-4, 0.01);
        }
    }
}

#[test]
fn dust_is_left_out() {
    let truth = camera(560, Layout::Square, 0.003, ASIDE);
    let mut image = discs(&truth, 1.0);
    let mut state = 9;
    for _ in 0..40 {
        let [x, y, radius] = [560.0, 560.0, 10.0].map(|size| size * scenes::uniform(&mut state));
        for ((row, column), value) in image.indexed_iter_mut() {
            if (row as f64 - y).hypot(column as f64 - x) < radius {
                *value *= 0.4;
            }
        }
    }
    let found = find_lattice(&image, &|_| ()).unwrap();
    let camera = calibrate(&found, &nominal(&truth), Keep::default()).unwrap().camera;
    assert!(farthest_px(&camera, &truth) < 0.003, "{}", farthest_px(&camera, &truth));
    assert!(found.kept() < found.centres.len());
}

#[test]
fn the_equivalent_description_nearest_to_nominal_is_written() {
    for layout in LAYOUTS {
        let truth = camera(280, layout, 0.003, ASIDE);
        let found = find_lattice(&discs(&truth, 0.8), &|_| ()).unwrap();
        let lattice = truth.lattice();
        // An offset by a lattice vector or a rotation by a symmetry gives the same lattice.
        for (i, j) in [(0, 0), (3, -2), (-5, 7)] {
            let mut nominal = truth.clone();
            let shift = lattice.centre_mm(i, j) - lattice.centre_mm(0, 0);
            nominal.microlenses.offset_mm = [ASIDE[0] + shift.x, ASIDE[1] + shift.y];
            let camera = calibrate(&found, &nominal, Keep::default()).unwrap().camera;
            let [x, y] = [0, 1].map(|n| camera.microlenses.offset_mm[n] - nominal.microlenses.offset_mm[n]);
            assert!(x.hypot(y) < 1e-4, "{layout:?} {i} {j}: {x} {y}");
            assert!((camera.main_lens.working_f_number * 0.8 / 4.0 - 1.0).abs() < 0.005);
        }
    }
}
