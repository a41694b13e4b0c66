//! A particle of a table.

use glam::{DMat3, DVec3};

/// One line of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// Number of the particle, the same in every frame where it is known.
    pub id: u64,
    /// Centre, mm.
    pub place_mm: [f64; 3],
    /// Light that it sends through the aperture, counts.
    pub intensity: f64,
    /// How uncertain centre and light are; None in a table of true particles.
    pub uncertainty: Option<Uncertainty>,
}

/// How uncertain a measured particle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertainty {
    /// Covariance of the centre, mm²: symmetric, positive semidefinite.
    pub covariance_mm2: DMat3,
    /// Standard uncertainty of the light, counts.
    pub intensity: f64,
}

impl Uncertainty {
    /// Standard uncertainty of x, y and z, mm.
    pub fn std_mm(&self) -> DVec3 {
        self.covariance_mm2.diagonal().map(f64::sqrt)
    }
}
