//! Writes one page of 16-bit grey.

use crate::Refusal;
use crate::image::decode::{has_pixels, pixels_are};
use crate::image::exr::ascii;
use ::tiff::encoder::{TiffEncoder, TiffKindStandard, colortype::Gray16};
use ::tiff::{TiffError, TiffResult, tags::Tag};
use ndarray::Array2;
use std::io::Cursor;

/// Space reserved for tags, bytes. If they need more, the buffer is moved once.
const TAGS: usize = 64 << 10;

/// Encodes one page of 16-bit grey, not compressed, in the machine's byte order; `steps` is JSON. Rounds counts, halves
/// away from zero, and clips them. Equal input gives equal bytes. Refuses NaN and more than 4 GiB (classic TIFF).
pub(in crate::image) fn write(pixels: &Array2<f32>, steps: Option<String>) -> Result<Vec<u8>, Refusal> {
    let (height, width) = pixels.dim();
    has_pixels(width, height)?;
    if let Some(((y, x), _)) = pixels.indexed_iter().find(|(_, value)| value.is_nan()) {
        let bad = pixels.iter().filter(|value| value.is_nan()).count();
        let found = format!("{} NaN, the first at x {x}, y {y}", pixels_are(bad));
        return Err(Refusal::new(found, "wanted numbers for a 16-bit TIFF, or the name of an .exr"));
    }
    encode(pixels, width, height, steps).map_err(|error| {
        Refusal::new(format!("cannot be encoded ({error})"), "wanted an image that fits the TIFF format")
    })
}

fn encode(pixels: &Array2<f32>, width: usize, height: usize, steps: Option<String>) -> TiffResult<Vec<u8>> {
    let length = 2 * width * height;
    u32::try_from(length).map_err(|_| TiffError::IntSizeError)?;
    let mut file = Cursor::new(Vec::with_capacity(length + TAGS));
    let mut encoder = TiffEncoder::<_, TiffKindStandard>::new(&mut file)?;
    let mut page = encoder.new_image::<Gray16>(u32::try_from(width)?, u32::try_from(height)?)?;
    if let Some(steps) = steps {
        page.encoder().write_tag(Tag::ImageDescription, ascii(&steps).as_str())?;
    }
    let mut values = pixels.iter();
    let mut strip: Vec<u16> = Vec::new();
    while page.next_strip_sample_count() > 0 {
        let samples = page.next_strip_sample_count() as usize;
        strip.clear();
        // A cast from float to integer saturates.
        strip.extend(values.by_ref().take(samples).map(|value| value.round() as u16));
        page.write_strip(&strip)?;
    }
    page.finish()?;
    Ok(file.into_inner())
}
