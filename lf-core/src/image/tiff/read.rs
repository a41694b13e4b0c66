//! Reads a TIFF page by page: the library decodes, on tags that it knows.

use super::directory::{MANY, Tiff};
use super::layout::Layout;
use super::packed::unpacked;
use super::patched::Patched;
use crate::image::channel::{Channel, Meaning, grey};
use crate::image::decode::{Image, array, damaged};
use crate::{Refusal, history::History};
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::{TiffError, tags::Tag};
use ndarray::Array2;

/// Places of the pages' directories, at least one.
pub(in crate::image) fn pages(bytes: &[u8]) -> Result<Vec<usize>, Refusal> {
    let tiff = Tiff::new(bytes).ok_or_else(|| damaged("its header is cut"))?;
    let pages = tiff.directories().ok_or_else(|| damaged("its directories leave the file"))?;
    Refusal::unless(!pages.is_empty(), || "no page", "wanted a TIFF with pages")?;
    Refusal::unless(pages.len() < MANY, || format!("{MANY} pages or more"), "wanted fewer in one file")?;
    if let (1, Some(images)) = (pages.len(), imagej_images(tiff, pages[0])) {
        let found = format!("an ImageJ stack of {images} images in one page");
        return Err(Refusal::new(found, "wanted a page for each image"));
    }
    Ok(pages)
}

/// Number of images, if more than one, that ImageJ says it wrote. Large stacks have only the first in a directory.
fn imagej_images(tiff: Tiff, directory: usize) -> Option<usize> {
    let text = str::from_utf8(tiff.text(directory, Tag::ImageDescription.to_u16())).ok()?;
    let mut lines = text.strip_prefix("ImageJ=")?.lines();
    lines.find_map(|line| line.strip_prefix("images=")?.trim().parse().ok()).filter(|&images| images > 1)
}

/// Size and samples of a page in words, or why it cannot be read.
pub(in crate::image) fn about(bytes: &[u8], directory: usize) -> String {
    let layout =
        Tiff::new(bytes).ok_or_else(|| damaged("cut")).and_then(|tiff| Layout::read(tiff, directory, bytes.len()));
    layout.map_or_else(|refusal| refusal.found, |layout| layout.about())
}

/// Decodes the page whose directory stands at `directory`, and no other.
pub(in crate::image) fn page(bytes: &[u8], directory: usize, channel: Option<Channel>) -> Result<Image, Refusal> {
    let tiff = Tiff::new(bytes).ok_or_else(|| damaged("its header is cut"))?;
    let layout = Layout::read(tiff, directory, bytes.len())?;
    let file = Patched::new(bytes, patches(tiff, directory, &layout).ok_or_else(|| damaged("a tag is missing"))?);
    let mut decoder = Decoder::new(file).map_err(failed)?;
    let history = history(&mut decoder);

    let stored = layout.row_bytes(layout.width) * layout.height * layout.samples;
    let mut limits = Limits::default();
    limits.decoding_buffer_size = stored;
    limits.intermediate_buffer_size = stored + bytes.len();
    let mut decoder = decoder.with_limits(limits);
    let mut samples = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut samples).map_err(failed)?;
    Ok(Image { pixels: pixels(samples, &layout, channel)?, history })
}

/// What the library is to read instead of the file's own bytes: the page as the first; several samples as bands, so that
/// it drops and converts none; packed samples as bytes.
fn patches(tiff: Tiff, directory: usize, layout: &Layout) -> Option<Vec<(usize, Vec<u8>)>> {
    let number = |tag: Tag, value: usize| tiff.with_number(directory, tag.to_u16(), u32::try_from(value).ok()?);
    let mut patches = vec![tiff.as_first(directory)];
    if layout.samples > 1 {
        patches.push(number(Tag::PhotometricInterpretation, 1)?);
        patches.extend(number(Tag::ExtraSamples, 0));
    }
    if layout.is_packed() {
        patches.push(number(Tag::BitsPerSample, 8)?);
        patches.push(number(Tag::ImageWidth, layout.row_bytes(layout.width))?);
        if let Some(width) = tiff.numbers(directory, Tag::TileWidth.to_u16()) {
            patches.push(number(Tag::TileWidth, layout.row_bytes(usize::try_from(*width.first()?).ok()?))?);
        }
    }
    Some(patches)
}

fn pixels(samples: DecodingResult, layout: &Layout, channel: Option<Channel>) -> Result<Array2<f32>, Refusal> {
    let Layout { width, height, bits, .. } = *layout;
    match samples {
        DecodingResult::U8(bytes) if layout.is_packed() => array(width, height, unpacked(&bytes, width, bits)),
        DecodingResult::U8(values) => one_each(&values, 255.0, layout, channel),
        DecodingResult::U16(values) => one_each(&values, 65535.0, layout, channel),
        DecodingResult::F32(values) if layout.samples == 1 => array(width, height, values),
        DecodingResult::F32(values) => one_each(&values, 1.0, layout, channel),
        _ => Err(damaged("samples of another type")),
    }
}

/// One value a pixel; `opaque` is full alpha.
fn one_each<T: Copy + Into<f32>>(
    values: &[T],
    opaque: f32,
    layout: &Layout,
    channel: Option<Channel>,
) -> Result<Array2<f32>, Refusal> {
    let Layout { width, height, samples, is_colour, is_planar, has_alpha, .. } = *layout;
    let pixels = width * height;
    if values.len() != pixels * samples {
        return Err(damaged(format!("{} of {} samples", values.len(), pixels * samples)));
    }
    let meaning = Meaning { is_colour, opaque: has_alpha.then_some(opaque) };
    match is_planar {
        true => grey([width, height], meaning, channel, |p, s| values[s * pixels + p].into()),
        false => grey([width, height], meaning, channel, |p, s| values[p * samples + s].into()),
    }
}

/// The library's failure in words.
fn failed(error: TiffError) -> Refusal {
    match error {
        TiffError::UnsupportedError(what) => {
            Refusal::new(format!("a kind of TIFF that is not read ({what})"), "wanted plain grey or RGB")
        }
        error => damaged(error),
    }
}

/// The history in `ImageDescription`; empty if the tag holds other text.
fn history(decoder: &mut Decoder<Patched>) -> History {
    let text = decoder.find_tag(Tag::ImageDescription).ok().flatten().and_then(|value| value.into_string().ok());
    text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
}
