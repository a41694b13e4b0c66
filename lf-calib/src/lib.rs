//! White images and particle frames to a camera that can be trusted.
//!
//! [`White`] averages white images, [`lattice::find`] finds the lattice of the lenslet *images* in the mean, and
//! [`calibrate()`] turns it into the microlenses of a camera. [`Background`] is what stays in every frame.
//!
//! Image places are pixels from the left and top edge: a pixel's centre is at a half.

mod background;
mod calibrate;
mod cats_eye;
mod cell;
mod departure;
mod fit;
mod flat;
pub mod lattice;
mod period;
mod places;
pub mod plot;
mod radial;
mod reading;
mod refusal;
mod rim;
mod symmetry;
mod trail;
mod white;

pub use background::Background;
pub use calibrate::{Calibrated, Fill, Residual, calibrate};
pub use flat::flat_field;
pub use lattice::{Centre, ImageLattice, SecondStop};
pub use refusal::Refusal;
pub use white::White;
