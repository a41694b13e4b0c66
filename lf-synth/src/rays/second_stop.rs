//! A second stop, which cuts the beam off the axis (cat's-eye vignetting).

use crate::key_checks::{positive, wrong};
use glam::DVec2;
use lf_core::{Camera, Optics, Refusal};
use serde::{Deserialize, Serialize};

/// A round stop on the axis before or behind the main lens, like the rim of a lens barrel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondStop {
    /// Distance from the main lens, mm: positive towards the particles, negative towards the sensor.
    pub distance_mm: f64,
    /// Diameter, mm.
    pub diameter_mm: f64,
}

impl SecondStop {
    pub(crate) fn check(&self, camera: &Camera) -> Result<(), Refusal> {
        let Self { distance_mm, diameter_mm } = *self;
        positive("second_stop.diameter_mm", diameter_mm)?;
        if camera.main_lens.telecentric.is_some() {
            return Err(wrong("second_stop stands by the main lens, and a telecentric lens has no place"));
        }
        let object_mm = camera.object_distance_mm();
        let air_mm = camera.medium.as_ref().map_or(object_mm, |medium| medium.air_mm(object_mm));
        let low_mm = -camera.image_distance_mm();
        if distance_mm > low_mm && distance_mm < air_mm {
            return Ok(());
        }
        Err(wrong(format!(
            "second_stop.distance_mm is {distance_mm}, outside the air between {low_mm:.1} and {air_mm:.1}"
        )))
    }

    /// Whether a ray between `array_mm` on the array and `aperture_mm` in the aperture comes through.
    #[inline(always)]
    pub(super) fn passes(&self, optics: &Optics, array_mm: DVec2, aperture_mm: DVec2) -> bool {
        let way = if self.distance_mm >= 0.0 {
            -self.distance_mm * optics.slope_from_array(array_mm, aperture_mm)
        } else {
            self.distance_mm / optics.stop_distance_mm * (aperture_mm - optics.pupil_ratio * array_mm)
        };
        4.0 * (optics.lens_mm(array_mm, aperture_mm) + way).length_squared() <= self.diameter_mm * self.diameter_mm
    }
}
