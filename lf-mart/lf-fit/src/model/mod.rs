//! In: a list of cameras and a particle. Out: the particle's image with its derivatives, in a window of the sensors.
//! First file to open: `particle_image.rs`.

pub mod buffers;
pub mod entries;
pub mod particle_image;
pub mod window;
