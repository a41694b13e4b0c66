//! White images, dot targets and particle frames to a camera that can be trusted.
//!
//! 1. [`DataSheet`] gives a camera that has seen nothing yet, and [`advice()`] what it lets one measure.
//! 2. [`MeanImage`] averages white images, [`find_lattice`] finds the lattice of the lenslet *images* in the mean.
//! 3. [`calibrate()`] turns that lattice into the microlenses of a camera, and [`flat_field`] gives the camera's flat
//!    field.
//! 4. [`main_lens()`] finds the main lens, its distortion and the misalignment from images of a dot target.
//! 5. [`refine()`] corrects what the particles of frames show to be wrong.
//! 6. [`Background`] is what stays the same in every frame, [`Correction`] what is done to each.
//!
//! Image positions are pixels from the left and top edge; a pixel's centre is at a half.

mod background;
mod fit;
mod frames;
mod mean;
mod nominal;
mod photon_transfer;
pub mod plot;
mod points;
#[cfg(test)]
mod random;
mod refine;
mod target;
mod white;

pub use background::{Background, Haze, SlidingMinimum, haze};
pub use frames::{Change, Correction, Factor, HotPixels, Lasers, Sensitivity};
pub use mean::{MeanImage, check_saturation};
pub use nominal::{Advice, DataSheet, LightSheet, Liquid, advice, in_air, light_sheet, sheet_warnings};
pub use photon_transfer::{PhotonTransfer, photon_transfer};
pub use refine::{Refined, refine};
pub use target::{
    Dot, Exposure, MainLensFit, closer_dots_mm, depths_of_names, depths_of_table, fit_warnings, grid, main_lens,
    main_lens_steps, setup_mistake,
};
pub use white::{
    Calibrated, Centre, Fill, ImageLattice, Iris, Keep, LATTICE_STEPS, PitchChange, Pupil, Residual, RimBlur, Rims,
    StopWidth, calibrate, find_lattice, flat_field, rims,
};
