//! A volume as VTK image data.

use super::cutout::Cutout;
use lf_core::field::ImageData;
use std::io::{Result, Write};

/// Bytes of a slice as a file holds them.
pub(super) fn little_endian(values: &[f32], bytes: &mut Vec<u8>) {
    bytes.clear();
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

/// Writes the part with one array `name`, a value for every voxel.
pub fn write_vti(part: &Cutout, name: &str, out: &mut dyn Write) -> Result<()> {
    let grid = part.grid();
    let image = ImageData {
        shape: grid.shape,
        spacing_mm: grid.spacing_mm,
        origin_mm: grid.origin_mm,
        dt_s: None,
        history: part.history(),
        arrays: vec![(name, 1)],
    };
    let mut bytes = Vec::new();
    image.write(out, |_, out| {
        part.slices(|slice| {
            little_endian(slice, &mut bytes);
            out.write_all(&bytes)
        })
    })
}
