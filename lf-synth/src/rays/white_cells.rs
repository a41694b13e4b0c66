//! The part of the array that a white image lights.

use glam::DVec2;
use lf_core::{Camera, camera::Aperture};

/// A rectangle of the array, in cells of about a pitch that each send the same number of rays.
pub(super) struct WhiteCells {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Corner of the first cell.
    pub(super) corner_mm: DVec2,
    /// Sides of a cell.
    pub(super) side_mm: DVec2,
    /// Rays of a cell.
    pub(super) rays: usize,
    /// Counts of a cell.
    pub(super) counts: f64,
    /// Counts of a ray.
    pub(super) counts_per_ray: f64,
}

impl WhiteCells {
    /// Covers the sensor and three lenslets around it. A pixel that sees only lit aperture holds `level` counts; each
    /// lenslet gets `rays` rays.
    pub(super) fn new(camera: &Camera, level: f64, rays: u32) -> Self {
        let (pitch_mm, pixel_mm) = (camera.microlenses.pitch_mm, camera.sensor.pixel_pitch_mm);
        let half = 0.5 * pixel_mm * DVec2::new(camera.sensor.width as f64, camera.sensor.height as f64);
        let reach = half + 3.0 * pitch_mm;
        let count = (2.0 * reach / pitch_mm).ceil();
        let side_mm = 2.0 * reach / count;
        // A pixel's share of its lenslet's light is its area over that of the aperture's image.
        let image_side_mm = camera.demagnification() * camera.aperture_mm();
        let filled = match camera.main_lens.aperture {
            Aperture::Circle => std::f64::consts::FRAC_PI_4,
            Aperture::Square => 1.0,
        };
        let per_lenslet = level * image_side_mm.powi(2) * filled / pixel_mm.powi(2);
        let counts = per_lenslet * side_mm.x * side_mm.y / camera.lattice().cell_area_mm2();
        Self {
            columns: count.x as usize,
            rows: count.y as usize,
            corner_mm: -reach,
            side_mm,
            rays: rays as usize,
            counts,
            counts_per_ray: counts / f64::from(rays),
        }
    }
}
