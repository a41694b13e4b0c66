//! From a drawing to a file.

use super::{drawing::Drawing, pdf::pdf, pixels::png};
use lf_core::{Result, io};
use std::path::Path;

/// Writes a drawing to a file whole or not at all: as PNG or PDF if its name ends so, else as SVG.
pub fn save(path: &Path, drawing: &Drawing) -> Result<()> {
    let end = path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default();
    let bytes = match end.as_str() {
        "png" => png(drawing),
        "pdf" => pdf(drawing),
        _ => return io::save_text(path, |out| out.write_all(drawing.svg().as_bytes())),
    };
    let bytes = bytes.map_err(|refusal| refusal.about(io::output_name(path)))?;
    io::save(path, |out| out.write_all(&bytes))
}
