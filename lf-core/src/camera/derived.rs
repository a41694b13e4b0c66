//! Derived from a camera's keys: lengths, effects that are modelled, whether the lattice follows the pixels.

use super::model::{Aperture, Camera, MainLens, Medium};
use crate::lattice::{Lattice, Layout};

/// Largest shift of a lenslet, px, by a rotation that still counts as none. Particle images are 0.6 px wide and more,
/// and the calibration on white images errs by some thousandths of a pixel.
pub const ALIGNED_PX: f64 = 0.02;

impl Camera {
    /// s_i = f (1 + m), mm.
    pub fn image_distance_mm(&self) -> f64 {
        self.main_lens.focal_length_mm * (1.0 + self.main_lens.magnification)
    }

    /// s_o = f (1 + 1/m), mm.
    pub fn object_distance_mm(&self) -> f64 {
        self.main_lens.focal_length_mm * (1.0 + 1.0 / self.main_lens.magnification)
    }

    /// L, mm: a place U of the stop stands for light that meets the middle of the array with the slope U / L. It is
    /// `pupil_distance_mm` if the camera has it, and s_i otherwise, wherever the exit pupil is.
    pub fn stop_distance_mm(&self) -> f64 {
        self.main_lens.pupil_distance_mm.unwrap_or_else(|| self.image_distance_mm())
    }

    /// L / l: 1 if the exit pupil stands at L, 0 if it is at infinity, negative if it is behind the array.
    pub fn pupil_ratio(&self) -> f64 {
        let MainLens { pupil_distance_mm, pupil_vergence_per_mm, telecentric, .. } = &self.main_lens;
        match pupil_vergence_per_mm {
            Some(vergence) => vergence * self.stop_distance_mm(),
            None if telecentric.is_some() && pupil_distance_mm.is_none() => 0.0,
            None => 1.0,
        }
    }

    /// l, the distance from the exit pupil to the array, mm; infinite or negative for a far pupil.
    pub fn pupil_distance_mm(&self) -> f64 {
        self.stop_distance_mm() / self.pupil_ratio()
    }

    /// D = L / N_w: diameter of a round stop, side of a square one, mm, as seen at the distance L.
    pub fn aperture_mm(&self) -> f64 {
        self.stop_distance_mm() / self.main_lens.working_f_number
    }

    /// Distance from the array to the sensor on the axis, mm.
    pub fn gap_mm(&self) -> f64 {
        self.microlenses.gap_mm.unwrap_or(self.microlenses.focal_length_mm)
    }

    /// k D: width of the stop's image under a lenslet, px; with an iris, that of the disc through its corners.
    pub fn stop_image_px(&self) -> f64 {
        self.demagnification() * self.aperture_mm() / self.sensor.pixel_pitch_mm
    }

    /// k = f_l / L: size of the aperture's image under a lenslet over the size of the aperture. A gap g replaces f_l.
    pub fn demagnification(&self) -> f64 {
        self.gap_mm() / self.stop_distance_mm()
    }

    /// f_l / l: lenslet images lie by this share farther apart than lenslets. A gap g replaces f_l.
    pub fn image_growth(&self) -> f64 {
        self.demagnification() * self.pupil_ratio()
    }

    /// Sine of the steepest ray before a telecentric lens, `m / (2 N_w)` over the index; 0 for a thin lens. Half the
    /// diagonal counts for a square stop.
    pub(super) fn steepest_sine(&self) -> f64 {
        let MainLens { magnification, working_f_number, aperture, telecentric, .. } = self.main_lens;
        let corner = if aperture == Aperture::Square { std::f64::consts::SQRT_2 } else { 1.0 };
        telecentric.map_or(0.0, |lens| 0.5 * corner * magnification / (working_f_number * lens.index))
    }

    /// Whether the sine condition of a telecentric lens moves rays by more than [`ALIGNED_PX`] within a lenslet image.
    pub fn has_steep_rays(&self) -> bool {
        let sine = self.steepest_sine();
        let radius_px = 0.5 * self.stop_image_px();
        (1.0 / (1.0 - sine * sine).max(0.0).sqrt() - 1.0) * radius_px > ALIGNED_PX
    }

    /// Whether a point's place on the array is not linear in the place in the stop: behind a medium, for the steep rays
    /// of a telecentric lens, and with aberrations.
    pub fn has_bent_rays(&self) -> bool {
        self.medium.is_some() || self.has_steep_rays() || self.aberrations.is_some()
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
        [self.sensor.width, self.sensor.height].map(|side| side as f64 * scale)
    }

    /// Side of a pixel seen at the focal plane, mm.
    pub fn pixel_in_focus_mm(&self) -> f64 {
        self.sensor.pixel_pitch_mm / self.main_lens.magnification
    }

    /// About the depth, in pixels at the focal plane, that the camera resolves: 5 N_w / m. Over N_w / m pixels of depth
    /// the rays through opposite sides of the stop part by one pixel. Particles that the paper's method reconstructs
    /// are 10 to 25 px long at N_w = 4 and 40 px at N_w = 8, both at m = 1.
    pub fn depth_resolution_px(&self) -> f64 {
        5.0 * self.main_lens.working_f_number / self.main_lens.magnification
    }

    /// Spacing of a grid of `pixels_per_voxel` at the focal plane, mm.
    pub fn voxel_spacing_mm(&self, pixels_per_voxel: [f64; 3]) -> [f64; 3] {
        pixels_per_voxel.map(|ratio| ratio * self.sensor.pixel_pitch_mm / self.main_lens.magnification)
    }

    /// The optional blocks and whether the camera has them. The first six bend rays or defocus the lenslets.
    fn optional_blocks(&self) -> [(&'static str, bool); 14] {
        [
            ("medium", self.medium.is_some()),
            ("main_lens.telecentric", self.has_steep_rays()),
            ("tilt", self.tilt.is_some()),
            ("microlenses.gap_mm", self.microlenses.gap_mm.is_some()),
            ("distortion", self.distortion.is_some()),
            ("aberrations", self.aberrations.is_some()),
            ("centres", self.centres.is_some()),
            ("blades", self.blades.is_some()),
            ("second_stop", self.second_stop.is_some()),
            ("vignetting", self.vignetting.is_some()),
            ("main_lens.pupil_distance_mm", self.main_lens.pupil_distance_mm.is_some()),
            ("main_lens.pupil_vergence_per_mm", self.main_lens.pupil_vergence_per_mm.is_some()),
            ("main_lens.telecentric", self.main_lens.telecentric.is_some() && !self.has_steep_rays()),
            ("blur", self.blur.is_some()),
        ]
    }

    /// Keys of the optional blocks that the camera has.
    pub fn blocks(&self) -> Vec<&'static str> {
        self.optional_blocks().into_iter().filter_map(|(name, given)| given.then_some(name)).collect()
    }

    /// The first block that bends rays or puts the sensor out of the lenslets' focus; None for a camera of thin lenses.
    pub fn bends(&self) -> Option<&'static str> {
        self.optional_blocks()[..6].iter().find_map(|(name, given)| given.then_some(*name))
    }

    /// The camera without the lattice's rotation; None if [`Camera::misalignment`] gives a reason.
    pub fn aligned(&self) -> Option<Self> {
        let mut aligned = self.clone();
        aligned.microlenses.rotation_rad = 0.0;
        self.misalignment().is_none().then_some(aligned)
    }

    /// Why lenslets do not follow the pixels: a hexagonal lattice, a turn beyond [`ALIGNED_PX`], or bent columns.
    pub fn misalignment(&self) -> Option<String> {
        if let Some(block) = self.bends().or(self.centres.is_some().then_some("centres")) {
            return Some(format!("the camera has '{block}'"));
        }
        if self.microlenses.layout != Layout::Square {
            return Some("the lattice is hexagonal".to_string());
        }
        let turn = self.microlenses.rotation_rad.abs();
        let drift_px = 0.5 * self.sensor.width.max(self.sensor.height) as f64 * turn;
        (drift_px > ALIGNED_PX).then(|| format!("the lattice is turned, by {drift_px:.2} px at the sensor's sides"))
    }

    /// The camera in a line for `-v`: its lattice, its stop, and which optional blocks are modelled.
    pub fn about(&self) -> String {
        let layout = if self.microlenses.layout == Layout::Square { "square" } else { "hexagonal" };
        let stop = if self.main_lens.aperture == Aperture::Circle { "round" } else { "square" };
        let blocks = match self.blocks().as_slice() {
            [] => "nothing beyond a thin lens is modelled".to_string(),
            blocks => format!("modelled beyond a thin lens: {}", blocks.join(", ")),
        };
        let pose = if self.pose.is_some() { "; it has a pose" } else { "" };
        format!("{layout} lattice of {:.2} px, {stop} stop; {blocks}{pose}", self.pitch_px())
    }
}

impl Medium {
    /// Thickness, mm, and index of the layers that a ray from Z passes before the air: medium, then window.
    #[inline]
    pub fn layers_from(&self, z_mm: f64) -> [(f64, f64); 2] {
        [(self.window_z_mm - z_mm, self.index), (self.window_thickness_mm, self.window_index)]
    }

    /// Distance from the window to the main lens, mm, for a lens that is focused on the object distance `s_o` in air.
    #[inline]
    pub fn air_mm(&self, object_distance_mm: f64) -> f64 {
        object_distance_mm - self.layers_from(0.0).iter().map(|(thickness, index)| thickness / index).sum::<f64>()
    }
}
