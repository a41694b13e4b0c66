use super::*;

/// The seed camera of the simulations: 77 um lenslets of 0.308 mm behind a 200 mm lens at m = 1, N_w = 4.
pub(crate) fn seed(lenslets: usize, aperture: Aperture, layout: Layout, rotation_rad: f64) -> Camera {
    Camera {
        frame: Default::default(),
        sensor: Sensor { width: 14 * lenslets, height: 14 * lenslets, pixel_pitch_mm: 0.0055 },
        main_lens: MainLens {
            focal_length_mm: 200.0,
            magnification: 1.0,
            working_f_number: 4.0,
            aperture,
            pupil_distance_mm: None,
            pupil_vergence_per_mm: None,
            telecentric: None,
        },
        microlenses: Microlenses {
            layout,
            pitch_mm: 0.077,
            focal_length_mm: 0.308,
            rotation_rad,
            offset_mm: [0.0, 0.0],
            gap_mm: None,
        },
        distortion: None,
        aberrations: None,
        tilt: None,
        medium: None,
        centres: None,
        blades: None,
        second_stop: None,
        vignetting: None,
        blur: None,
        sensor_noise: None,
        pose: None,
        calibration: None,
    }
}

#[test]
fn seed_camera_is_matched() {
    let camera = seed(20, Aperture::Square, Layout::Square, 0.0);
    assert!((camera.aperture_mm() - 100.0).abs() < 1e-12);
    assert!((camera.demagnification() * camera.aperture_mm() - camera.microlenses.pitch_mm).abs() < 1e-12);
}

#[test]
fn noise_comes_back_and_is_checked() {
    let mut camera = seed(20, Aperture::Square, Layout::Square, 0.0);
    assert!(!camera.to_json().contains("noise"));
    camera.sensor_noise = Some(SensorNoise { gain_counts: 0.4, read_noise_counts: 2.5 });
    assert_eq!(Camera::from_json(&camera.to_json()).unwrap(), camera);
    camera.sensor_noise = Some(SensorNoise { gain_counts: -1.0, read_noise_counts: 2.5 });
    assert_eq!(camera.check().unwrap_err().found, "sensor_noise.gain_counts is -1");
}

#[test]
fn an_exit_pupil_sets_the_cone_of_light_and_the_demagnification() {
    let plain = seed(20, Aperture::Circle, Layout::Square, 0.0);
    assert!(!plain.to_json().contains("pupil") && plain.blocks().is_empty());
    let mut camera = plain.clone();
    camera.main_lens.pupil_distance_mm = Some(500.0);
    assert_eq!(camera.aperture_mm(), 125.0);
    assert_eq!(camera.demagnification(), 0.308 / 500.0);
    assert_eq!(camera.image_distance_mm(), plain.image_distance_mm());
    // The image of the stop under a lenslet is f_l / N_w wide, wherever the pupil stands.
    assert!((camera.demagnification() * camera.aperture_mm() - 0.077).abs() < 1e-12);
    assert_eq!(camera.blocks(), ["main_lens.pupil_distance_mm"]);
    assert!(camera.misalignment().is_none(), "rays stay straight");
    assert_eq!(Camera::from_json(&camera.to_json()).unwrap(), camera);
    let mut far = plain.clone();
    far.main_lens.pupil_vergence_per_mm = Some(-1.0 / 500.0);
    assert_eq!((far.aperture_mm(), far.demagnification(), far.pupil_distance_mm()), (100.0, 0.308 / 400.0, -500.0));
    assert_eq!((far.image_growth(), Camera::from_json(&far.to_json()).unwrap()), (-0.308 / 500.0, far.clone()));
    for (vergence, distance, found) in [
        (f64::NAN, None, "main_lens.pupil_vergence_per_mm has the number NaN"),
        (-2.0, None, "main_lens.pupil_vergence_per_mm is -2"),
        (0.0, Some(400.0), "main_lens has 'pupil_distance_mm' and 'pupil_vergence_per_mm'"),
    ] {
        (far.main_lens.pupil_vergence_per_mm, far.main_lens.pupil_distance_mm) = (Some(vergence), distance);
        assert_eq!(far.check().unwrap_err().found, found);
    }
    let mut steep = plain.clone();
    steep.main_lens.telecentric = Some(Telecentric { index: 1.0 });
    assert_eq!((steep.check(), steep.image_growth(), steep.pupil_distance_mm()), (Ok(()), 0.0, f64::INFINITY));
    (steep.main_lens.magnification, steep.main_lens.working_f_number) = (20.0, 10.0);
    assert!(steep.check().unwrap_err().found.ends_with("rays of sine 1.00 before the lens"));
    let slip = "main_lens.pupil_distance_mm is 0.5 (0.5 m are 500 mm)";
    for (wrong, found) in [(-3.0, "main_lens.pupil_distance_mm is -3"), (0.5, slip)] {
        camera.main_lens.pupil_distance_mm = Some(wrong);
        let refusal = camera.check().unwrap_err();
        assert_eq!(refusal.found, found, "{refusal:?}");
    }
}
