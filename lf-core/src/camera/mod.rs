//! The camera, its file `camera.json`, and the lengths that follow from it.
//!
//! In: the text of a `camera.json`. Out: a checked [`Camera`] and its derived lengths.
//! Open first: `model.rs`, the keys of the file. `file.rs` and `plausible.rs` say which values are refused.
//!
//! A `camera.json` is one JSON object. Its keys are the fields of [`Camera`], and its blocks those of the structs named
//! there; an unknown key is refused. `sensor`, `main_lens` and `microlenses` are required. The other blocks are
//! optional: an effect is modelled only if its block is given, and costs nothing otherwise. Lengths are mm, angles rad;
//! the frame and its signs are in [`crate::optics`]. Directions in a camera (the lattice's turn and offset, tilt,
//! distortion, centres) are along the sensor's axes: x along the columns, y along the rows, downwards.
//!
//! `blur` is light that a sharp camera would put elsewhere: [`Blur`]. lf-synth renders it, and the images of particles
//! have it; the weights of voxels do not. `second_stop` is a rim that cuts into the beam beside the axis, as lf-calib
//! finds it in white images: [`SecondStop`]. `blades` are those of an iris: [`Blades`]. Pixels that they reach count as
//! blind.
//!
//! `frame` is `right-handed` in every file that the tools write. A camera without it is read too, so that a data sheet
//! may be typed in without it and cameras of lf 0.1.0 keep their worth: no key depends on where X points.
//!
//! `pose` says where a camera stands among others: [`Pose`]. Every tool works in the frame of its own camera, whatever
//! the pose. Only lf-fit with several cameras reads it, and lf-synth, which puts a posed camera into its scene.
//!
//! | symbol | key | derived here |
//! | --- | --- | --- |
//! | `pp` | `sensor.pixel_pitch_mm` | |
//! | `p` | `microlenses.pitch_mm` | |
//! | `f_l` | `microlenses.focal_length_mm` | |
//! | `f`, `m` | `main_lens.focal_length_mm`, `main_lens.magnification` | |
//! | `s_i`, `s_o` | | [`Camera::image_distance_mm`], [`Camera::object_distance_mm`] |
//! | `1 / l` | `main_lens.pupil_vergence_per_mm`, or 1 over `main_lens.pupil_distance_mm`; 1 / s_i if absent | |
//! | `L` | | [`Camera::stop_distance_mm`] |
//! | `N_w`, `D` | `main_lens.working_f_number` | [`Camera::aperture_mm`] |
//! | `g` | `microlenses.gap_mm`; f_l if absent | [`Camera::gap_mm`] |
//! | `k` | | [`Camera::demagnification`] |
//! | `g / l` | | [`Camera::image_growth`] |
//!
//! ```
//! # fn main() -> Result<(), lf_core::Refusal> {
//! let camera = lf_core::camera::Camera::from_json(r#"{
//!     "sensor": {"width": 1400, "height": 1400, "pixel_pitch_mm": 0.0055},
//!     "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": "circle"},
//!     "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308, "rotation_rad": 0.0,
//!                     "offset_mm": [0.0, 0.0]}
//! }"#)?;
//! assert_eq!(camera.image_distance_mm(), 400.0);
//! assert_eq!(camera.aperture_mm(), 100.0);
//! # Ok(())
//! # }
//! ```

mod aberrations;
mod blades;
mod blur;
mod cut_pixels;
mod depths;
mod derived;
mod evidence;
mod file;
mod model;
mod plausible;
mod pose;
mod second_stop;

pub use crate::lattice::{Layout, Microlenses};
pub(crate) use aberrations::RayAberrations;
pub use blades::Blades;
pub use blur::{Diffraction, STANDS_FOR};
pub use derived::ALIGNED_PX;
pub use evidence::{COUNT, Correction, EXPLAINED, Evidence, PARAMETERS, Parameter, stepped};
pub use model::{
    Aberrations, Aperture, Blur, Camera, Distortion, GREEN_NM, LensletPattern, MainLens, Medium, Sensor, SensorNoise,
    Telecentric, Tilt,
};
pub use pose::Pose;
pub use second_stop::{Disc, SecondStop};

#[cfg(test)]
pub(crate) mod tests;
