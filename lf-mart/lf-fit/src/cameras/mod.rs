//! In: the cameras with their images. Out: a list of cameras, each with its model, noise, pose and light, and the
//! particles that they share.
//! First file to open: `view.rs`.

pub mod defects;
pub mod input;
pub mod lens;
pub mod matching;
pub mod noise;
pub mod residual;
pub mod shape;
pub mod view;
