//! In: voxels, and an image or strengths. Out: the image of the strengths, or what each voxel sees of the image; exact
//! weights of any camera, made where they are used and never stored.
//! First file to open: `engine.rs`; `walk.rs` finds the lenslets of a voxel, `patches.rs` is the table of their light.
//!
//! The sensor is near the lenslets' focus. So a pixel under a lenslet shows a part of the stop, at any depth of the
//! light. A lenslet's *micro-image* of a voxel is therefore a product of two factors. One is the *patch*: the lenslet's
//! cell as the voxel projects it through the lenslet, which a table gives for each place among the pixels. The other is
//! the image of the stop under the lenslet, which does not depend on the voxel. So light is added up lenslet by lenslet
//! in micro-images, and each of their pixels is multiplied once by its share of the stop.
//!
//! The rim of the stop crosses pixels that a patch fills in part. There the share of the stop is taken as linear over
//! the pixel, so that the first moments of the patch count too.

mod array;
mod bend;
mod engine;
mod hits;
mod images;
mod kernel;
mod narrow;
#[cfg(target_arch = "x86_64")]
mod narrow_avx2;
mod patches;
mod slices;
mod stop;
mod walk;
mod wanted;
mod wide;

pub(crate) use array::LensletArray;
pub(crate) use engine::OneByOne;
pub use engine::{Lines, Micro};
pub use images::MicroImages;
#[cfg(test)]
mod tests;
