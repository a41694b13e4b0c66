//! Mistakes in the stated setup of a target are recognised, each by its name.

use crate::scenes::{self, points};
use glam::DVec3;
use lf_calib::{Dot, Exposure, closer_dots_mm, fit_warnings, in_air, main_lens, setup_mistake};
use lf_core::Camera;

const DEPTHS_MM: [f64; 4] = [-4.2, -3.0, 3.0, 4.0];
const LENSLETS: usize = 60;

/// A target of 25 dots without symmetry.
fn dots(depth_mm: f64) -> Vec<DVec3> {
    let mut state = 7;
    let mut jitter = || 0.3 * (scenes::uniform(&mut state) - 0.5);
    points::grid(5, 0.8, depth_mm).iter().map(|dot| *dot + DVec3::new(jitter(), jitter(), 0.0)).collect()
}

/// Images taken by `truth`, with dots that are stated to be elsewhere.
fn exposures(truth: &Camera, stated: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Exposure> {
    let image = |z: f64| {
        let dots = dots(z);
        let mut pixels = points::image(truth, &dots, 0.03, 4e5);
        scenes::noisy(&mut pixels, 0.01);
        let dots = dots.iter().zip(0..).map(|(dot, id)| Dot { id, place_mm: stated(dot.to_array()) }).collect();
        Exposure { pixels, dots }
    };
    DEPTHS_MM.map(image).to_vec()
}

fn mistake_of(truth: &Camera, stated: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    setup_mistake(&exposures(truth, stated), &points::camera(LENSLETS)).expect("a mistake").to_string()
}

#[test]
fn a_sound_target_shows_no_mistake() {
    let nominal = points::camera(LENSLETS);
    let seen = exposures(&nominal, |place| place);
    assert_eq!(setup_mistake(&seen, &nominal), None);
    let found = main_lens(&seen, &nominal, &|_| ()).unwrap();
    assert_eq!(fit_warnings(&found, &nominal), [""; 0]);
    assert_eq!(closer_dots_mm(&seen, &found.used, &found.camera), None);
}

#[test]
fn each_mistake_is_named() {
    let camera = points::camera(LENSLETS);
    let sign = mistake_of(&camera, |[x, y, z]| [x, y, -z]);
    assert!(sign.contains("with depths of the other sign"), "{sign}");
    let halved = mistake_of(&camera, |[x, y, z]| [x, y, 0.5 * z]);
    assert!(halved.contains("with depths of 2.0000 times those stated"), "{halved}");
    let diagonal = mistake_of(&camera, |[x, y, z]| [x / 2f64.sqrt(), y / 2f64.sqrt(), z]);
    assert!(diagonal.contains("with dots ") && diagonal.contains(" mm apart, within 0.0"), "{diagonal}");
    let mirrored = mistake_of(&camera, |[x, y, z]| [-x, y, z]);
    assert!(mirrored.contains("as its mirror image"), "{mirrored}");
    let turned = mistake_of(&camera, |[x, y, z]| [-y, x, z]);
    assert!(turned.contains("turned by 270 degrees") || turned.contains("turned by 90 degrees"), "{turned}");
}

#[test]
fn forgotten_water_is_named() {
    let truth = in_air(&points::camera(LENSLETS), 1.333);
    let text = mistake_of(&truth, |place| place);
    assert!(text.contains("as behind water") && text.contains("--water"), "{text}");
    // The other way round: a camera for water, and a target in air.
    let seen = exposures(&points::camera(LENSLETS), |place| place);
    let text = setup_mistake(&seen, &truth).expect("a mistake").to_string();
    assert!(text.contains("as a camera for water in air"), "{text}");
}

/// A fit may follow depths that are a little wrong with a gap that no camera has.
#[test]
fn lengths_far_from_the_data_sheet_raise_a_warning() {
    let nominal = points::camera(LENSLETS);
    let seen = exposures(&nominal, |[x, y, z]| [x, y, 0.8 * z]);
    match main_lens(&seen, &nominal, &|_| ()) {
        Ok(found) => {
            assert!(fit_warnings(&found, &nominal).iter().any(|warning| warning.contains("% from the")), "{found:?}")
        }
        Err((_, refusal)) => assert!(!refusal.found.is_empty()),
    }
}

/// The other three images fit a camera; the fourth is named.
#[test]
fn an_image_at_a_wrong_depth_is_named() {
    let nominal = points::camera(LENSLETS);
    let seen = exposures(&nominal, |[x, y, z]| [x, y, if z == 4.0 { 3.5 } else { z }]);
    let found = main_lens(&seen, &nominal, &|_| ()).unwrap();
    let warnings = fit_warnings(&found, &nominal);
    assert_eq!(found.against_mm, [3.5], "{warnings:?}");
    let names_it = |warning: &String| warning.starts_with("images at 3.5 mm do not show the dots");
    assert!(warnings.iter().any(names_it), "{warnings:?}");
}

#[test]
fn a_target_stated_too_coarse_is_warned_of() {
    let nominal = points::camera(LENSLETS);
    let every_other = |z: f64| {
        let all = points::grid(9, 0.4, z);
        let mut pixels = points::image(&nominal, &all, 0.03, 4e5);
        scenes::noisy(&mut pixels, 0.01);
        let dots = points::grid(5, 0.8, z);
        let dots = dots.iter().zip(0..).map(|(dot, id)| Dot { id, place_mm: dot.to_array() }).collect();
        Exposure { pixels, dots }
    };
    let seen = DEPTHS_MM.map(every_other);
    let [shown, stated] = closer_dots_mm(&seen, &[0, 1, 2, 3], &nominal).expect("closer dots");
    assert!((shown - 0.4).abs() < 0.02 && (stated - 0.8).abs() < 1e-9, "{shown} {stated}");
}
