//! A particle of the fit.

/// A particle: its place and light. All particles have the size of the model.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Particle {
    /// Centre, mm.
    pub place_mm: [f64; 3],
    /// Light that it sends through the stop, counts.
    pub light: f64,
}

/// A particle with its uncertainties, as the fit gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundParticle {
    /// Place and light.
    pub particle: Particle,
    /// Covariance of the place: xx, xy, xz, yy, yz, zz, mm^2.
    pub covariance_mm2: [f64; 6],
    /// Standard uncertainty of the light, counts.
    pub light_std: f64,
}

impl FoundParticle {
    /// Multiplies all variances.
    pub(crate) fn widen(&mut self, factor: f64) {
        self.covariance_mm2.iter_mut().for_each(|value| *value *= factor);
        self.light_std *= factor.sqrt();
    }
}
