//! Opens an image in any of the formats.

use super::decode::{Image, guarded, pixels_are};
use super::{light_field, png, tiff};
use crate::io::{self, Signature};
use crate::{Error, Refusal, Result, history::History};
use std::path::Path;

/// Reads EXR, TIFF or PNG by its first bytes; `-` is standard input. Pixels may be negative or not finite.
pub fn open(path: &Path) -> Result<Image> {
    from_bytes(&io::open(path)?, &io::name(path))
}

/// Reads an image from memory as [`open`] does; `name` stands for it in messages. Refuses colour, alpha, several pages
/// or parts, and other sample types.
pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Image> {
    guarded(|| match Signature::of(bytes) {
        Some(Signature::Exr) => light_field::read(bytes),
        Some(Signature::Tiff) => tiff::read(bytes),
        Some(Signature::Png) => png::read(bytes).map(|pixels| Image { pixels, history: History::new() }),
        _ if bytes.is_empty() => Err(Refusal::new("empty", "wanted an EXR, TIFF or PNG image")),
        _ => Err(Refusal::new("not an image by its first bytes", "wanted EXR, TIFF or PNG")),
    })
    .map_err(|refusal| refusal.about(name))
}

/// Reads as [`open`] does, and refuses pixels that are NaN, infinite or negative.
pub fn open_counts(path: &Path) -> Result<Image> {
    counts(open(path)?, &io::name(path))
}

/// The image, if every pixel is a count.
pub(super) fn counts(image: Image, name: &str) -> Result<Image> {
    let is_count = |value: f32| (0.0..f32::INFINITY).contains(&value);
    let bad = image.pixels.iter().filter(|&&value| !is_count(value)).count();
    match image.pixels.indexed_iter().find(|&(_, &value)| !is_count(value)) {
        None => Ok(image),
        Some(((y, x), value)) => {
            let found = format!("{} not a count, the first {value} at x {x}, y {y}", pixels_are(bad));
            Err(Error::new(name, found, "wanted finite values that are not negative"))
        }
    }
}
