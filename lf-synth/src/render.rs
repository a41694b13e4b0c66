//! Rays to images.
//!
//! A ray carries an even share of its particle's counts. Its place in the aperture and in the particle image come from
//! a low-discrepancy sequence in four dimensions, shifted at random for each particle. Counts are summed as whole
//! numbers, so the image has the same bytes whatever the order of the rays.

use crate::particles::{Particle, stream};
use glam::{DVec2, DVec4};
use lf_core::camera::{Aperture, Camera};
use lf_core::optics::Optics;
use ndarray::Array2;
use rand::RngExt;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// An image, and the counts that reached it.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// Counts, shape (height, width).
    pub pixels: Array2<f32>,
    /// Counts sent through the aperture.
    pub emitted: f64,
    /// Counts that fell on the sensor.
    pub arrived: f64,
}

/// Steps of the generalised golden ratio in four dimensions (Roberts 2018): powers of 1/g, g the root of g^5 = g + 1.
const STEP: DVec4 =
    DVec4::new(0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_810_9, 0.538_597_257_223_612_4);

fn fraction(v: DVec4) -> DVec4 {
    v - v.floor()
}

/// Even on the square or disc of half width 1, from the unit square (Shirley & Chiu 1997 for the disc).
fn on_aperture(aperture: Aperture, part: DVec2) -> DVec2 {
    let square = part * 2.0 - 1.0;
    match aperture {
        Aperture::Square => square,
        Aperture::Circle => {
            let quarter = std::f64::consts::FRAC_PI_4;
            let (radius, angle) = if square.x.abs() > square.y.abs() {
                (square.x, quarter * square.y / square.x)
            } else if square.y != 0.0 {
                (square.y, std::f64::consts::FRAC_PI_2 - quarter * square.x / square.y)
            } else {
                return DVec2::ZERO;
            };
            radius * DVec2::from_angle(angle)
        }
    }
}

/// Two independent normal numbers from the unit square (Box & Muller 1958).
fn normal(part: DVec2) -> DVec2 {
    (-2.0 * (1.0 - part.x).ln()).sqrt() * DVec2::from_angle(std::f64::consts::TAU * part.y)
}

/// Sums of counts as whole numbers of a small part of a count.
struct Counts {
    sums: Vec<AtomicU64>,
    unit: f64,
}

impl Counts {
    /// For an image whose counts sum to no more than `total`.
    fn new(pixels: usize, total: f64) -> Self {
        // 2^62 units in all: no pixel overflows, and a unit is far below what an f32 of the sum resolves.
        let unit = if total > 0.0 { total / (1u64 << 62) as f64 } else { 1.0 };
        Self { sums: (0..pixels).map(|_| AtomicU64::new(0)).collect(), unit }
    }

    fn units(&self, counts: f64) -> u64 {
        (counts / self.unit) as u64
    }

    fn add(&self, pixel: usize, units: u64) {
        self.sums[pixel].fetch_add(units, Ordering::Relaxed);
    }

    fn finish(self, camera: &Camera, emitted: f64) -> Rendered {
        let total: u128 = self.sums.iter().map(|sum| u128::from(sum.load(Ordering::Relaxed))).sum();
        let pixels: Vec<f32> =
            self.sums.iter().map(|sum| (sum.load(Ordering::Relaxed) as f64 * self.unit) as f32).collect();
        let pixels =
            Array2::from_shape_vec((camera.sensor.height, camera.sensor.width), pixels).expect("one sum a pixel");
        Rendered { pixels, emitted, arrived: total as f64 * self.unit }
    }
}

/// Renders particles whose image is a Gaussian of `sigma_px` at the focal plane with `rays` rays each.
/// `done` is told how many particles are finished.
pub fn frame(
    camera: &Camera,
    particles: &[Particle],
    sigma_px: f64,
    rays: u32,
    seed: u64,
    done: impl Fn(u64) + Sync,
) -> Rendered {
    let optics = Optics::new(camera);
    let sigma_mm = sigma_px * camera.sensor.pixel_pitch_mm / camera.main_lens.magnification;
    let emitted: f64 = particles.iter().map(|particle| particle.intensity).sum();
    let counts = Counts::new(camera.sensor.width * camera.sensor.height, emitted);
    particles.par_iter().for_each(|particle| {
        let mut random = stream(seed ^ 0x7261_7973, particle.id);
        let mut part = DVec4::from_array(std::array::from_fn(|_| random.random()));
        let units = counts.units(particle.intensity / f64::from(rays));
        let (centre, z_mm) = (particle.place_mm.truncate(), particle.place_mm.z);
        for _ in 0..rays {
            part = fraction(part + STEP);
            let aperture =
                on_aperture(camera.main_lens.aperture, DVec2::new(part.x, part.y)) * optics.half_aperture_mm();
            let point = centre + sigma_mm * normal(DVec2::new(part.z, part.w));
            if let Some((x, y)) = optics.pixel_at(optics.sensor_from_object(point, z_mm, aperture)) {
                counts.add(y * camera.sensor.width + x, units);
            }
        }
        done(1);
    });
    counts.finish(camera, emitted)
}

/// Renders an evenly lit aperture seen through every lenslet of the sensor with `rays` rays each; a pixel that sees
/// nothing but lit aperture holds `level` counts. `done` is told how many rows of the array are finished.
pub fn white(camera: &Camera, level: f64, rays: u32, seed: u64, done: impl Fn(u64) + Sync) -> Rendered {
    let optics = Optics::new(camera);
    let sensor = &camera.sensor;
    let half = 0.5 * sensor.pixel_pitch_mm * DVec2::new(sensor.width as f64, sensor.height as f64);
    // Lit area of the array: the sensor and three lenslets around it.
    let reach = half + 3.0 * camera.microlenses.pitch_mm;
    let tiles = (2.0 * reach / camera.microlenses.pitch_mm).ceil();
    let tile = 2.0 * reach / tiles;
    // A pixel's share of its lenslet's light is its area over that of the aperture's image.
    let image_side_mm = camera.demagnification() * camera.aperture_mm();
    let image_area = image_side_mm.powi(2)
        * if camera.main_lens.aperture == Aperture::Circle { std::f64::consts::FRAC_PI_4 } else { 1.0 };
    let per_lenslet = level * image_area / sensor.pixel_pitch_mm.powi(2);
    let per_tile = per_lenslet * tile.x * tile.y / camera.lattice().cell_area_mm2();
    let emitted = per_tile * tiles.x * tiles.y;
    let counts = Counts::new(sensor.width * sensor.height, emitted);
    let units = counts.units(per_tile / f64::from(rays));
    (0..tiles.y as u64).into_par_iter().for_each(|row| {
        for column in 0..tiles.x as u64 {
            let mut random = stream(seed ^ 0x7768_6974, row * tiles.x as u64 + column);
            let mut part = DVec4::from_array(std::array::from_fn(|_| random.random()));
            let corner = DVec2::new(column as f64, row as f64) * tile - reach;
            for _ in 0..rays {
                part = fraction(part + STEP);
                let aperture =
                    on_aperture(camera.main_lens.aperture, DVec2::new(part.x, part.y)) * optics.half_aperture_mm();
                let place = corner + tile * DVec2::new(part.z, part.w);
                if let Some((x, y)) = optics.pixel_at(optics.sensor_from_array(place, aperture)) {
                    counts.add(y * sensor.width + x, units);
                }
            }
        }
        done(1);
    });
    counts.finish(camera, emitted)
}
