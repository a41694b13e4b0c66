//! Lengths that follow from a camera's keys.

use super::model::{Camera, Medium};
use crate::lattice::Lattice;

impl Camera {
    /// s_i = f (1 + m), mm.
    pub fn image_distance_mm(&self) -> f64 {
        self.main_lens.focal_length_mm * (1.0 + self.main_lens.magnification)
    }

    /// s_o = f (1 + 1/m), mm.
    pub fn object_distance_mm(&self) -> f64 {
        self.main_lens.focal_length_mm * (1.0 + 1.0 / self.main_lens.magnification)
    }

    /// D = s_i / N_w: diameter of a round stop, side of a square one, mm.
    pub fn aperture_mm(&self) -> f64 {
        self.image_distance_mm() / self.main_lens.working_f_number
    }

    /// Distance from the array to the sensor on the axis, mm.
    pub fn gap_mm(&self) -> f64 {
        self.microlenses.gap_mm.unwrap_or(self.microlenses.focal_length_mm)
    }

    /// k = f_l / s_i: size of the aperture's image under a lenslet over the size of the aperture. A gap g replaces f_l.
    pub fn demagnification(&self) -> f64 {
        self.gap_mm() / self.image_distance_mm()
    }

    /// Lenslet pitch in pixels.
    pub fn pitch_px(&self) -> f64 {
        self.microlenses.pitch_mm / self.sensor.pixel_pitch_mm
    }

    /// The microlens lattice.
    pub fn lattice(&self) -> Lattice {
        Lattice::new(&self.microlenses, self.centres.as_ref())
    }

    /// Half width and half height of the focal plane that the sensor sees, mm.
    pub fn half_view_mm(&self) -> [f64; 2] {
        let scale = 0.5 * self.sensor.pixel_pitch_mm / self.main_lens.magnification;
        [self.sensor.width as f64 * scale, self.sensor.height as f64 * scale]
    }

    /// Side of a pixel seen at the focal plane, mm.
    pub fn pixel_in_focus_mm(&self) -> f64 {
        self.sensor.pixel_pitch_mm / self.main_lens.magnification
    }

    /// Spacing of a grid of `pixels_per_voxel` at the focal plane, mm.
    pub fn voxel_spacing_mm(&self, pixels_per_voxel: [f64; 3]) -> [f64; 3] {
        pixels_per_voxel.map(|ratio| ratio * self.sensor.pixel_pitch_mm / self.main_lens.magnification)
    }
}

impl Medium {
    /// Thickness, mm, and index of the layers that a ray from Z passes before the air: medium, then window.
    pub fn layers_from(&self, z_mm: f64) -> [(f64, f64); 2] {
        [(self.window_z_mm - z_mm, self.index), (self.window_thickness_mm, self.window_index)]
    }

    /// Distance from the window to the main lens, mm, for a lens that is focused on the object distance `s_o` in air.
    pub fn air_mm(&self, object_distance_mm: f64) -> f64 {
        object_distance_mm - self.layers_from(0.0).iter().map(|(thickness, index)| thickness / index).sum::<f64>()
    }
}
