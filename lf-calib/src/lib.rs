//! White images and particle frames to a camera that can be trusted.
//!
//! [`White`] averages white images, [`lattice::find`] finds the lattice of the lenslet *images* in the mean, and
//! [`calibrate()`] turns it into the microlenses of a camera. [`Background`] is what stays in every frame. [`volume()`] finds
//! the main lens from images of a dot target. [`refine()`] mends what has drifted since, from frames of particles.
//!
//! Image places are pixels from the left and top edge: a pixel's centre is at a half.

mod adjust;
mod background;
mod bundle;
mod calibrate;
mod cats_eye;
mod cell;
mod departure;
mod evidence;
mod fan;
mod fit;
mod flat;
mod isolated;
pub mod lattice;
mod lens_centres;
pub mod parameters;
mod period;
mod places;
pub mod plot;
mod radial;
mod reading;
mod recognise;
mod refine;
mod refocus;
mod refusal;
mod rim;
mod sight;
mod spot;
mod stop;
mod symmetry;
mod target;
mod trail;
mod volume;
mod white;

pub use background::Background;
pub use calibrate::{Calibrated, Fill, Residual, calibrate};
pub use flat::flat_field;
pub use lattice::{Centre, ImageLattice, SecondStop};
pub use refine::{Refined, refine, refine_watched, steps};
pub use refusal::Refusal;
pub use target::{Dot, Exposure, grid};
pub use volume::{Volume, looks, volume, volume_watched};
pub use white::White;
