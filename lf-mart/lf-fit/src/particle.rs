//! A particle of the fit.

/// A particle: its place, light and size.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Particle {
    /// Centre, mm.
    pub place_mm: [f64; 3],
    /// Light that it sends through the stop, counts.
    pub light: f64,
    /// Logarithm of its size over that of the model: 0 where the image shows no difference.
    pub log_size: f64,
}

impl Particle {
    /// A particle of the model's size.
    pub fn new(place_mm: [f64; 3], light: f64) -> Self {
        Self { place_mm, light, log_size: 0.0 }
    }
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
    /// Multiplies the variances of x, y and z, and that of the light.
    pub(crate) fn widen(&mut self, places: [f64; 3], light: f64) {
        let [x, y, z] = places.map(f64::sqrt);
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        self.covariance_mm2.iter_mut().zip(products).for_each(|(value, factor)| *value *= factor);
        self.light_std *= light.sqrt();
    }
}
