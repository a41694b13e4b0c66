//! In: the particles and their cameras. Out: the unknowns that all particles share: size and drift of one camera, light
//! and pose of a further one; and a camera's parameter that may be wrong.
//! First file to open: `shape_fit.rs`.

pub mod align;
pub mod cause;
pub mod evidence;
pub mod sample;
pub mod shape_fit;
