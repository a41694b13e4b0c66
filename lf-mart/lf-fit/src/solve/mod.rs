//! In: a window and the images of some particles. Out: the places and lights that fit best, and their covariances.
//! First file to open: `joint.rs`.

pub mod covariance;
pub mod joint;
pub mod normal;
pub mod parts;
pub mod size;
pub mod untold;
