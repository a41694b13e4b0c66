//! Saves an image in the format that its name asks for.

use super::decode::{damaged, guarded};
use super::{light_field, tiff};
use crate::{Refusal, Result, history::History, io};
use ndarray::Array2;
use std::path::Path;

/// Writes an EXR, or a 16-bit TIFF if the name ends in `.tif` or `.tiff`; `-` is an EXR on standard output. A TIFF
/// holds whole counts, rounded and clipped to 0..=65535; [`outside_u16`] says how many are clipped. Refuses names of
/// other formats, and NaN in a TIFF.
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
