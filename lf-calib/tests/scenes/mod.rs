//! White images drawn without the code under test.
#![allow(dead_code)]

pub mod points;

use glam::DVec2;
use lf_calib::DataSheet;
use lf_core::camera::{Aperture, Layout};
use lf_core::{Camera, Optics};
use ndarray::Array2;

/// The camera of the simulations with a round stop: lenslets of 14 px whose discs touch. Side 0 stands for a size that
/// the caller sets.
pub fn camera(side: usize, layout: Layout, rotation_rad: f64, offset_mm: [f64; 2]) -> Camera {
    let sheet = DataSheet {
        sensor_px: [side.max(1); 2],
        pixel_mm: 0.0055,
        focal_length_mm: 200.0,
        magnification: 1.0,
        working_f_number: 4.0,
        aperture: Aperture::Circle,
        telecentric_index: None,
        wavelength_nm: None,
        layout,
        pitch_mm: 0.077,
        lenslet_focal_length_mm: 0.308,
    };
    let mut camera = sheet.camera(None).unwrap();
    camera.microlenses.rotation_rad = rotation_rad;
    camera.microlenses.offset_mm = offset_mm;
    camera
}

/// The camera as its data sheet might describe it: the true lens, a lattice that is roughly right.
pub fn nominal(truth: &Camera) -> Camera {
    let mut nominal = truth.clone();
    nominal.microlenses.pitch_mm *= 1.02;
    nominal.microlenses.rotation_rad -= 0.01;
    nominal.microlenses.offset_mm[0] += 0.003;
    nominal.microlenses.offset_mm[1] -= 0.002;
    nominal
}

/// Largest distance between a lenslet image and that of the truth, within the frame, px.
pub fn farthest_px(found: &Camera, truth: &Camera) -> f64 {
    let px_per_mm = (1.0 + truth.demagnification()) / truth.sensor.pixel_pitch_mm;
    let half = 0.5 * truth.sensor.pixel_pitch_mm * DVec2::new(truth.sensor.width as f64, truth.sensor.height as f64);
    let lattice = found.lattice();
    let off = |centre: DVec2| {
        let (i, j) = lattice.lenslet_at(centre);
        lattice.centre_mm(i, j).distance(centre) * px_per_mm
    };
    truth.lattice().lenslets_within(DVec2::ZERO, half).map(|(_, _, centre)| off(centre)).fold(0.0, f64::max)
}

/// Lenslet images of a camera without tilt within its frame, px from the left and top edge.
pub fn image_px(camera: &Camera) -> Vec<DVec2> {
    let size = DVec2::new(camera.sensor.width as f64, camera.sensor.height as f64);
    let px_per_mm = (1.0 + camera.demagnification()) / camera.sensor.pixel_pitch_mm;
    let lattice = camera.lattice();
    let places = lattice.lenslets_within(DVec2::ZERO, 0.5 * size / px_per_mm);
    places.map(|(_, _, centre)| centre * px_per_mm + 0.5 * size).collect()
}

/// Discs of `fill` times the stop's image on black. A pixel counts 1000 times its area that is covered, summed over
/// discs, from 64 chords.
pub fn discs(camera: &Camera, fill: f64) -> Array2<f32> {
    let radius = 0.5 * fill * camera.stop_image_px();
    spots(camera, radius, |corner, _| covered(corner, &[(DVec2::ZERO, radius)]))
}

/// Discs whose light falls with the square of the distance from the middle, by this share at the rim.
pub fn shaded_discs(camera: &Camera, falls: f64) -> Array2<f32> {
    let radius = 0.5 * camera.stop_image_px();
    let light = |corner: DVec2| 1.0 - falls * (corner + 0.5).length_squared() / (radius * radius);
    spots(camera, radius, |corner, _| light(corner) * covered(corner, &[(DVec2::ZERO, radius)]))
}

/// The discs of [`discs`], cut by second discs of `second` times their size. A second disc is displaced by `drift`
/// times the distance of its lenslet image from the middle of the frame.
pub fn cut_discs(camera: &Camera, fill: f64, second: f64, drift: f64) -> Array2<f32> {
    let radius = 0.5 * fill * camera.stop_image_px();
    spots(camera, radius, |corner, place| covered(corner, &[(DVec2::ZERO, radius), (drift * place, second * radius)]))
}

/// Like [`discs`], but with a square stop, sides along x and y. The covered area is exact.
pub fn squares(camera: &Camera, fill: f64) -> Array2<f32> {
    let half = 0.5 * fill * camera.stop_image_px();
    let side = |corner: f64| ((corner + 1.0).min(half) - corner.max(-half)).max(0.0);
    spots(camera, half, |corner, _| side(corner.x) * side(corner.y))
}

/// Adds 1000 times `share` to every pixel within `reach_px` of each lenslet image. `share` gets the corner of the pixel
/// from the centre of the image, and that centre from the middle of the frame, px.
fn spots(camera: &Camera, reach_px: f64, share: impl Fn(DVec2, DVec2) -> f64) -> Array2<f32> {
    let pitch = camera.sensor.pixel_pitch_mm;
    let (width, height) = (camera.sensor.width, camera.sensor.height);
    let middle = 0.5 * DVec2::new(width as f64, height as f64);
    let mut image = Array2::zeros((height, width));
    for (_, _, centre) in camera.lattice().lenslets_within(DVec2::ZERO, (middle + reach_px) * pitch) {
        let centre = centre * (1.0 + camera.demagnification()) / pitch + middle;
        let range = |centre: f64, size: usize| {
            let edge = |place: f64| place.clamp(0.0, size as f64) as usize;
            edge((centre - reach_px).floor())..edge((centre + reach_px).ceil())
        };
        for row in range(centre.y, height) {
            for column in range(centre.x, width) {
                let corner = DVec2::new(column as f64, row as f64) - centre;
                image[(row, column)] += (1000.0 * share(corner, centre - middle)) as f32;
            }
        }
    }
    image
}

/// Random rays through the shared optics, from the whole array through the whole stop, counted by pixel and scaled to a
/// mean of 1000 in the discs.
pub fn rays(camera: &Camera, per_pixel: usize) -> Array2<f32> {
    let optics = Optics::new(camera);
    let (width, height) = (camera.sensor.width, camera.sensor.height);
    let half =
        0.5 * camera.sensor.pixel_pitch_mm * DVec2::new(width as f64, height as f64) + camera.microlenses.pitch_mm;
    let mut image = Array2::zeros((height, width));
    let mut state = 1;
    for _ in 0..width * height * per_pixel {
        let mut signed = || 2.0 * uniform(&mut state) - 1.0;
        let array = half * DVec2::new(signed(), signed());
        let stop = optics.half_aperture_mm * DVec2::new(signed(), signed());
        if !optics.passes(stop) {
            continue;
        }
        if let Some((column, row)) = optics.pixel_at(optics.sensor_from_array(array, stop)) {
            image[(row, column)] += 1000.0 / per_pixel as f32;
        }
    }
    image
}

/// Area of the unit square with this corner inside all discs, (centre, radius).
fn covered(corner: DVec2, discs: &[(DVec2, f64)]) -> f64 {
    let nearest = |centre: DVec2| (corner - centre).max(DVec2::ZERO).max(-(corner + 1.0 - centre)).length();
    let farthest = |centre: DVec2| (corner - centre).abs().max((corner + 1.0 - centre).abs()).length();
    if discs.iter().all(|(centre, radius)| farthest(*centre) <= *radius) {
        return 1.0;
    }
    if discs.iter().any(|(centre, radius)| nearest(*centre) >= *radius) {
        return 0.0;
    }
    const CHORDS: usize = 64;
    let chord = |n: usize| {
        let x = corner.x + (n as f64 + 0.5) / CHORDS as f64;
        let (mut low, mut high) = (corner.y, corner.y + 1.0);
        for (centre, radius) in discs {
            let half = (radius * radius - (x - centre.x).powi(2)).max(0.0).sqrt();
            (low, high) = (low.max(centre.y - half), high.min(centre.y + half));
        }
        (high - low).max(0.0)
    };
    (0..CHORDS).map(chord).sum::<f64>() / CHORDS as f64
}

/// Adds noise of standard deviation `share` times the count, with one random stream for each pixel.
pub fn noisy(image: &mut Array2<f32>, share: f64) {
    for (n, value) in image.iter_mut().enumerate() {
        let mut state = n as u64 ^ 0x9e37_79b9_7f4a_7c15;
        *value =
            (*value as f64 * (1.0 + share * ((0..12).map(|_| uniform(&mut state)).sum::<f64>() - 6.0))).max(0.0) as f32;
    }
}

/// A random number from 0 to 1 (SplitMix64).
pub fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
