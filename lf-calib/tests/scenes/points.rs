//! Points of light drawn by rays through the shared optics: dot targets and particles.

use glam::{DVec2, DVec3};
use lf_core::camera::{Aperture, Layout};
use lf_core::{Camera, Optics};
use ndarray::Array2;

/// Number of rays of a point.
const RAYS: usize = 30_000;
/// Steps of the generalised golden ratio in four dimensions: the rays fill stop and dot evenly and beat with no
/// lattice.
const STEP: [f64; 4] = [0.856_674_883_854_503, 0.733_891_856_627_126, 0.628_706_721_037_811, 0.538_597_257_223_612];

/// The camera of the simulations with a square stop, which even rays fill.
pub fn camera(lenslets: usize) -> Camera {
    let mut camera = super::camera(14 * lenslets, Layout::Square, 0.0, [0.0; 2]);
    camera.main_lens.aperture = Aperture::Square;
    camera
}

/// Adds a disc of light of `counts` counts.
pub fn add(image: &mut Array2<f32>, optics: &Optics, place: DVec3, radius_mm: f64, counts: f64) {
    let each = (counts / RAYS as f64) as f32;
    let start = 1000.0 * (place.x + 3.0 * place.y).abs();
    for n in 0..RAYS {
        let [u, v, r, turn] = STEP.map(|step| (start + (n + 1) as f64 * step).fract());
        let part = DVec2::new(u, v) * 2.0 - 1.0;
        let point = place.truncate() + radius_mm * r.sqrt() * DVec2::from_angle(std::f64::consts::TAU * turn);
        let sensor = optics.sensor_from_object(point, place.z, part * optics.half_aperture_mm);
        if let Some((column, row)) = optics.pixel_at(sensor) {
            image[(row, column)] += each;
        }
    }
}

/// An image of points on a dark ground.
pub fn image(camera: &Camera, places: &[DVec3], radius_mm: f64, counts: f64) -> Array2<f32> {
    let optics = Optics::new(camera);
    let mut image = Array2::from_elem((camera.sensor.height, camera.sensor.width), 20.0);
    places.iter().for_each(|place| add(&mut image, &optics, *place, radius_mm, counts));
    image
}

/// The dots of a square grid at a depth.
pub fn grid(side: i64, spacing_mm: f64, z_mm: f64) -> Vec<DVec3> {
    let half = side / 2;
    (-half..=half)
        .flat_map(|row| (-half..=half).map(move |column| (row, column)))
        .map(|(row, column)| DVec3::new(column as f64 * spacing_mm, row as f64 * spacing_mm, z_mm))
        .collect()
}
