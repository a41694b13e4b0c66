//! In: the image, a camera, and the voxels of a slice. Out: the voxels kept, each with its score.
//!
//! A lenslet shows each section of the aperture at one place. So the image is sorted once into views: the shade that a
//! section sees through each lenslet ([`views`]). A voxel's score is a sum over sections, each through the lenslet that
//! the voxel's ray meets. Counted from the voxel's own lenslet, this one depends only on the voxel's place in its
//! lenslet's cell. Over a raster of such places, [`walk`] lists the few sections that change lenslets from one place to
//! the next, and [`sums`] adds up many lenslets at once. [`chiefs`] finds each voxel's place on the raster.
//!
//! First file to open: `scorer.rs`, which runs these steps. `oracle.rs` checks them, ray by ray.

mod cells;
mod chiefs;
#[cfg(test)]
mod oracle;
mod scorer;
mod sections;
mod shades;
mod sums;
mod views;
mod walk;
mod walks;

#[cfg(test)]
pub(crate) use oracle::{Oracle, Tolerance};
pub(crate) use scorer::{Scorer, thread_bytes};
pub(crate) use sections::Sections;
pub(crate) use shades::Shades;
pub(crate) use views::ViewsPlan;
