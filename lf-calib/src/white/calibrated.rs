//! The result of [`crate::calibrate()`]: a camera, and how well its lenslets match the white image.

use lf_core::Camera;

/// A camera, and how well its lenslets match the white image.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// The nominal camera with its lattice replaced. `calibration.lattice` holds what was measured.
    pub camera: Camera,
    /// One for each of the lattice's centres.
    pub residuals: Vec<Residual>,
    /// Degree of the departure from the perfect lattice, 0 if there is none.
    pub degree: usize,
    /// Largest departure at the frame's corners, px.
    pub departure_px: f64,
    /// Root mean square distance of the kept centres from the camera's, px.
    pub residual_rms_px: f64,
    /// Width of the lenslet images. None if they have no rim.
    pub fill: Option<Fill>,
    /// Whether lenslet images overlap so much that a lattice half a pitch aside would fit as well. The nominal offset
    /// has then decided between the two.
    pub is_ambiguous: bool,
}

/// Diameter (round stop) or side (square stop) of lenslet images, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fill {
    /// Measured at half of the light.
    pub measured_px: f64,
    /// By the nominal f-number: k D.
    pub nominal_px: f64,
    /// Distance between lenslet images that they may fill: the pitch, for a square stop the distance between rows.
    pub pitch_px: f64,
}

/// One measured lenslet image, compared with the camera's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Column and row of the lenslet, as [`lf_core::lattice::Lattice`] counts them.
    pub lenslet: (i64, i64),
    /// Centre of its image, px from the image's left and top edge (a pixel's centre is at a half).
    pub place_px: [f64; 2],
    /// Measured minus the camera's, px.
    pub residual_px: [f64; 2],
    /// The camera's minus the perfect lattice's, px of the lenslet image.
    pub departure_px: [f64; 2],
    /// Whether the camera was fitted to it.
    pub kept: bool,
}
