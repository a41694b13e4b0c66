//! Reads PNG with 8-bit or 16-bit samples: grey, RGB or a palette, with or without alpha. Writes 8-bit grey for pages.

use super::channel::{Channel, Meaning, grey};
use super::decode::{RATIO, believable, damaged};
use crate::Refusal;
use ::image::codecs::png::{PngDecoder, PngEncoder};
use ::image::{ColorType, ExtendedColorType, ImageDecoder, ImageEncoder, Limits};
use ndarray::Array2;
use std::io::Cursor;

/// Memory allowed for chunks other than pixels, bytes.
const CHUNKS: u64 = 16 << 20;

/// Offsets of the bit depth and the colour type in the header of a PNG, and the colour type of grey.
const DEPTH: usize = 24;
const KIND: usize = 25;
const GREY: u8 = 0;

/// Width and height.
pub(super) fn size(bytes: &[u8]) -> Result<[usize; 2], Refusal> {
    let (width, height) = PngDecoder::new(Cursor::new(bytes)).map_err(damaged)?.dimensions();
    Ok([width as usize, height as usize])
}

pub(super) fn read(bytes: &[u8], channel: Option<Channel>) -> Result<Array2<f32>, Refusal> {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(RATIO * bytes.len() as u64 + CHUNKS);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(damaged)?;
    // The library stretches samples of fewer bits to eight.
    let (depth, kind) = (bytes[DEPTH], bytes[KIND]);
    let is_whole = depth >= 8 || kind != GREY;
    Refusal::unless(is_whole, || format!("{depth}-bit grey"), "wanted 8-bit or 16-bit grey or RGB")?;
    Refusal::unless(!decoder.is_apng().map_err(damaged)?, || "an animation", "wanted one image")?;
    let (width, height) = decoder.dimensions();
    let colour = decoder.color_type();
    believable(width.into(), height.into(), colour.bytes_per_pixel().into(), bytes.len())?;
    let size = [width as usize, height as usize];
    let mut values = vec![0u8; size[0] * size[1] * usize::from(colour.bytes_per_pixel())];
    decoder.read_image(&mut values).map_err(damaged)?;
    let samples = usize::from(colour.channel_count());
    let is_wide = matches!(colour, ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16);
    let opaque = colour.has_alpha().then_some(if is_wide { 65535.0 } else { 255.0 });
    let meaning = Meaning { is_colour: colour.has_color(), opaque };
    let wide = |at: usize| f32::from(u16::from_ne_bytes([values[2 * at], values[2 * at + 1]]));
    match is_wide {
        true => grey(size, meaning, channel, |p, s| wide(p * samples + s)),
        false => grey(size, meaning, channel, |p, s| values[p * samples + s].into()),
    }
}

/// A picture in grey as the bytes of a PNG, row 0 at the top. Refuses a picture without pixels.
pub fn picture(grey: &Array2<u8>) -> Result<Vec<u8>, Refusal> {
    let (height, width) = grey.dim();
    let values: Vec<u8> = grey.iter().copied().collect();
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new(&mut bytes);
    encoder.write_image(&values, width as u32, height as u32, ExtendedColorType::L8).map_err(damaged)?;
    Ok(bytes)
}

/// A picture in colour as the bytes of a PNG; `rgb` has red, green and blue of each pixel, row 0 at the top.
pub fn picture_colour([width, height]: [u32; 2], rgb: &[u8]) -> Result<Vec<u8>, Refusal> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(rgb, width, height, ExtendedColorType::Rgb8).map_err(damaged)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_written_and_read_is_the_same() {
        let grey = Array2::from_shape_fn((3, 5), |(y, x)| (50 * y + x) as u8);
        assert_eq!(read(&picture(&grey).unwrap(), None).unwrap(), grey.mapv(f32::from));
    }
}
