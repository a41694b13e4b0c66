//! The weights of tomographic PIV (Elsinga et al. 2006), carried over to a lenslet's pixels: the share of a sphere (the
//! voxel) that lies inside a cylinder (a pixel's line of sight through the middle of its lenslet).
//! For comparison only. It takes the whole lenslet for its middle; Shi et al. (2016) show the cost.

use super::geometry::Geometry;
use crate::camera::{Aperture, Camera};
use glam::DVec2;
use std::{f64::consts::PI, ops::Range};

/// Steps of the table over the distance between sphere and line of sight.
const STEPS: usize = 256;
/// Rings, and points on each, of the sum over a sphere.
const RINGS: usize = 48;

/// Sphere-cylinder weights.
#[derive(Debug, Clone)]
pub struct Sphere {
    pub(super) geometry: Geometry,
    /// Share of the sphere inside the cylinder, by their distance from 0 to `reach_mm`.
    shares: Vec<f32>,
    /// The distance at which sphere and cylinder part, on the array, mm.
    reach_mm: f64,
    half_image_mm: f64,
    /// Factor that makes the weights of a voxel sum to 1 on average.
    scale: f64,
}

impl Sphere {
    /// The cylinder is as wide as a lenslet; the sphere has the volume of a cube as wide as a voxel.
    pub(super) fn new(camera: &Camera, geometry: Geometry) -> Self {
        let pitch = camera.microlenses.pitch_mm;
        let [dx, dy, _] = geometry.grid.spacing_mm;
        let width = camera.main_lens.magnification * (dx * dy).sqrt();
        let sphere = width * (0.75 / PI).cbrt();
        let cylinder = 0.5 * pitch;
        let reach_mm = cylinder + sphere;
        let share = |n: usize| inside(n as f64 / STEPS as f64 * reach_mm, sphere, cylinder) as f32;
        let sections = camera.pitch_px() * (1.0 + camera.image_growth());
        let stop = if camera.main_lens.aperture == Aperture::Circle { 0.25 * PI } else { 1.0 };
        let lenslets = PI * cylinder * cylinder / camera.lattice().cell_area_mm2();
        // The image of the aperture under a lenslet is k D wide.
        let image = camera.stop_image_px();
        Self {
            shares: (0..=STEPS).map(share).collect(),
            reach_mm,
            half_image_mm: 0.5 * image.min(sections) * camera.sensor.pixel_pitch_mm,
            scale: 1.0 / (image * image * stop * lenslets),
            geometry,
        }
    }

    pub(super) fn visit(&self, voxel: [usize; 3], wanted: impl Fn(u32) -> bool, mut found: impl FnMut(u32, u32, f32)) {
        let Geometry { grid, optics, .. } = &self.geometry;
        let [x, y, z] = std::array::from_fn(|axis| grid.centre_mm(axis, voxel[axis]));
        let (alpha, k) = (optics.alpha(z), optics.demagnification);
        let chief = optics.straight_rays(z).chief_mm(DVec2::new(x, y));
        let spread = alpha.abs() * optics.half_aperture_mm + self.reach_mm;
        for centre in optics.lenslets_seen(chief, DVec2::splat(spread)) {
            let [columns, rows] = self.pixels(alpha, chief, centre);
            for row in rows.filter(|row| wanted(*row)) {
                for column in columns.clone() {
                    // The line of sight of the pixel at s comes from U = (L / l) c - (s - c) / k.
                    let aperture = optics.pupil_ratio * centre - (optics.centre_mm(column, row) - centre) / k;
                    let distance = (chief + alpha * aperture - centre).length();
                    if optics.passes(aperture) && distance < self.reach_mm {
                        let step = (distance / self.reach_mm * STEPS as f64).round() as usize;
                        let weight = self.scale as f32 * self.shares[step];
                        if weight > 0.0 {
                            found(column, row, weight);
                        }
                    }
                }
            }
        }
    }

    /// Columns and rows of the pixels under a lenslet whose lines of sight may reach the voxel.
    fn pixels(&self, alpha: f64, chief: DVec2, centre: DVec2) -> [Range<u32>; 2] {
        let optics = &self.geometry.optics;
        let k = optics.demagnification;
        let middle = centre * (1.0 + optics.image_growth());
        let (mut low, mut high) = (middle - self.half_image_mm, middle + self.half_image_mm);
        if alpha.abs() * optics.half_aperture_mm > self.reach_mm {
            let at = |side: f64| {
                centre + k * (optics.pupil_ratio * centre - (centre - chief + side * self.reach_mm) / alpha)
            };
            let (a, b) = (at(-1.0), at(1.0));
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        }
        let (low, high) = (optics.place_px(low), optics.place_px(high));
        [0, 1].map(|axis| {
            let clamp = |value: f64| value.clamp(0.0, optics.sensor_px[axis] as f64) as u32;
            clamp(low[axis].floor())..clamp(high[axis].ceil())
        })
    }
}

/// Share of a sphere of radius `sphere` that lies within `cylinder` of a line at `distance` from its middle.
fn inside(distance: f64, sphere: f64, cylinder: f64) -> f64 {
    let (mut within, mut all) = (0.0, 0.0);
    for ring in 0..RINGS {
        let r = (ring as f64 + 0.5) / RINGS as f64 * sphere;
        let column = r * (sphere * sphere - r * r).sqrt();
        for spoke in 0..RINGS {
            let angle = (spoke as f64 + 0.5) / RINGS as f64 * PI;
            let (sin, cos) = angle.sin_cos();
            all += column;
            if (distance + r * cos).hypot(r * sin) <= cylinder {
                within += column;
            }
        }
    }
    within / all
}

#[cfg(test)]
mod tests {
    use super::inside;

    /// A plane through the middle halves a sphere. A plane at half the radius leaves a cap of 5/32 of the volume:
    /// h^2 (3 r - h) / (4 r^3) with h = r / 2.
    #[test]
    fn a_wide_cylinder_cuts_as_a_plane_does() {
        assert!((inside(0.0, 1.0, 2.0) - 1.0).abs() < 1e-12);
        assert!((inside(1000.0, 1.0, 1000.0) - 0.5).abs() < 0.01);
        assert!((inside(1000.5, 1.0, 1000.0) - 5.0 / 32.0).abs() < 0.01);
        assert_eq!(inside(1001.1, 1.0, 1000.0), 0.0);
    }

    /// A thin cylinder of radius r through the middle of a unit sphere holds 2 pi r^2 of 4 pi / 3.
    #[test]
    fn a_thin_cylinder_cuts_a_core() {
        assert!((inside(0.0, 1.0, 0.3) - 1.5 * 0.09).abs() < 0.02);
    }
}
