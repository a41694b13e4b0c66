//! A misaligned camera is recovered from images of a dot target.

use crate::scenes::{self, points};
use glam::DVec3;
use lf_calib::{Dot, Exposure, fit_warnings, main_lens};
use lf_core::camera::{Aberrations, Camera, Distortion};
use ndarray::Array2;

const DEPTHS_MM: [f64; 4] = [-4.0, -2.8, 2.8, 4.0];
const LENSLETS: usize = 60;

/// Images, taken by `truth`, of a target displaced by `offset` from its table.
fn exposures(truth: &Camera, offset: DVec3) -> Vec<Exposure> {
    exposures_at(&DEPTHS_MM, truth, offset)
}

fn exposures_at(depths_mm: &[f64], truth: &Camera, offset: DVec3) -> Vec<Exposure> {
    depths_mm
        .iter()
        .map(|&z| {
            let dots = points::grid(5, 0.83, z);
            let places: Vec<DVec3> = dots.iter().map(|dot| *dot + offset).collect();
            let mut pixels = points::image(truth, &places, 0.03, 4e5);
            scenes::noisy(&mut pixels, 0.01);
            let dots = dots.iter().zip(0..).map(|(dot, id)| Dot { id, place_mm: dot.to_array() }).collect();
            Exposure { pixels, dots }
        })
        .collect()
}

const OFFSET: DVec3 = DVec3::new(0.13, -0.07, 0.15);

#[test]
fn a_perfect_camera_gets_no_new_parameters() {
    let truth = points::camera(LENSLETS);
    let found = main_lens(&exposures(&truth, OFFSET), &truth, &|_| ()).unwrap();
    assert!(found.selected.is_empty(), "{:?} {:?}", found.selected, found.values);
    assert_eq!(found.used, [0, 1, 2, 3]);
    assert_eq!(found.dots, 25);
    assert!(found.camera.distortion.is_none() && found.camera.tilt.is_none() && found.camera.centres.is_none());
    assert!((found.camera.main_lens.magnification - 1.0).abs() < 1e-4);
    let focus = found.values.iter().find(|(name, _, _)| *name == "focus_offset_mm").unwrap();
    assert!((focus.1 - 0.15).abs() < 3.0 * focus.2 + 1e-3, "{focus:?}");
    assert!(found.rms_px[1] < 0.05, "{:?}", found.rms_px);
}

#[test]
fn every_misalignment_is_found_within_its_uncertainty() {
    let nominal = points::camera(LENSLETS);
    let mut truth = nominal.clone();
    truth.main_lens.magnification = 1.008;
    truth.microlenses.gap_mm = Some(0.302);
    let k = truth.demagnification();
    truth.microlenses.pitch_mm *= (1.0 + nominal.demagnification()) / (1.0 + k);
    truth.microlenses.rotation_rad = 8e-4;
    truth.distortion = Some(Distortion { radial: [40.0, 0.0, 0.0], tangential: [0.0; 2] });
    let found = main_lens(&exposures(&truth, OFFSET), &nominal, &|_| ()).unwrap();
    let wanted =
        [("magnification", 1.008), ("gap_mm", 0.302), ("rotation_rad", 8e-4), ("k1", 40.0), ("focus_offset_mm", 0.15)];
    for (name, wanted) in wanted {
        let (_, value, uncertainty) = found.values.iter().find(|(known, _, _)| *known == name).unwrap();
        let off = (value - wanted).abs() / uncertainty;
        assert!(off < 4.0, "{name}: {value} +- {uncertainty}, not {wanted}");
    }
    assert!(!found.selected.contains(&"k2") && !found.selected.contains(&"p1"), "{:?}", found.selected);
    let [before, after, _] = found.rms_px;
    assert!(before > 10.0 * after && after < 0.05, "{:?}", found.rms_px);
    found.camera.check().unwrap();
}

/// With the images of the lenslets known, the pupil's distance gives the lenslets' pitch behind them, and dots show it.
#[test]
fn an_exit_pupil_that_is_not_the_thin_lens_is_found() {
    let nominal = points::camera(LENSLETS);
    let mut truth = nominal.clone();
    truth.main_lens.pupil_distance_mm = Some(150.0);
    truth.microlenses.pitch_mm *= (1.0 + nominal.demagnification()) / (1.0 + truth.demagnification());
    let found = main_lens(&exposures(&truth, OFFSET), &nominal, &|_| ()).unwrap();
    assert!(found.selected.contains(&"pupil_distance_mm"), "{:?} {:?}", found.selected, found.values);
    let (_, value, uncertainty) = found.values.iter().find(|(known, _, _)| *known == "pupil_distance_mm").unwrap();
    assert!((value - 150.0).abs() < 4.0 * uncertainty, "{value} +- {uncertainty}");
    assert_eq!(found.camera.main_lens.pupil_distance_mm, Some(*value));
    assert!(scenes::farthest_px(&found.camera, &truth) < 0.1);
}

/// By the images alone a shorter lens is as good as a farther pupil, and the focal length is 36 stated uncertainties
/// from the truth. The data sheet decides.
#[test]
fn a_focal_length_that_images_do_not_show_is_held_by_the_data_sheet() {
    let truth = points::camera(LENSLETS);
    let mut nominal = truth.clone();
    nominal.main_lens.focal_length_mm *= 1.05;
    let found = main_lens(&exposures_at(&[-2.6, 3.0], &truth, OFFSET), &nominal, &|_| ()).unwrap();
    let (_, value, uncertainty) = found.values.iter().find(|(known, _, _)| *known == "focal_length_mm").unwrap();
    let off = (value - truth.main_lens.focal_length_mm).abs() / uncertainty;
    assert!(off < 3.0 && *uncertainty < 8.0, "{value} +- {uncertainty}");
    let warnings = fit_warnings(&found, &nominal);
    assert!(warnings[0].starts_with("by the images alone focal_length_mm was found to be"), "{warnings:?}");
    assert!(found.rms_px[1] < 0.05, "{:?}", found.rms_px);
}

#[test]
fn aberrations_are_found_within_their_uncertainty() {
    let nominal = points::camera(LENSLETS);
    let mut truth = nominal.clone();
    truth.main_lens.magnification = 1.003;
    truth.aberrations = Some(Aberrations {
        spherical_px: 1.0,
        coma_px: 1.0,
        astigmatism_px: 1.0,
        field_curvature_px: -1.0,
        ..Aberrations::default()
    });
    let found = main_lens(&exposures(&truth, OFFSET), &nominal, &|_| ()).unwrap();
    println!("{:?} {:?} {:?}", found.selected, found.values, found.rms_px);
    let wanted = [
        ("magnification", 1.003),
        ("focus_offset_mm", 0.15),
        ("spherical_px", 1.0),
        ("coma_px", 1.0),
        ("astigmatism_px", 1.0),
        ("field_curvature_px", -1.0),
    ];
    for (name, wanted) in wanted {
        let (_, value, uncertainty) = found.values.iter().find(|(known, _, _)| *known == name).unwrap();
        let off = (value - wanted).abs() / uncertainty;
        assert!(off < 4.0, "{name}: {value} +- {uncertainty}, not {wanted}");
    }
    assert!(found.rms_px[1] < 0.05, "{:?}", found.rms_px);
}

#[test]
fn images_without_the_target_are_refused() {
    let nominal = points::camera(LENSLETS);
    let mut seen = exposures(&nominal, OFFSET);
    // Bright particles are no target.
    let mut state = 4;
    let mut anywhere = || 3.8 * (scenes::uniform(&mut state) - 0.5);
    let scattered: Vec<DVec3> = (0..25).map(|_| DVec3::new(anywhere(), anywhere(), 2.8)).collect();
    seen[2].pixels = points::image(&nominal, &scattered, 0.03, 4e5);
    let (image, refusal) = main_lens(&seen, &nominal, &|_| ()).unwrap_err();
    assert_eq!(image, Some(2));
    assert!(refusal.found.starts_with("no target"), "{refusal:?}");
    seen[2].pixels = Array2::from_elem(seen[2].pixels.dim(), 20.0);
    assert_eq!(main_lens(&seen, &nominal, &|_| ()).unwrap_err().0, Some(2));
    let (image, refusal) = main_lens(&seen[..1], &nominal, &|_| ()).unwrap_err();
    assert_eq!(image, None);
    assert_eq!(refusal.found, "1 of 1 images at depths out of focus");
}

/// No camera fits a target with wrong depths.
#[test]
fn a_target_with_wrong_depths_is_refused() {
    let nominal = points::camera(LENSLETS);
    let mut seen = exposures(&nominal, OFFSET);
    for (n, exposure) in seen.iter_mut().enumerate() {
        exposure.dots.iter_mut().for_each(|dot| dot.place_mm[2] = DEPTHS_MM[3 - n]);
    }
    assert!(main_lens(&seen, &nominal, &|_| ()).is_err());
}
