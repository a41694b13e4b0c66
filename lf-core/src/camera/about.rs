//! Properties of a camera in words: which effects it models, and whether its lattice is aligned with the pixels.

use super::model::{Aperture, Camera};
use crate::lattice::Layout;

/// Largest shift of a lenslet, px, by a rotation that still counts as none. Particle images are 0.6 px wide and more,
/// and the calibration on white images errs by some thousandths of a pixel.
pub const ALIGNED_PX: f64 = 0.02;

impl Camera {
    /// The optional blocks in the order of their modelling, and whether the camera has them. The first four bend rays
    /// or defocus the lenslets.
    fn optional_blocks(&self) -> [(&'static str, bool); 6] {
        [
            ("medium", self.medium.is_some()),
            ("tilt", self.tilt.is_some()),
            ("microlenses.gap_mm", self.microlenses.gap_mm.is_some()),
            ("distortion", self.distortion.is_some()),
            ("centres", self.centres.is_some()),
            ("vignetting", self.vignetting.is_some()),
        ]
    }

    /// Keys of the optional blocks that the camera has. Each effect is modelled only if its block is given.
    pub fn blocks(&self) -> Vec<&'static str> {
        self.optional_blocks().into_iter().filter_map(|(name, given)| given.then_some(name)).collect()
    }

    /// The first block that bends rays or puts the sensor out of the lenslets' focus; None for a camera of thin lenses.
    pub fn bends(&self) -> Option<&'static str> {
        self.optional_blocks()[..4].iter().find_map(|(name, given)| given.then_some(*name))
    }

    /// The camera with its lattice exactly aligned with the pixels: the rotation is set to 0. None if
    /// [`Camera::misalignment`] gives a reason.
    pub fn aligned(&self) -> Option<Self> {
        if self.misalignment().is_some() {
            return None;
        }
        let mut aligned = self.clone();
        aligned.microlenses.rotation_rad = 0.0;
        Some(aligned)
    }

    /// Why rows and columns of lenslets do not follow the pixels, in words. None if the lattice is square, moves no
    /// lenslet by more than [`ALIGNED_PX`] by its rotation, and nothing bends its columns.
    pub fn misalignment(&self) -> Option<String> {
        if let Some(block) = self.bends().or(self.centres.is_some().then_some("centres")) {
            return Some(format!("the camera has '{block}'"));
        }
        if self.microlenses.layout != Layout::Square {
            return Some("the lattice is hexagonal".to_string());
        }
        let turn = self.microlenses.rotation_rad.abs();
        let drift_px = 0.5 * self.sensor.width.max(self.sensor.height) as f64 * turn;
        let reason = || format!("the lattice is turned, by {drift_px:.2} px at the sensor's sides");
        (drift_px > ALIGNED_PX).then(reason)
    }

    /// The camera in a line for `-v`: its lattice, its stop, and which optional blocks are modelled.
    pub fn about(&self) -> String {
        let layout = match self.microlenses.layout {
            Layout::Square => "square",
            Layout::Hexagonal => "hexagonal",
        };
        let stop = match self.main_lens.aperture {
            Aperture::Circle => "round",
            Aperture::Square => "square",
        };
        let blocks = match self.blocks().as_slice() {
            [] => "nothing beyond a thin lens is modelled".to_string(),
            blocks => format!("modelled beyond a thin lens: {}", blocks.join(", ")),
        };
        format!("{layout} lattice of {:.2} px, {stop} stop; {blocks}", self.pitch_px())
    }
}
