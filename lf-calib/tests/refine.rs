//! Particles correct a drift of the camera; too few particles are refused.

use crate::scenes::{self, points};
use glam::DVec3;
use lf_calib::refine;
use lf_core::Camera;
use ndarray::Array2;

fn frames(truth: &Camera, count: usize) -> Vec<Array2<f32>> {
    let mut state = 9;
    let mut signed = || 2.0 * scenes::uniform(&mut state) - 1.0;
    (0..2)
        .map(|_| {
            let places: Vec<DVec3> = (0..count)
                .map(|n| {
                    DVec3::new(1.7 * signed(), 1.7 * signed(), if n % 2 == 0 { 3.2 } else { -3.2 } + 0.8 * signed())
                })
                .collect();
            points::image(truth, &places, 0.004, 2e5)
        })
        .collect()
}

#[test]
fn a_drift_of_two_pixels_is_taken_away() {
    let truth = points::camera(70);
    let mut drifted = truth.clone();
    drifted.microlenses.offset_mm = [0.0077, -0.0077];
    let frames = frames(&truth, 24);
    let found = refine(&frames, &drifted, [-4.5, 4.5], &|_| ()).unwrap();
    let left_px = found.camera.microlenses.offset_mm.map(|offset| offset / 0.0055);
    println!("{} particles, left {left_px:?} px, {:?}", found.particles, found.changed);
    assert!(left_px.iter().all(|left| left.abs() < 0.06), "{left_px:?} px");
    assert!(found.disparity_px[0] > 1.8 && found.disparity_px[1] < 0.4, "{:?}", found.disparity_px);
    // The true camera stays as it is.
    let same = refine(&frames, &truth, [-4.5, 4.5], &|_| ()).unwrap();
    assert!(same.changed.is_empty(), "{:?}", same.changed);
    assert_eq!(same.camera.microlenses, truth.microlenses);
}

/// A wall along one side of the frames: masked pixels say nothing, and unmasked ones look like particles.
#[test]
fn a_masked_reflection_leaves_the_drift_as_it_is() {
    let truth = points::camera(70);
    let mut drifted = truth.clone();
    drifted.microlenses.offset_mm = [0.0077, -0.0077];
    let left_px = |wall: f32| {
        let mut frames = frames(&truth, 24);
        frames.iter_mut().for_each(|frame| frame.slice_mut(ndarray::s![.., ..200]).fill(wall));
        let found = refine(&frames, &drifted, [-4.5, 4.5], &|_| ());
        found.map(|found| found.camera.microlenses.offset_mm.map(|offset| offset / 0.0055))
    };
    let masked = left_px(f32::NAN).unwrap();
    assert!(masked.iter().all(|left| left.abs() < 0.06), "{masked:?} px");
    let bare = left_px(1e5);
    assert!(bare.as_ref().map_or(true, |bare| bare.iter().any(|left| left.abs() > 0.06)), "{bare:?} px");
}

#[test]
fn too_few_particles_are_refused() {
    let truth = points::camera(70);
    let refusal = refine(&frames(&truth, 4), &truth, [-4.5, 4.5], &|_| ()).unwrap_err();
    assert!(refusal.found.ends_with("isolated bright particles in 2 frames"), "{refusal:?}");
    let dark = Array2::from_elem((980, 980), 3.0);
    assert_eq!(
        refine(&[dark], &truth, [-4.5, 4.5], &|_| ()).unwrap_err().found,
        "0 isolated bright particles in 1 frames"
    );
}

#[test]
fn particles_that_overlap_place_the_lattice_less_well() {
    let truth = points::camera(70);
    let uncertainty =
        |count| refine(&frames(&truth, count), &truth, [-4.5, 4.5], &|_| ()).unwrap().offset_uncertainty_px;
    let (sparse, dense) = (uncertainty(24).unwrap(), uncertainty(1000).unwrap());
    println!("{sparse:.4} px alone, {dense:.4} px overlapping");
    // The bound from which lf-calib warns lies between them.
    assert!(sparse < 0.02 && dense > 0.02, "{sparse} px, {dense} px");
}
