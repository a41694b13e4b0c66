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
        tilt: None,
        medium: None,
        centres: None,
        vignetting: None,
        calibration: None,
    }
}

#[test]
fn seed_camera_is_matched() {
    let camera = seed(20, Aperture::Square, Layout::Square, 0.0);
    assert!((camera.aperture_mm() - 100.0).abs() < 1e-12);
    assert!((camera.demagnification() * camera.aperture_mm() - camera.microlenses.pitch_mm).abs() < 1e-12);
}
