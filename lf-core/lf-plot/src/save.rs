//! From the SVG to a file.

use super::shapes::Drawing;
use super::{pdf, pixels};
use lf_core::{Result, io};
use std::path::Path;

/// Writes the SVG of a chart to a file whole or not at all: a PNG or a PDF if its name ends so, else the SVG itself.
pub fn save(path: &Path, svg: &str) -> Result<()> {
    let end = path.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default();
    let drawing = || Drawing::parse(svg).map_err(|refusal| refusal.about(io::output_name(path)));
    let bytes = match end.as_str() {
        "png" => pixels::png(&drawing()?).map_err(|refusal| refusal.about(io::output_name(path)))?,
        "pdf" => pdf::pdf(&drawing()?),
        _ => return io::save_text(path, |out| out.write_all(svg.as_bytes())),
    };
    io::save(path, |out| out.write_all(&bytes))
}
