//! Light-field images: EXR, TIFF and PNG to and from `Array2<f32>` of shape (height, width), row 0 at the top.
//!
//! In: the bytes of an image file. Out: pixels in counts with their history, and new files.
//! Open first: `files.rs`, then `light_field.rs` for the EXR that the tools exchange.
//!
//! **Written.** The extension of the name chooses the format. Equal images and histories give equal bytes.
//!
//! - EXR, for every extension but the next: one part, one `f32` channel `Y`, linear counts, ZIP1 compression, rows from
//!   top to bottom, and one text attribute `lf:history` that holds the history as JSON (absent without history).
//! - TIFF, for `.tif` and `.tiff`: one page, 16-bit grey, whole counts, not compressed, and the same history in the tag
//!   `ImageDescription`.
//!
//! **Read.** The first bytes choose the format, not the name. Values are taken as they stand: no gamma, no scaling.
//!
//! - EXR as above, also with half or whole-number samples and every compression that the library knows.
//! - TIFF with grey of 8 to 16 bits (packed from 9 to 15) or `f32`, where 0 is black; classic or BigTIFF, strips or
//!   tiles, plain or compressed by LZW, deflate or PackBits, with a predictor or without. The tag `Orientation` is
//!   ignored: row 0 is the first stored one.
//! - PNG with 8-bit or 16-bit samples.
//!
//! **Pages.** Each page of a TIFF is an image. `file.tif:3` is page 3 of `file.tif`, counted from 0, unless a file of
//! exactly that name exists. Where one image is wanted, a file of several pages is refused.
//!
//! **Colour.** RGB in any of these formats is read as grey if its channels are equal in every pixel; otherwise a
//! [`Channel`] must be chosen. Full alpha is ignored; other alpha is refused unless a channel is chosen.

mod black;
mod channel;
mod clipped;
mod decode;
pub(crate) mod exr;
mod files;
mod light_field;
mod noise;
mod png;
mod stack;
mod tiff;

pub use black::ClippedBlack;
pub use channel::Channel;
pub use clipped::clipped_share;
pub use decode::Image;
pub(crate) use decode::guarded;
pub use files::{
    BLIND, Frame, FrameFiles, all_counts, frames, open, open_counts, open_frame, open_signed_frame, outside_u16, save,
};
pub use noise::noise;
pub use png::{picture, picture_colour};
pub use stack::Stack;
