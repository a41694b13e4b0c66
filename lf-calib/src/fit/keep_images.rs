//! Microlenses that keep their images where a white image has shown them. When the gap, the tilt or the image distance
//! of a camera changes, its lenslets have to move so that the images stay: see [`crate::fit::lenslet_images`].

use super::{lenslet_images::LensletImages, polynomial::Polynomial, polynomial::TiePoint};
use glam::DVec2;
use lf_core::{Camera, lattice::Centres, lattice::MOST_DEGREE};

/// Samples of the departure along each side of the frame.
const SAMPLES: usize = 13;

/// Motion of the lenslet images on the sensor: a turn about its middle, then a shift.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Drift {
    pub shift_mm: DVec2,
    /// From x towards y.
    pub turn_rad: f64,
}

/// Moves the lenslets of `camera` so that their images are where `before` has them, moved by `drift`. The main lens,
/// gap and tilt of `camera` are already set. Accurate to 1e-5 px.
pub(crate) fn keep_images(camera: &mut Camera, before: &Camera, drift: Drift) {
    let (k, k_before) = (camera.image_growth(), before.image_growth());
    let turn = DVec2::from_angle(drift.turn_rad);
    // Without tilt, the images of a perfect lattice are a perfect lattice.
    let moved = |perfect: DVec2| (turn.rotate(perfect) * (1.0 + k_before) + drift.shift_mm) / (1.0 + k);
    camera.microlenses.pitch_mm = before.microlenses.pitch_mm * (1.0 + k_before) / (1.0 + k);
    camera.microlenses.rotation_rad = before.microlenses.rotation_rad + drift.turn_rad;
    camera.microlenses.offset_mm = moved(DVec2::from(before.microlenses.offset_mm)).to_array();
    camera.centres = None;
    if before.centres.is_none() && camera.tilt.is_none() && before.tilt.is_none() {
        return;
    }
    let (images, images_before) = (LensletImages::new(camera), LensletImages::new(before));
    let pitch = camera.sensor.pixel_pitch_mm;
    let half = 0.5 * pitch * DVec2::new(camera.sensor.width as f64, camera.sensor.height as f64);
    let radius_mm = before.centres.as_ref().map_or(half.length(), |centres| centres.radius_mm);
    let degree = before.centres.as_ref().and_then(Centres::degree).unwrap_or(1).clamp(2, MOST_DEGREE);
    let tie = |n: usize| {
        let share = DVec2::new((n % SAMPLES) as f64, (n / SAMPLES) as f64) / (SAMPLES - 1) as f64 * 2.0 - 1.0;
        let perfect = half * share;
        let centre = perfect + before.centres.as_ref().map_or(DVec2::ZERO, |centres| centres.departure_mm(perfect));
        let image = turn.rotate(images_before.image_from_lenslet(centre)) + drift.shift_mm;
        let place = moved(perfect);
        (place, images.lenslet_from_image(image) - place)
    };
    let ties: Vec<TiePoint> = (0..SAMPLES * SAMPLES).map(tie).collect();
    // A sensor that is only a narrow strip does not determine the highest powers across it.
    let fitted = (1..=degree).rev().find_map(|degree| Polynomial::about(&ties, degree, DVec2::ZERO, radius_mm));
    let Some(departure) = fitted else { return };
    let [offset, coefficients @ ..] = departure.coefficients.as_slice() else { return };
    // A departure has no constant term; it goes into the offset.
    camera.microlenses.offset_mm[0] += offset.x;
    camera.microlenses.offset_mm[1] += offset.y;
    let along = |axis: usize| coefficients.iter().map(|coefficient| coefficient[axis]).collect();
    camera.centres = Some(Centres { radius_mm, x_mm: along(0), y_mm: along(1) });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::view::tests::seed;
    use lf_core::camera::{Layout, Tilt};
    use lf_core::optics::Optics;

    /// Largest distance between the images of the same lenslets, px.
    fn apart_px(one: &Camera, other: &Camera, drift: Drift) -> f64 {
        let images = |camera: &Camera| {
            let optics = Optics::new(camera);
            move |i: i64, j: i64| optics.sensor_from_array(optics.lattice().centre_mm(i, j), DVec2::ZERO)
        };
        let (one, other) = (images(one), images(other));
        let turn = DVec2::from_angle(drift.turn_rad);
        (-60..60)
            .flat_map(|i| (-60..60).map(move |j| (i, j)))
            .map(|(i, j)| (turn.rotate(one(i, j)) + drift.shift_mm).distance(other(i, j)) / 0.0055)
            .fold(0.0, f64::max)
    }

    #[test]
    fn images_stay_while_the_lens_behind_them_changes() {
        for layout in [Layout::Square, Layout::Hexagonal] {
            let mut plain = seed(120, layout);
            plain.microlenses.offset_mm = [0.012, -0.02];
            plain.microlenses.rotation_rad = 0.003;
            let mut bent = plain.clone();
            let x_mm = vec![0.004, -0.003, 0.002, 0.001, -0.002, 0.0015, -0.001, 0.0005, 0.001];
            let y_mm = x_mm.iter().rev().copied().collect();
            bent.centres = Some(Centres { radius_mm: 6.5, x_mm, y_mm });
            bent.tilt = Some(Tilt { x_rad: 0.01, y_rad: 0.004 });
            for before in [plain, bent] {
                for drift in [Drift::default(), Drift { shift_mm: DVec2::new(0.011, -0.004), turn_rad: 1e-3 }] {
                    let mut camera = before.clone();
                    camera.main_lens.magnification = 1.02;
                    camera.microlenses.gap_mm = Some(0.32);
                    keep_images(&mut camera, &before, drift);
                    assert!(apart_px(&before, &camera, drift) < 1e-3);
                    camera.tilt = Some(Tilt { x_rad: -0.005, y_rad: 0.007 });
                    keep_images(&mut camera, &before, drift);
                    let apart = apart_px(&before, &camera, drift);
                    assert!(apart < 1e-3, "{apart}");
                    camera.check().unwrap();
                }
            }
        }
    }

    #[test]
    fn no_change_leaves_the_camera_the_same() {
        let before = seed(40, Layout::Square);
        let mut camera = before.clone();
        keep_images(&mut camera, &before, Drift::default());
        assert_eq!(camera, before);
    }
}
