//! Turning, cropping and scaling an image moves the answer exactly as it must.

mod scenes;

use glam::{DMat2, DVec2};
use lf_calib::{ImageLattice, lattice};
use lf_core::camera::Layout;
use ndarray::{Array2, s};
use scenes::{camera, discs, noisy};

const WIDTH: f64 = 434.0;
const HEIGHT: f64 = 350.0;

fn image(layout: Layout) -> Array2<f32> {
    let mut camera = camera(0, layout, 0.02, [0.0123, -0.0257]);
    (camera.sensor.width, camera.sensor.height) = (WIDTH as usize, HEIGHT as usize);
    let mut image = discs(&camera, 0.9);
    noisy(&mut image, 0.01);
    image
}

/// Distance of a place from the nearest centre of a perfect lattice, px.
fn distance_px(found: &ImageLattice, place: DVec2) -> f64 {
    let along = found.pitch_px * DVec2::from_angle(found.rotation_rad);
    let across = match found.layout {
        Layout::Square => along.perp(),
        Layout::Hexagonal => DVec2::from_angle(std::f64::consts::FRAC_PI_3).rotate(along),
    };
    let basis = DMat2::from_cols(along, across);
    let rest = basis.inverse() * (place - DVec2::from(found.origin_px));
    (basis * (rest - rest.round())).length()
}

/// Every fitted centre of `before`, moved, must be a centre of `after`.
fn agree(before: &ImageLattice, after: &ImageLattice, moved: impl Fn(DVec2) -> DVec2) {
    assert_eq!(before.layout, after.layout);
    assert!((before.pitch_px / after.pitch_px - 1.0).abs() < 1e-5);
    for centre in &before.centres {
        let fitted = DVec2::from(centre.place_px) - DVec2::from(centre.residual_px);
        let off = distance_px(after, moved(fitted));
        assert!(off < 0.004, "{:?}: {off}", centre.index);
    }
}

#[test]
fn mirrored_transposed_and_turned() {
    for layout in [Layout::Square, Layout::Hexagonal] {
        let image = image(layout);
        let before = lattice::find(&image).unwrap();
        let mirrored = lattice::find(&image.slice(s![.., ..;-1]).to_owned()).unwrap();
        agree(&before, &mirrored, |place| DVec2::new(WIDTH - place.x, place.y));
        assert!((mirrored.rotation_rad + before.rotation_rad).abs() < 1e-5);
        let transposed = lattice::find(&image.t().to_owned()).unwrap();
        agree(&before, &transposed, |place| DVec2::new(place.y, place.x));
        let turned = lattice::find(&image.t().slice(s![.., ..;-1]).to_owned()).unwrap();
        agree(&before, &turned, |place| DVec2::new(HEIGHT - place.y, place.x));
    }
}

#[test]
fn cropped() {
    for layout in [Layout::Square, Layout::Hexagonal] {
        let image = image(layout);
        let before = lattice::find(&image).unwrap();
        let cropped = lattice::find(&image.slice(s![23..331, 31..400]).to_owned()).unwrap();
        assert!((before.pitch_px / cropped.pitch_px - 1.0).abs() < 1e-5);
        for centre in &cropped.centres {
            let fitted = DVec2::from(centre.place_px) - DVec2::from(centre.residual_px);
            let off = distance_px(&before, fitted + DVec2::new(31.0, 23.0));
            assert!(off < 0.004, "{off}");
        }
    }
}

#[test]
fn scaled_counts_and_a_pedestal() {
    let image = image(Layout::Square);
    let before = lattice::find(&image).unwrap();
    for changed in
        [image.mapv(|value| 1e-3 * value), image.mapv(|value| 50.0 * value), image.mapv(|value| value + 500.0)]
    {
        agree(&before, &lattice::find(&changed).unwrap(), |place| place);
    }
}
