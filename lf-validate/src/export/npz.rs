//! A volume as arrays of numpy in a zip archive.
//!
//! Source: "numpy.lib.format" of the documentation of numpy. An array is a magic word, the length of a header, the
//! header (a Python dictionary, padded to a multiple of 64 bytes) and the values. Values are compressed: most are 0.

use super::{cutout::Cutout, vti::little_endian};
use lf_core::{Refusal, history};
use std::io::{Error, Result, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter, result::ZipError};

/// Level of compression: the fastest.
const LEVEL: i64 = 1;

/// Writes the part: the array `name` of shape (z, y, x), `x_mm`, `y_mm`, `z_mm`, and `history`, one text a step.
pub fn write_npz(part: &Cutout, name: &str, out: &mut dyn Write) -> Result<()> {
    let grid = part.grid();
    let [nx, ny, nz] = grid.shape;
    let mut archive = ZipWriter::new_stream(out);
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(LEVEL))
        .large_file(true);
    let start = |archive: &mut ZipWriter<_>, name: &str, kind: &str, shape: &str| {
        archive.start_file(format!("{name}.npy"), options).map_err(failure)?;
        archive.write_all(&head(kind, shape))
    };
    start(&mut archive, name, "<f4", &format!("({nz}, {ny}, {nx})"))?;
    let mut bytes = Vec::new();
    part.slices(|slice| {
        little_endian(slice, &mut bytes);
        archive.write_all(&bytes)
    })?;
    for (axis, name) in ["x_mm", "y_mm", "z_mm"].into_iter().enumerate() {
        start(&mut archive, name, "<f8", &format!("({},)", grid.shape[axis]))?;
        let places = (0..grid.shape[axis]).flat_map(|n| grid.centre_mm(axis, n).to_le_bytes());
        archive.write_all(&places.collect::<Vec<u8>>())?;
    }
    let lines = history::lines(part.history());
    let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0).max(1);
    start(&mut archive, "history", &format!("<U{longest}"), &format!("({},)", lines.len()))?;
    for line in lines {
        let letters = line.chars().map(u32::from).chain(std::iter::repeat(0)).take(longest);
        archive.write_all(&letters.flat_map(u32::to_le_bytes).collect::<Vec<u8>>())?;
    }
    archive.finish().map(drop).map_err(failure)
}

/// The bytes before the values of an array.
fn head(kind: &str, shape: &str) -> Vec<u8> {
    const PREFIX: usize = 10;
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    let length = (PREFIX + text.len() + 1).next_multiple_of(64) - PREFIX;
    text.push_str(&" ".repeat(length - 1 - text.len()));
    text.push('\n');
    [b"\x93NUMPY\x01\x00", &(length as u16).to_le_bytes()[..], text.as_bytes()].concat()
}

fn failure(error: ZipError) -> Error {
    match error {
        ZipError::Io(error) => error,
        other => Error::other(Refusal::new(format!("cannot be encoded ({other})"), "wanted a smaller part")),
    }
}
