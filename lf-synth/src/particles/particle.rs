//! A particle in one frame.

use glam::DVec3;

/// A particle in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle {
    /// Number of the particle, the same in every frame.
    pub id: u64,
    /// Place, mm.
    pub place_mm: DVec3,
    /// Counts that it sends through the aperture.
    pub intensity: f64,
    /// Size of its image, relative to the scene's.
    pub size: f64,
}

/// The particles inside the bounds: low bound included, high bound excluded.
pub fn inside(particles: &[Particle], bounds_mm: [[f64; 2]; 3]) -> Vec<Particle> {
    let is_inside = |place: DVec3| (0..3).all(|axis| (bounds_mm[axis][0]..bounds_mm[axis][1]).contains(&place[axis]));
    particles.iter().filter(|particle| is_inside(particle.place_mm)).copied().collect()
}
