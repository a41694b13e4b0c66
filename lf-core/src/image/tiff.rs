//! TIFF: reads 8-bit, 16-bit or `f32` grey, page by page; writes one page of 16-bit grey.

use super::decode::{Image, array, believable, damaged, has_pixels, pixels_are};
use super::exr::ascii;
use crate::{Refusal, history::History};
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::encoder::{TiffEncoder, TiffKindStandard, colortype::Gray16};
use ::tiff::{ColorType, TiffError, TiffResult, tags::Tag};
use ndarray::Array2;
use std::io::Cursor;

const WANTED: &str = "wanted 8-bit, 16-bit or 32-bit float grey";

/// The `PhotometricInterpretation` in which 0 is black.
const BLACK_IS_ZERO: u16 = 1;

/// Most pages that are counted; also bounds a cyclic chain of directories.
const MANY: usize = 100_000;
/// Space reserved for tags, bytes. If they need more, the buffer is moved once.
const TAGS: usize = 64 << 10;

pub(super) fn read(bytes: &[u8]) -> Result<Image, Refusal> {
    let pages = pages(bytes)?;
    let or_more = if pages >= MANY { " or more" } else { "" };
    let found = || format!("{pages} pages{or_more}");
    Refusal::unless(pages == 1, found, "wanted one page (split the stack into files)")?;
    page(bytes, 0)
}

/// Number of pages of a file.
pub(super) fn count(bytes: &[u8]) -> Result<usize, Refusal> {
    let pages = pages(bytes)?;
    Refusal::unless(pages > 0, || "no page", "wanted a TIFF with pages")?;
    Refusal::unless(pages < MANY, || format!("{MANY} pages or more"), "wanted fewer in one file")?;
    Ok(pages)
}

fn pages(bytes: &[u8]) -> Result<usize, Refusal> {
    chain(bytes).ok_or_else(|| damaged("its directories leave the file"))
}

/// Decodes page `number`, counted from 0, and no other.
pub(super) fn page(bytes: &[u8], number: usize) -> Result<Image, Refusal> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(damaged)?;
    if number > 0 {
        decoder.seek_to_image(number).map_err(damaged)?;
    }
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    let depth = depth(&mut decoder)?;
    believable(width.into(), height.into(), u64::from(depth / 8), bytes.len())?;
    let history = history(&mut decoder);

    let most = width as usize * height as usize * 4;
    let mut limits = Limits::default();
    limits.decoding_buffer_size = most;
    limits.intermediate_buffer_size = most + bytes.len();
    let mut decoder = decoder.with_limits(limits);
    let values = match decoder.read_image().map_err(damaged)? {
        DecodingResult::U8(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::U16(values) => values.into_iter().map(f32::from).collect(),
        DecodingResult::F32(values) => values,
        DecodingResult::U32(_) | DecodingResult::I32(_) => return Err(Refusal::new("32-bit whole numbers", WANTED)),
        DecodingResult::F16(_) => return Err(Refusal::new("16-bit float", WANTED)),
        _ => return Err(Refusal::new("signed samples", WANTED)),
    };
    Ok(Image { pixels: array(width as usize, height as usize, values)?, history })
}

/// Bits of a grey pixel.
fn depth(decoder: &mut Decoder<Cursor<&[u8]>>) -> Result<u8, Refusal> {
    let found = match decoder.colortype().map_err(damaged)? {
        ColorType::Gray(depth @ (8 | 16 | 32)) => {
            let meaning: Option<u16> = decoder.find_tag_unsigned(Tag::PhotometricInterpretation).map_err(damaged)?;
            let is_linear = meaning.is_none_or(|meaning| meaning == BLACK_IS_ZERO);
            Refusal::unless(is_linear, || "inverted grey, 0 is white", "wanted linear counts, 0 is black")?;
            return Ok(depth);
        }
        ColorType::Gray(depth) => format!("{depth}-bit grey"),
        ColorType::GrayA(_) => "an alpha channel".to_owned(),
        ColorType::Palette(_) => "a colour palette".to_owned(),
        ColorType::Multiband { num_samples, .. } => format!("{num_samples} channels"),
        _ => "colour".to_owned(),
    };
    Err(Refusal::new(found, WANTED))
}

/// The history in `ImageDescription`; empty if the tag holds other text.
fn history(decoder: &mut Decoder<Cursor<&[u8]>>) -> History {
    let text = decoder.find_tag(Tag::ImageDescription).ok().flatten().and_then(|value| value.into_string().ok());
    text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
}

/// Encodes one page of 16-bit grey, not compressed, in the machine's byte order; `steps` is JSON. Rounds counts, halves
/// away from zero, and clips them. Equal input gives equal bytes. Refuses NaN and more than 4 GiB (classic TIFF).
pub(super) fn write(pixels: &Array2<f32>, steps: Option<String>) -> Result<Vec<u8>, Refusal> {
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

/// Counts the pages along the chain of directories, in either byte order, classic or BigTIFF. None if the chain leaves
/// the file, or if a tag claims more bytes than the file has: the library would allocate them before it checks.
fn chain(bytes: &[u8]) -> Option<usize> {
    let number = |at: usize, width: usize| -> Option<usize> {
        let field = bytes.get(at..at.checked_add(width)?)?;
        let push = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        let value = if bytes[0] == b'I' { field.iter().rev().fold(0, push) } else { field.iter().fold(0, push) };
        usize::try_from(value).ok()
    };
    // Bytes of an entry count, of a value count or offset, and of a whole entry.
    let (counter, word, entry, first) = if number(2, 2)? == 43 { (8, 8, 20, 8) } else { (2, 4, 12, 4) };
    let mut directory = number(first, word)?;
    let mut pages = 0;
    while directory != 0 && pages < MANY {
        let entries = number(directory, counter)?;
        let start = directory.checked_add(counter)?;
        for i in 0..entries {
            let at = start.checked_add(i.checked_mul(entry)?)?;
            let size = match number(at.checked_add(2)?, 2)? {
                3 | 8 => 2,
                4 | 9 | 11 | 13 => 4,
                5 | 10 | 12 | 16..=18 => 8,
                _ => 1,
            };
            number(at.checked_add(4)?, word)?.checked_mul(size).filter(|&length| length <= bytes.len())?;
        }
        directory = number(start.checked_add(entries.checked_mul(entry)?)?, word)?;
        pages += 1;
    }
    Some(pages)
}
