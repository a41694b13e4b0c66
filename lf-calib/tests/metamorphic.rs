//! An image that is turned, cropped or scaled gives the lattice that is turned, cropped or the same.

use crate::scenes::{camera, discs, image_px, noisy};
use glam::DVec2;
use lf_calib::{Keep, calibrate, find_lattice};
use lf_core::{Camera, camera::Layout, lattice::Centres};
use ndarray::{Array2, s};
use std::sync::OnceLock;

const SIZE: DVec2 = DVec2::new(434.0, 350.0);

fn image(layout: Layout, centres: Option<Centres>) -> Array2<f32> {
    let mut camera = camera(0, layout, 0.02, [0.0123, -0.0257]);
    (camera.sensor.width, camera.sensor.height) = (SIZE.x as usize, SIZE.y as usize);
    camera.centres = centres;
    let mut image = discs(&camera, 0.9);
    noisy(&mut image, 0.01);
    image
}

/// A relay lens that bends the frame by two pixels, and a little keystone.
fn bent() -> Centres {
    let (k, r) = (0.0015, 0.012);
    Centres {
        radius_mm: 1.5,
        x_mm: vec![0.0, 0.0, k, 0.0, 0.0, -r, 0.0, -r, 0.0],
        y_mm: vec![0.0, 0.0, 0.0, k, 0.0, 0.0, -r, 0.0, -r],
    }
}

/// The camera measured from an image. Only the lens and the size are given.
fn measured(image: &Array2<f32>) -> Camera {
    let mut nominal = camera(0, Layout::Square, 0.0, [0.0, 0.0]);
    (nominal.sensor.width, nominal.sensor.height) = (image.ncols(), image.nrows());
    calibrate(&find_lattice(image, &|_| ()).unwrap(), &nominal, Keep::default()).unwrap().camera
}

/// Every lenslet image of `before`, moved, must be a lenslet image of `after` if it lies in the frame.
fn agree(before: &Camera, after: &Camera, moved: impl Fn(DVec2) -> DVec2) {
    assert_eq!(before.microlenses.layout, after.microlenses.layout);
    assert_eq!(before.centres.is_some(), after.centres.is_some());
    let size = DVec2::new(after.sensor.width as f64, after.sensor.height as f64);
    let mut count = 0;
    let (lattice, optics) = (after.lattice(), lf_core::optics::Optics::new(after));
    for place in image_px(before) {
        let place = moved(place);
        if place.clamp(DVec2::ZERO, size) != place {
            continue;
        }
        let sensor_mm = (place - 0.5 * size) * after.sensor.pixel_pitch_mm;
        let (i, j) = lattice.lenslet_at(sensor_mm / (1.0 + after.demagnification()));
        let off = optics.place_px(lattice.centre_mm(i, j) * (1.0 + after.demagnification())).distance(place);
        assert!(off < 0.006, "{place}: {off}");
        count += 1;
    }
    assert!(count > 300, "{count}");
}

/// An image, and the camera measured from it.
struct Case {
    image: Array2<f32>,
    before: Camera,
}

/// A square lattice, a bent one, and a bent hexagonal one.
fn cases() -> &'static [Case; 3] {
    static CASES: OnceLock<[Case; 3]> = OnceLock::new();
    let layouts = [(Layout::Square, None), (Layout::Square, Some(bent())), (Layout::Hexagonal, Some(bent()))];
    CASES.get_or_init(|| {
        layouts.map(|(layout, centres)| {
            let image = image(layout, centres.clone());
            let before = measured(&image);
            assert_eq!(before.centres.is_some(), centres.is_some());
            Case { image, before }
        })
    })
}

#[test]
fn mirrored_transposed_and_turned() {
    for Case { image, before } in cases() {
        let mirrored = measured(&image.slice(s![.., ..;-1]).to_owned());
        agree(before, &mirrored, |place| DVec2::new(SIZE.x - place.x, place.y));
        let transposed = measured(&image.t().to_owned());
        agree(before, &transposed, |place| DVec2::new(place.y, place.x));
        let turned = measured(&image.t().slice(s![.., ..;-1]).to_owned());
        agree(before, &turned, |place| DVec2::new(SIZE.y - place.y, place.x));
    }
}

#[test]
fn cropped() {
    for Case { image, before } in cases() {
        let cropped = measured(&image.slice(s![23..331, 31..400]).to_owned());
        agree(before, &cropped, |place| place - DVec2::new(31.0, 23.0));
    }
}

#[test]
fn scaled_counts_and_a_pedestal() {
    let Case { image, before } = &cases()[0];
    for changed in
        [image.mapv(|value| 1e-3 * value), image.mapv(|value| 50.0 * value), image.mapv(|value| value + 500.0)]
    {
        agree(before, &measured(&changed), |place| place);
    }
}
