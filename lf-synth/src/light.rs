//! What lights the particles, and what cuts their light.

use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::optics::Optics;
use serde::{Deserialize, Serialize};

/// A laser sheet across z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// How its brightness falls.
    pub profile: Profile,
    /// Z of its middle, mm.
    #[serde(default)]
    pub centre_mm: f64,
    /// Thickness, mm: of a Gaussian sheet between the places where it has fallen to exp(-2).
    pub thickness_mm: f64,
}

/// How a sheet's brightness falls from its middle, where it is 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// Even within the thickness, dark beside it.
    TopHat,
    /// Gaussian.
    Gaussian,
}

impl Sheet {
    /// # Errors
    /// Names the key.
    pub fn check(&self) -> Result<(), String> {
        if !(self.thickness_mm.is_finite() && self.thickness_mm > 0.0) {
            return Err(format!("light.thickness_mm is {}, not a positive length", self.thickness_mm));
        }
        if self.centre_mm.is_finite() { Ok(()) } else { Err(format!("light.centre_mm is {}", self.centre_mm)) }
    }

    /// Brightness at a depth, 1 in the middle.
    pub fn brightness(&self, z_mm: f64) -> f64 {
        let part = 2.0 * (z_mm - self.centre_mm) / self.thickness_mm;
        match self.profile {
            Profile::TopHat => f64::from(u8::from(part.abs() <= 1.0)),
            Profile::Gaussian => (-2.0 * part * part).exp(),
        }
    }
}

/// A round stop on the axis beside the aperture, as the rim of a lens barrel is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondStop {
    /// Distance before the aperture, towards the particles; negative behind it, towards the sensor; mm.
    pub distance_mm: f64,
    /// Diameter, mm.
    pub diameter_mm: f64,
}

impl SecondStop {
    /// # Errors
    /// Names the key.
    pub fn check(&self, camera: &Camera) -> Result<(), String> {
        if !(self.diameter_mm.is_finite() && self.diameter_mm > 0.0) {
            return Err(format!("second_stop.diameter_mm is {}, not a positive length", self.diameter_mm));
        }
        let air = camera.medium.as_ref().map_or(camera.object_distance_mm(), |m| m.air_mm(camera.object_distance_mm()));
        let behind = camera.image_distance_mm();
        if self.distance_mm > -behind && self.distance_mm < air {
            return Ok(());
        }
        let found = self.distance_mm;
        Err(format!("second_stop.distance_mm is {found}, outside the air between {:.1} and {air:.1}", -behind))
    }

    /// Whether a ray that meets the array at `array_mm` from the aperture at `aperture_mm` comes through.
    #[inline(always)]
    pub fn passes(&self, optics: &Optics, array_mm: DVec2, aperture_mm: DVec2) -> bool {
        let way = if self.distance_mm >= 0.0 {
            -self.distance_mm * optics.slope_from_array(array_mm, aperture_mm)
        } else {
            self.distance_mm / optics.image_distance_mm() * (aperture_mm - array_mm)
        };
        4.0 * (aperture_mm + way).length_squared() <= self.diameter_mm * self.diameter_mm
    }
}
