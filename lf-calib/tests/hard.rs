//! White images like real ones: bent, dim, dusty, cut by a second stop, coarse and fine.

use crate::scenes::{camera, cut_discs, discs, farthest_px, image_px, noisy, nominal, squares, uniform};
use glam::DVec2;
use lf_calib::{Calibrated, ImageLattice, Keep, calibrate, find_lattice};
use lf_core::camera::{Aperture, Layout};
use lf_core::{Camera, lattice::Centres};
use ndarray::Array2;

const LAYOUTS: [Layout; 2] = [Layout::Square, Layout::Hexagonal];

/// Calibrates with an image and refuses lenslet images that are farther off than `limit_px`.
fn measured(what: &str, truth: &Camera, image: &Array2<f32>, limit_px: f64) -> Calibrated {
    let found = find_lattice(image, &|_| ()).unwrap_or_else(|refusal| panic!("{what}: {refusal:?}"));
    calibrated(what, truth, &found, limit_px)
}

fn calibrated(what: &str, truth: &Camera, found: &ImageLattice, limit_px: f64) -> Calibrated {
    let calibrated = calibrate(found, &nominal(truth), Keep::default()).unwrap();
    let worst = farthest_px(&calibrated.camera, truth);
    println!("{what}: farthest {worst:.4} px, {} of {}, degree {}", found.kept(), found.in_frame, calibrated.degree);
    assert_eq!(calibrated.camera.microlenses.layout, truth.microlenses.layout, "{what}");
    assert!(worst < limit_px, "{what}: {worst}");
    calibrated
}

/// A camera with lenslets of `pitch_px`.
fn of_pitch(pitch_px: f64, side: usize, layout: Layout) -> Camera {
    let mut truth = camera(side, layout, 0.003, [0.0123, -0.0257]);
    truth.microlenses.focal_length_mm *= pitch_px / 14.0;
    truth.microlenses.pitch_mm *= pitch_px / 14.0;
    truth
}

#[test]
fn a_bent_lattice_is_followed_and_a_perfect_one_stays_perfect() {
    for layout in LAYOUTS {
        let mut truth = camera(700, layout, 0.01, [0.0123, -0.0257]);
        let mut image = discs(&truth, 0.9);
        noisy(&mut image, 0.03);
        assert_eq!(measured("perfect", &truth, &image, 0.006).degree, 0);
        // First sheared by a pixel at the edges, then bent by several pixels like a relay lens.
        let shear = Centres { radius_mm: 2.7, x_mm: vec![0.006, 0.002], y_mm: vec![0.002, -0.006] };
        let (k, r) = (0.004, 0.03);
        let lens = Centres {
            radius_mm: 2.7,
            x_mm: vec![0.0, 0.0, k, 0.0, 0.0, -r, 0.0, -r, 0.0],
            y_mm: vec![0.0, 0.0, 0.0, k, 0.0, 0.0, -r, 0.0, -r],
        };
        for (centres, degree) in [(shear, 1), (lens, 3)] {
            truth.centres = Some(centres);
            let mut image = discs(&truth, 0.9);
            noisy(&mut image, 0.03);
            let calibrated = measured("bent", &truth, &image, 0.02);
            assert_eq!(calibrated.degree, degree);
            assert!(calibrated.residual_rms_px < 0.02 && calibrated.departure_px > 0.5);
        }
    }
}

// Scar: without a model of the second stop, the pitch of this image came out 3e-4 too small.
#[test]
fn a_second_stop_moves_no_centre() {
    for (layout, drifts) in [(Layout::Square, &[0.008][..]), (Layout::Hexagonal, &[0.008, -0.008])] {
        let truth = camera(700, layout, 0.003, [0.0123, -0.0257]);
        for &drift in drifts {
            let mut image = cut_discs(&truth, 0.95, 1.25, drift);
            noisy(&mut image, 0.01);
            let found = find_lattice(&image, &|_| ()).unwrap();
            let stop = found.second_stop.expect("a second stop");
            assert!((stop.slope / drift - 1.0).abs() < 0.15, "{stop:?}");
            calibrated("second stop", &truth, &found, 0.01);
        }
        let plain = find_lattice(&discs(&truth, 0.95), &|_| ()).unwrap();
        assert!(plain.second_stop.is_none());
    }
}

#[test]
fn lenslets_of_7_px_and_of_150() {
    for layout in LAYOUTS {
        for (pitch_px, side, fill, limit) in [(7.0, 420, 0.95, 0.02), (7.13, 420, 0.7, 0.02), (150.0, 1200, 0.9, 0.03)]
        {
            let truth = of_pitch(pitch_px, side, layout);
            let mut image = discs(&truth, fill);
            noisy(&mut image, 0.02);
            measured(&format!("{layout:?} {pitch_px} px"), &truth, &image, limit);
        }
    }
}

#[test]
fn discs_that_are_brighter_at_the_rim() {
    for layout in LAYOUTS {
        for fill in [0.6, 0.95] {
            let truth = camera(420, layout, 0.003, [0.0123, -0.0257]);
            let inner = discs(&truth, 0.7 * fill);
            let mut image = discs(&truth, fill) * 1.3 - inner * 0.6;
            noisy(&mut image, 0.02);
            let calibrated = measured(&format!("{layout:?} {fill}"), &truth, &image, 0.006);
            let fill_found = calibrated.fill.unwrap();
            let wide = fill_found.measured_px / (fill * 14.0);
            assert!((wide - 1.0).abs() < 0.03, "{layout:?} {fill}: {fill_found:?}");
        }
    }
}

#[test]
fn dim_missing_and_dusty_lenslets_and_dark_borders() {
    for layout in LAYOUTS {
        let truth = camera(560, layout, 0.003, [0.0123, -0.0257]);
        let mut image = discs(&truth, 0.95);
        let mut state = 3;
        let darken = |image: &mut Array2<f32>, centre: DVec2, radius: f64, share: f32| {
            for ((row, column), value) in image.indexed_iter_mut() {
                if DVec2::new(column as f64 + 0.5, row as f64 + 0.5).distance(centre) < radius {
                    *value *= share;
                }
            }
        };
        for centre in image_px(&truth) {
            let lot = uniform(&mut state);
            if lot < 0.05 {
                darken(&mut image, centre, 7.0, if lot < 0.025 { 0.0 } else { 0.3 });
            }
        }
        for _ in 0..30 {
            let [x, y, radius] = [560.0, 560.0, 8.0].map(|size| size * uniform(&mut state));
            darken(&mut image, DVec2::new(x, y), radius, 0.4);
        }
        for ((row, column), value) in image.indexed_iter_mut() {
            let edge = row.min(column).min(559 - row).min(559 - column);
            if edge < 84 {
                *value *= 0.01;
            }
            *value += 30.0;
        }
        noisy(&mut image, 0.02);
        measured(&format!("{layout:?}"), &truth, &image, 0.012);
    }
}

#[test]
fn overlapping_square_stops_follow_the_nominal_offset() {
    let mut truth = camera(420, Layout::Square, 0.003, [0.0123, -0.0257]);
    truth.main_lens.aperture = Aperture::Square;
    // With an overlap of a third, beats with the pixels leave 0.1 px. The other possible lattice is 10 px away.
    for (fill, limit_px) in [(1.1, 0.03), (1.3, 0.3)] {
        let image = squares(&truth, fill);
        truth.main_lens.working_f_number = 4.0 / fill;
        assert!(measured(&format!("{fill}"), &truth, &image, limit_px).is_ambiguous);
        truth.main_lens.working_f_number = 4.0;
    }
}
