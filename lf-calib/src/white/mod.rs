//! In: white images and a nominal camera. Out: the lattice of lenslet images, a camera with those microlenses, a flat
//! field. The pitch: `period.rs` estimates it, `perfect_lattice.rs` fits it, `calibrate.rs` gives that of the
//! microlenses. Open first: `find.rs`, the steps in their order; then `calibrate.rs`.

mod autocorrelation;
mod basis;
mod calibrate;
mod cats_eye;
mod cell_equations;
mod cell_fit;
mod cell_samples;
mod departure;
mod fill;
mod find;
mod flat_field;
mod follow;
mod followed;
mod image_lattice;
mod lenslet_fit;
mod mean_cell;
mod perfect_lattice;
mod period;
mod profile;
mod pupil;
mod rim;
mod rims;
mod stop_image;
mod stop_series;
mod stop_width;
mod symmetry;
mod white_cell;

pub use calibrate::{Calibrated, Keep, Residual, calibrate};
pub use fill::Fill;
pub use find::find_lattice;
pub use flat_field::flat_field;
pub use follow::LATTICE_STEPS;
pub use image_lattice::{Centre, ImageLattice, StopWidth};
pub use pupil::{PitchChange, Pupil};
pub use rims::{Iris, RimBlur, Rims, rims};
