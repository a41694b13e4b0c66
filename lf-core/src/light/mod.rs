//! Figures that the light of a frame gives about itself and its camera, for thresholds and for warnings.
//!
//! In: the pixels of a frame as [`crate::image::open_frame`] reads them, and its camera. Out: how bright light and
//! darkness are ([`Tones`]), how much light comes through each part of the stop ([`StopLight`]), how many particles
//! draw it at least ([`fewest_particles`]), and whether it lies under the camera's lenslets ([`LatticeLight`]). Open
//! first: `tones.rs`.

mod lattice_light;
mod spots;
mod stop_light;
mod tones;
mod usual;

pub use lattice_light::{Follows, LatticeLight};
pub use spots::fewest_particles;
pub use stop_light::StopLight;
pub use tones::Tones;
pub use usual::usual_light;
