//! Reads PNG with 8-bit or 16-bit grey.

use super::decode::{RATIO, array, believable, damaged};
use crate::Refusal;
use ::image::codecs::png::PngDecoder;
use ::image::{ColorType, ExtendedColorType, ImageDecoder, Limits};
use ndarray::Array2;
use std::io::Cursor;

const WANTED: &str = "wanted 8-bit or 16-bit grey";

/// Memory allowed for chunks other than pixels, bytes.
const CHUNKS: u64 = 16 << 20;

pub(super) fn read(bytes: &[u8]) -> Result<Array2<f32>, Refusal> {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(RATIO * bytes.len() as u64 + CHUNKS);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let depth: usize = match (decoder.original_color_type(), decoder.color_type()) {
        (ExtendedColorType::L1, _) => return Err(Refusal::new("1-bit grey", WANTED)),
        (ExtendedColorType::L2, _) => return Err(Refusal::new("2-bit grey", WANTED)),
        (ExtendedColorType::L4, _) => return Err(Refusal::new("4-bit grey", WANTED)),
        (_, ColorType::L8) => 1,
        (_, ColorType::L16) => 2,
        (_, ColorType::La8 | ColorType::La16) => return Err(Refusal::new("an alpha channel", WANTED)),
        _ => return Err(Refusal::new("colour", WANTED)),
    };
    Refusal::unless(!decoder.is_apng().map_err(damaged)?, || "an animation", "wanted one image")?;
    believable(width.into(), height.into(), depth as u64, bytes.len())?;
    let mut samples = vec![0u8; width as usize * height as usize * depth];
    decoder.read_image(&mut samples).map_err(damaged)?;
    let values = match depth {
        1 => samples.into_iter().map(f32::from).collect(),
        _ => samples.chunks_exact(2).map(|pair| f32::from(u16::from_ne_bytes([pair[0], pair[1]]))).collect(),
    };
    array(width as usize, height as usize, values)
}
