//! TIFF: reads grey and RGB, page by page; writes one page of 16-bit grey.
//!
//! In: the bytes of a file, and the place of a page's directory. Out: one value a pixel, and the history.
//! Open first: `read.rs`, then `layout.rs`, which names what is not read.

mod directory;
mod layout;
mod packed;
mod patched;
mod read;
mod write;

pub(super) use read::{about, page, pages, size};
pub(super) use write::write;
