//! Results in the forms of other programs.
//!
//! In: a volume, or a table of particles. Out: the bytes of a file. Open first: `cutout.rs`, which gives a part of a
//! volume slice by slice, so that no format holds a whole volume in memory; each format has a file of its name.

mod csv;
mod cutout;
mod polydata;
mod tiff;
mod vti;

pub use csv::write_csv;
pub use cutout::Cutout;
pub use polydata::write_polydata;
pub use tiff::{Samples, write_tiff};
pub use vti::write_vti;
