//! The laser sheet that lights the particles.

use serde::{Deserialize, Serialize};

/// A laser sheet across z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// How its brightness falls.
    pub profile: SheetProfile,
    /// Z of its middle, mm.
    #[serde(default)]
    pub centre_mm: f64,
    /// Thickness, mm. A Gaussian sheet ends where its brightness has fallen to exp(-2).
    pub thickness_mm: f64,
}

/// How a sheet's brightness falls from its middle, where it is 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SheetProfile {
    /// Even within the thickness, dark outside.
    TopHat,
    Gaussian,
}

impl Sheet {
    /// Brightness at a depth; 1 in the middle.
    pub fn brightness(&self, z_mm: f64) -> f64 {
        let from_middle = 2.0 * (z_mm - self.centre_mm) / self.thickness_mm;
        match self.profile {
            SheetProfile::TopHat => f64::from(u8::from(from_middle.abs() <= 1.0)),
            SheetProfile::Gaussian => (-2.0 * from_middle * from_middle).exp(),
        }
    }
}
