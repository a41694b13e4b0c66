//! The keys of `camera.json`.

use super::blades::Blades;
use super::pose::Pose;
use super::second_stop::SecondStop;
use crate::frame::Frame;
use crate::lattice::{Centres, Microlenses};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A plenoptic camera: a thin main lens, a microlens array, and a sensor about one microlens focal length behind it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// The frame of the object. A file may lack it: its keys are measured along the axis or along the sensor's axes, so
    /// none depends on where X points.
    #[serde(default)]
    pub frame: Frame,
    /// The pixels.
    pub sensor: Sensor,
    /// The main lens.
    pub main_lens: MainLens,
    /// The microlens array.
    pub microlenses: Microlenses,
    /// Distortion by the main lens; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Distortion>,
    /// Aberrations of the main lens; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aberrations: Option<Aberrations>,
    /// Tilt of the sensor against the array; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt: Option<Tilt>,
    /// The medium that the camera looks into; air if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub medium: Option<Medium>,
    /// Blur of the image on the sensor; sharp if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blur: Option<Blur>,
    /// Noise of a pixel; unknown if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_noise: Option<SensorNoise>,
    /// Measured departure of the lenslets from the perfect lattice; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centres: Option<Centres>,
    /// Blades of an iris, which leave a polygon of the round stop; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blades: Option<Blades>,
    /// A second stop that cuts into the lenslet images; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_stop: Option<SecondStop>,
    /// File of the flat-field image: the fraction of its light that each pixel counts; 1 everywhere if absent. Pixels
    /// below [`crate::image::BLIND`] are blind; a negative one has the light of its absolute value, which spreads. The
    /// path is relative to the folder of the camera's file. See [`crate::image::open_frame`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vignetting: Option<PathBuf>,
    /// Where the camera stands among others; absent, its own frame is the common one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// Results of calibrations for people: residuals and their units under `lattice`, `volume` and `refine`, and
    /// `history`. Only lf-calib reads it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<serde_json::Value>,
}

/// The pixels behind the array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Pixel columns.
    pub width: usize,
    /// Pixel rows.
    pub height: usize,
    /// Distance between pixels, mm.
    pub pixel_pitch_mm: f64,
}

/// A thin main lens focused on the plane Z = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MainLens {
    /// Focal length, mm.
    pub focal_length_mm: f64,
    /// Magnification |M| at the focal plane, without its sign.
    pub magnification: f64,
    /// Working f-number, the cone of light at the array: distance of the exit pupil over its diameter. For a thin lens,
    /// image distance over aperture diameter.
    pub working_f_number: f64,
    /// Shape of the stop.
    pub aperture: Aperture,
    /// Distance from the exit pupil to the array, mm; the image distance if absent, as in a thin lens. It sets from
    /// where light meets a lenslet; which planes are in focus is up to focal length and magnification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pupil_distance_mm: Option<f64>,
    /// 1 over the distance from the exit pupil to the array, 1/mm, in place of that distance: 0 for a pupil at
    /// infinity, negative for one behind the array.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pupil_vergence_per_mm: Option<f64>,
    /// A lens that is telecentric towards the object, like a microscope's; a thin lens if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub telecentric: Option<Telecentric>,
}

/// A lens whose chief rays run parallel to the axis before it, so that the picture of a point does not grow with its
/// depth. It keeps Abbe's sine condition. Its exit pupil is at infinity if the camera does not say where. No ray
/// depends on its focal length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Telecentric {
    /// Index of refraction of what the object is in, up to the front lens; 1 if absent.
    #[serde(default = "one")]
    pub index: f64,
}

/// Shape of the main lens's stop. Its diameter or side is [`Camera::aperture_mm`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Aperture {
    /// A disc.
    Circle,
    /// A square with sides along x and y.
    Square,
}

/// Distortion by the main lens after Brown (1966): radial terms, and tangential terms of a decentred element. The whole
/// image of a point moves as its chief ray does; [`crate::optics`] has the equation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distortion {
    /// k1, k2, k3: coefficients of r^2, r^4, r^6, where r is the tangent of the chief ray behind the lens.
    #[serde(default)]
    pub radial: [f64; 3],
    /// p1, p2, along the sensor's axes.
    #[serde(default)]
    pub tangential: [f64; 2],
}

/// Seidel's aberrations of the main lens but distortion, the next term of the spherical aberration, and how the coma
/// changes with depth: how far they move rays on the array, px of the sensor.
/// Positive terms move rays away from the chief ray, as a point nearer to the camera does; positive coma moves them
/// away from the axis. [`crate::optics`] has the equation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aberrations {
    /// For rays through the rim of the stop, anywhere in the field.
    #[serde(default)]
    pub spherical_px: f64,
    /// Secondary spherical aberration, for rays through the rim: it grows by the fifth power of the place in the stop.
    #[serde(default, skip_serializing_if = "crate::json::is_zero")]
    pub secondary_spherical_px: f64,
    /// At the corner of the sensor, of rays through the rim on the diameter across the field's direction. Those on the
    /// diameter along it move three times as far.
    #[serde(default)]
    pub coma_px: f64,
    /// Growth of the coma for a mm of depth. A lens without coma in focus has it before and behind.
    #[serde(default, skip_serializing_if = "crate::json::is_zero")]
    pub coma_px_per_mm: f64,
    /// At the corner, of rays through the rim on the diameter along the field's direction, beyond the field curvature.
    #[serde(default)]
    pub astigmatism_px: f64,
    /// At the corner, of rays through the rim on the diameter across the field's direction: that of the sagittal image.
    #[serde(default)]
    pub field_curvature_px: f64,
}

/// Tilt of the sensor against the array: the gap between them grows by tan(x_rad) along x and by tan(y_rad) along y,
/// the sensor's columns and rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tilt {
    /// Along x, rad.
    pub x_rad: f64,
    /// Along y, rad.
    pub y_rad: f64,
}

/// A medium behind a flat window normal to the optical axis; the camera stands in air. Z = 0 is the plane in the medium
/// that paraxial rays focus onto the array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Medium {
    /// Index of refraction of the medium, relative to air.
    pub index: f64,
    /// Z of the window's face towards the medium, mm.
    pub window_z_mm: f64,
    /// Thickness of the window, mm; 0 if absent, and the medium borders on air.
    #[serde(default)]
    pub window_thickness_mm: f64,
    /// Index of refraction of the window, relative to air; 1 if absent.
    #[serde(default = "one")]
    pub window_index: f64,
}

/// The wavelength of green light, nm, where none is named: every lenslet diffracts, and most light is green. Particles
/// are found as well for 450 to 700 nm.
pub const GREEN_NM: f64 = 550.0;

/// Blur on the sensor. It acts on the light before the pixels count it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blur {
    /// Standard deviation of a Gaussian, px: aberrations of the lenslets, their focus, crosstalk of the pixels.
    #[serde(default)]
    pub sigma_px: f64,
    /// Wavelength of the light, nm, which diffracts at the rim of each lenslet; absent, nothing diffracts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelength_nm: Option<f64>,
    /// The pattern that a particle's light makes in each lenslet. Absent, it is the far field, and `lf-fit` may find
    /// that Fresnel's explains its image better.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<LensletPattern>,
}

/// The pattern of a lenslet that diffracts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LensletPattern {
    /// Fresnel's, of light that converges behind the array, as that of a particle does.
    Fresnel,
    /// Fraunhofer's: the far field of the lenslet, which spreads its sharp image, as some simulators draw it.
    Fraunhofer,
}

/// Noise of a pixel: its variance is `gain_counts * counts of light + read_noise_counts^2`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorNoise {
    /// Counts of an electron.
    pub gain_counts: f64,
    /// Standard deviation of a pixel without light, counts.
    pub read_noise_counts: f64,
}

fn one() -> f64 {
    1.0
}
