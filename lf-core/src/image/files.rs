//! Opens and saves an image in any of the formats.

use super::{
    decode::{Image, damaged, guarded, pixels_are},
    light_field, png, tiff,
};
use crate::io::{self, Signature};
use crate::{Error, Refusal, Result, history::History};
use ndarray::Array2;
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

/// Writes an EXR, or a 16-bit TIFF if the name ends in `.tif` or `.tiff`; `-` is an EXR on standard output. A TIFF
/// holds whole counts, rounded and clipped to 0..=65535 ([`outside_u16`]). Refuses names of other formats, and NaN in
/// a TIFF.
pub fn save(path: &Path, pixels: &Array2<f32>, history: &History) -> Result<()> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let bytes = match extension.as_str() {
        "png" | "jpg" | "jpeg" => {
            let found = format!("the name of a .{extension} file");
            Err(Refusal::new(found, "wanted .exr or .tif, the formats written"))
        }
        "tif" | "tiff" => steps(history).and_then(|steps| guarded(|| tiff::write(pixels, steps))),
        _ => steps(history).and_then(|steps| guarded(|| light_field::write(pixels, steps))),
    };
    let bytes = bytes.map_err(|refusal| refusal.about(io::output_name(path)))?;
    io::save(path, |out| out.write_all(&bytes))
}

/// Number of pixels that [`save`] clips in a TIFF: those that do not round to 0..=65535, NaN among them.
pub fn outside_u16(pixels: &Array2<f32>) -> u64 {
    pixels.iter().filter(|value| !(0.0..=65535.0).contains(&value.round())).count() as u64
}

/// The history as JSON; None if it is empty.
fn steps(history: &History) -> std::result::Result<Option<String>, Refusal> {
    if history.is_empty() { Ok(None) } else { serde_json::to_string(history).map(Some).map_err(damaged) }
}
