//! The unknowns that all particles share in one camera: their size and the drift of the camera's lattice.
//!
//! Another such unknown needs a field here with its lines in `values`, `moved`, `scales` and `model`, its flag in
//! [`Free`], and its derivative among [`lf_core::particle_image::QUANTITIES`].

use lf_core::particle_image::ParticleModel;
use lf_core::{Camera, Refusal};

/// Number of unknowns in a shape.
pub(crate) const SHAPES: usize = 3;
/// Smallest and largest size, pixels.
const SIZES_PX: [f64; 2] = [0.15, 5.0];

/// Size and drift, pixels: of the focal plane, and of the sensor along its columns and rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Standard deviation of a particle, pixels of the focal plane.
    pub sigma_px: f64,
    /// Shift of the lattice against the camera's, pixels.
    pub drift_px: [f64; 2],
}

/// The shared unknowns that are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Free {
    /// The size.
    pub size: bool,
    /// The drift.
    pub drift: bool,
    /// The poses of further cameras.
    pub pose: bool,
}

impl Free {
    /// Whether each unknown of a shape is fitted.
    pub(crate) fn shapes(&self) -> [bool; SHAPES] {
        [self.size, self.drift, self.drift]
    }
}

impl Shape {
    /// The model of particles of this shape.
    pub(crate) fn model(&self, camera: &Camera, depth_mm: [f64; 2]) -> Result<ParticleModel, Refusal> {
        ParticleModel::new(&self.camera(camera), self.sigma_px * camera.pixel_in_focus_mm(), depth_mm)
    }

    /// The camera with its lattice where it is found.
    pub fn camera(&self, camera: &Camera) -> Camera {
        let mut moved = camera.clone();
        for (axis, offset) in moved.microlenses.offset_mm.iter_mut().enumerate() {
            *offset += self.drift_px[axis] * camera.sensor.pixel_pitch_mm;
        }
        moved
    }

    fn values(&self) -> [f64; SHAPES] {
        [self.sigma_px, self.drift_px[0], self.drift_px[1]]
    }

    /// Whether an unknown differs from that of another shape by more than its standard uncertainty.
    pub(crate) fn is_beyond(&self, other: &Self, std: [f64; SHAPES]) -> bool {
        let (own, other) = (self.values(), other.values());
        (0..SHAPES).any(|k| (own[k] - other[k]).abs() > std[k])
    }

    /// The shape after a step.
    pub(crate) fn moved(&self, step: [f64; SHAPES]) -> Self {
        let [size, x, y] = step;
        let sigma_px = (self.sigma_px + size).clamp(SIZES_PX[0], SIZES_PX[1]);
        Self { sigma_px, drift_px: [self.drift_px[0] + x, self.drift_px[1] + y] }
    }

    /// The step of each unknown, mm, that a step of one pixel is.
    pub(crate) fn scales(camera: &Camera) -> [f64; SHAPES] {
        let pitch_mm = camera.sensor.pixel_pitch_mm;
        [camera.pixel_in_focus_mm(), pitch_mm, pitch_mm]
    }
}
