//! Which values of a `camera.json` are refused.

use super::model::{Camera, Distortion, Medium, Tilt};
use crate::Refusal;

/// Largest width or height of a sensor, px.
const MOST_PIXELS: usize = 1 << 20;

/// Largest tilt of the sensor, rad.
const MOST_TILT_RAD: f64 = 0.5;

/// Largest k = f_l / s_i: the thin-lens equations hold for microlenses that are short beside the image distance.
const MOST_DEMAGNIFICATION: f64 = 0.5;

fn positive(key: &str, value: f64) -> Result<(), Refusal> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Refusal::new(format!("{key} is {value}"), "wanted a positive number"))
}

fn finite(key: &str, values: &[f64]) -> Result<(), Refusal> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(Refusal::new(format!("{key} has the number {value}"), "wanted finite numbers")),
        None => Ok(()),
    }
}

impl Camera {
    /// Checks that every number can be used. Refuses lengths that are not positive, numbers that are not finite, more
    /// than 2^20 px a side, lenslets smaller than a pixel, a tilt that brings the sensor to the array, a medium that
    /// leaves no air before the lens, and microlenses as long as half the image distance.
    pub fn check(&self) -> Result<(), Refusal> {
        positive("sensor.pixel_pitch_mm", self.sensor.pixel_pitch_mm)?;
        positive("main_lens.focal_length_mm", self.main_lens.focal_length_mm)?;
        positive("main_lens.magnification", self.main_lens.magnification)?;
        positive("main_lens.working_f_number", self.main_lens.working_f_number)?;
        let (width, height) = (self.sensor.width, self.sensor.height);
        if ![width, height].iter().all(|side| (1..=MOST_PIXELS).contains(side)) {
            let found = format!("sensor is {width} x {height} px");
            return Err(Refusal::new(found, format!("wanted 1 to {MOST_PIXELS} px a side")));
        }
        self.check_microlenses()?;
        if let Some(Distortion { radial, tangential }) = &self.distortion {
            finite("distortion.radial", radial)?;
            finite("distortion.tangential", tangential)?;
        }
        if let Some(tilt) = &self.tilt {
            self.check_tilt(tilt)?;
        }
        if let Some(medium) = &self.medium {
            medium.check(self.object_distance_mm())?;
        }
        if let Some(centres) = &self.centres {
            centres.check()?;
        }
        if self.demagnification() >= MOST_DEMAGNIFICATION {
            let found = format!("microlens focal length {} mm", self.microlenses.focal_length_mm);
            let wanted = format!("wanted less than half the image distance of {} mm", self.image_distance_mm());
            return Err(Refusal::new(found, wanted));
        }
        Ok(())
    }

    fn check_microlenses(&self) -> Result<(), Refusal> {
        let lenslets = &self.microlenses;
        positive("microlenses.pitch_mm", lenslets.pitch_mm)?;
        positive("microlenses.focal_length_mm", lenslets.focal_length_mm)?;
        if lenslets.pitch_mm < self.sensor.pixel_pitch_mm {
            let wanted = format!("wanted at least a pixel ({} mm)", self.sensor.pixel_pitch_mm);
            return Err(Refusal::new(format!("microlenses.pitch_mm is {}", lenslets.pitch_mm), wanted));
        }
        finite("microlenses.rotation_rad", &[lenslets.rotation_rad])?;
        finite("microlenses.offset_mm", &lenslets.offset_mm)?;
        lenslets.gap_mm.map_or(Ok(()), |gap_mm| positive("microlenses.gap_mm", gap_mm))
    }

    fn check_tilt(&self, Tilt { x_rad, y_rad }: &Tilt) -> Result<(), Refusal> {
        if !(x_rad.abs() < MOST_TILT_RAD && y_rad.abs() < MOST_TILT_RAD) {
            let found = format!("tilt is ({x_rad}, {y_rad}) rad");
            return Err(Refusal::new(found, format!("wanted less than {MOST_TILT_RAD} rad each way")));
        }
        let [half_width, half_height] =
            [self.sensor.width, self.sensor.height].map(|pixels| 0.5 * pixels as f64 * self.sensor.pixel_pitch_mm);
        let (nearer, gap) = (x_rad.abs().tan() * half_width + y_rad.abs().tan() * half_height, self.gap_mm());
        if nearer >= gap {
            let found = format!("tilt brings the sensor {nearer:.3} mm nearer to the array");
            return Err(Refusal::new(found, format!("wanted less than the gap of {gap:.3} mm")));
        }
        Ok(())
    }
}

impl Medium {
    fn check(&self, object_distance_mm: f64) -> Result<(), Refusal> {
        for (key, index) in [("index", self.index), ("window_index", self.window_index)] {
            if !(1.0..=4.0).contains(&index) {
                return Err(Refusal::new(format!("medium.{key} is {index}"), "wanted 1 to 4"));
            }
        }
        let thickness = self.window_thickness_mm;
        if !(thickness.is_finite() && thickness >= 0.0) {
            return Err(Refusal::new(format!("medium.window_thickness_mm is {thickness}"), "wanted 0 or more"));
        }
        let air = self.air_mm(object_distance_mm);
        if !air.is_finite() || air <= 0.0 {
            let found = format!("medium.window_z_mm is {}", self.window_z_mm);
            return Err(Refusal::new(found, "wanted air between the window and the main lens"));
        }
        Ok(())
    }
}
