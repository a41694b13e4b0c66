//! In: voxels, and an image or strengths. Out: the image of the strengths, or what each voxel sees of the image; exact
//! weights of any camera, made where they are used and never stored.
//! First file to open: `engine.rs`; `walk.rs` finds the lenslets of a voxel, `patches.rs` is the table of their light.
//!
//! The sensor stands near the lenslets' focus. So a pixel under a lenslet is a part of the stop, whatever the depth of
//! the light. A lenslet's *micro-image* of a voxel is therefore the product of two things. One is the *patch*: the
//! lenslet's cell as the voxel projects it through the lenslet, which a table gives for each place among the pixels.
//! The other is the image of the stop under the lenslet, which is the same for all voxels. So light is added up lenslet
//! by lenslet in micro-images, and each pixel of these is multiplied once by its share of the stop.
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
