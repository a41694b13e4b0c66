//! The image sorted into views, and sums over the rays of many voxels at once.
//!
//! A lenslet shows each section of the aperture at one place. So the image is sorted once into views: what a section
//! sees through each lenslet ([`ViewRays`]). A sum over a voxel's rays is one over sections, each through the lenslet
//! that the ray meets. Counted from the voxel's own lenslet, this one depends only on the voxel's place in its
//! lenslet's cell. Over a raster of such places, [`Walks`] list the few sections that change lenslets from one place to
//! the next, and [`add_up`] sums many lenslets at once; [`spread`] takes light of voxels back to the views. [`Slices`]
//! find each voxel's place on the raster.
//!
//! First file to open: `runs.rs`.

mod cells;
mod chiefs;
mod plan;
mod rays;
mod runs;
mod sections;
mod sums;
mod walk;
mod walks;

pub use cells::Cells;
pub use chiefs::LatticeRays;
pub use plan::{LANES, LEAST, ViewsPlan};
pub use rays::ViewRays;
pub use runs::{Region, Slices, VoxelRun};
pub use sections::Sections;
pub use sums::{Addend, add_up, spread};
pub use walk::{Raster, Walk};
pub use walks::Walks;
