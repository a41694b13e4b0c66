//! Sources of rays: particles with their glow, and the cells of a white image.

use super::samples::Shape;
use glam::DVec2;
use lf_core::{Camera, camera::Aperture};

/// The light that a particle sends out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Shape of its image in focus.
    pub shape: Shape,
    /// Standard deviation of a Gaussian, radius of a disc; at the object, mm.
    pub size_mm: f64,
    /// Number of its rays.
    pub rays: RayCount,
}

/// Number of rays that a particle sends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RayCount {
    /// One number for all particles.
    Fixed(u32),
    /// Scaled with the brightness, so that all particles have the same noise in counts.
    Scaled {
        /// Rays of a particle of `at_intensity`.
        rays: u32,
        /// Intensity, counts.
        at_intensity: f64,
    },
}

/// A scaled number of rays is clamped to 1/8..8 of the reference.
const CLAMP: f64 = 8.0;

/// Rays that leave a relative noise below 0.01: `--measure-noise` finds 0.007 to 0.009 in the ready scenes core,
/// core-round, core-hexagonal and demo, and 0.001 with the rays that the power law gives for that.
const RAYS_AT_HUNDREDTH: f64 = 15_000.0;

/// The noise falls with the number of rays to the power of 3/4.
const RAYS_PER_NOISE: f64 = 4.0 / 3.0;

impl RayCount {
    /// Rays that leave a relative noise `noise` for particles of average brightness `at_intensity`.
    pub fn for_noise(noise: f64, at_intensity: f64) -> Self {
        let rays = (RAYS_AT_HUNDREDTH * (0.01 / noise).powf(RAYS_PER_NOISE)).clamp(256.0, 2e7) as u32;
        Self::Scaled { rays, at_intensity }
    }

    /// Rays of a particle of this intensity.
    pub fn of_intensity(self, intensity: f64) -> usize {
        match self {
            Self::Fixed(rays) => rays as usize,
            Self::Scaled { rays, at_intensity } => {
                let share = (intensity / at_intensity).powf(RAYS_PER_NOISE).clamp(1.0 / CLAMP, CLAMP);
                (f64::from(rays) * share).ceil() as usize
            }
        }
    }
}

/// A rectangle of the array, in cells of about a pitch that each send the same number of rays.
pub struct WhiteCells {
    pub(super) columns: usize,
    /// Rows of cells.
    pub rows: usize,
    /// Low corner of the first cell.
    pub(super) corner_mm: DVec2,
    pub(super) cell_mm: DVec2,
    pub(super) rays_per_cell: usize,
    pub(super) counts_per_cell: f64,
}

impl WhiteCells {
    /// Covers the sensor and three lenslets around it. A pixel that sees only lit aperture holds `level` counts; each
    /// lenslet gets `rays` rays.
    pub fn new(camera: &Camera, level: f64, rays: u32) -> Self {
        let (pitch_mm, pixel_mm) = (camera.microlenses.pitch_mm, camera.sensor.pixel_pitch_mm);
        let half = 0.5 * pixel_mm * DVec2::new(camera.sensor.width as f64, camera.sensor.height as f64);
        let reach = half + 3.0 * pitch_mm;
        let count = (2.0 * reach / pitch_mm).ceil();
        let cell_mm = 2.0 * reach / count;
        // A pixel's share of its lenslet's light is its area over that of the aperture's image.
        let image_side_mm = camera.demagnification() * camera.aperture_mm();
        let filled = match camera.main_lens.aperture {
            Aperture::Circle => std::f64::consts::FRAC_PI_4,
            Aperture::Square => 1.0,
        };
        let per_lenslet = level * image_side_mm.powi(2) * filled / pixel_mm.powi(2);
        let counts_per_cell = per_lenslet * cell_mm.x * cell_mm.y / camera.lattice().cell_area_mm2();
        let (columns, rows) = (count.x as usize, count.y as usize);
        Self { columns, rows, corner_mm: -reach, cell_mm, rays_per_cell: rays as usize, counts_per_cell }
    }
}
