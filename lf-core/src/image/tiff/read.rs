//! Reads a TIFF page by page: the library decodes, on tags that it knows.

use super::directory::{MAX_DIRECTORIES, Tiff};
use super::layout::PageLayout;
use super::packed::unpacked;
use super::patched::Patched;
use crate::image::channel::{Channel, Meaning, grey};
use crate::image::decode::{Image, array, damaged};
use crate::{Refusal, history::History};
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::{TiffError, tags::Tag};

/// Places of the pages' directories, at least one.
pub(in crate::image) fn pages(bytes: &[u8]) -> Result<Vec<usize>, Refusal> {
    let tiff = Tiff::new(bytes).ok_or_else(|| damaged("its header is cut"))?;
    let pages = tiff.directories().ok_or_else(|| damaged("its directories leave the file"))?;
    Refusal::unless(!pages.is_empty(), || "no page", "wanted a TIFF with pages")?;
    Refusal::unless(
        pages.len() < MAX_DIRECTORIES,
        || format!("{MAX_DIRECTORIES} pages or more"),
        "wanted fewer in one file",
    )?;
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
        Tiff::new(bytes).ok_or_else(|| damaged("cut")).and_then(|tiff| PageLayout::read(tiff, directory, bytes.len()));
    layout.map_or_else(|refusal| refusal.found, |layout| layout.about())
}

/// Width and height of a page.
pub(in crate::image) fn size(bytes: &[u8], directory: usize) -> Result<[usize; 2], Refusal> {
    let tiff = Tiff::new(bytes).ok_or_else(|| damaged("its header is cut"))?;
    PageLayout::read(tiff, directory, bytes.len()).map(|layout| [layout.width, layout.height])
}

/// Decodes only the page whose directory is at `directory`.
pub(in crate::image) fn page(bytes: &[u8], directory: usize, channel: Option<Channel>) -> Result<Image, Refusal> {
    let tiff = Tiff::new(bytes).ok_or_else(|| damaged("its header is cut"))?;
    let layout = PageLayout::read(tiff, directory, bytes.len())?;
    let page = Page { bytes, tiff, directory, layout };
    let history = page.history();
    let PageLayout { width, height, samples, is_colour, is_planar, has_alpha, .. } = layout;
    let values = match layout.tile {
        Some(tile) => page.tiles(tile)?,
        None => page.block(&Block { size: [width, height], samples, patches: Vec::new() })?,
    };
    let pixels = width * height;
    if values.len() != pixels * samples {
        return Err(damaged(format!("{} of {} samples", values.len(), pixels * samples)));
    }
    let meaning = Meaning { is_colour, opaque: has_alpha.then(|| layout.most()) };
    let pixels = match (samples, is_planar) {
        (1, _) => array(width, height, values),
        (_, true) => grey([width, height], meaning, channel, |p, s| values[s * pixels + p]),
        (_, false) => grey([width, height], meaning, channel, |p, s| values[p * samples + s]),
    };
    Ok(Image { pixels: pixels?, history })
}

struct Page<'a> {
    bytes: &'a [u8],
    tiff: Tiff<'a>,
    directory: usize,
    layout: PageLayout,
}

/// A part that the library decodes in one call: all strips of a page, or a tile, which then looks like a page.
struct Block {
    /// Width and height, px.
    size: [usize; 2],
    /// Samples of a pixel.
    samples: usize,
    /// Offsets in the file, and the bytes to read there instead.
    patches: Vec<(usize, Vec<u8>)>,
}

impl Page<'_> {
    fn number(&self, tag: Tag, value: usize) -> Result<(usize, Vec<u8>), Refusal> {
        let patch = self.tiff.with_number(self.directory, tag.to_u16(), value as u64);
        patch.ok_or_else(|| damaged(format!("no tag {}", tag.to_u16())))
    }

    /// Decodes a block. Patched bytes make this page the first of the file, several samples bands (the library would
    /// drop or convert some of them), and packed samples bytes.
    fn block(&self, block: &Block) -> Result<Vec<f32>, Refusal> {
        let Block { size: [width, height], samples, .. } = *block;
        let row = self.layout.row_bytes(width);
        let mut patches = vec![self.tiff.as_first(self.directory)];
        if self.layout.samples > 1 {
            patches.push(self.number(Tag::PhotometricInterpretation, 1)?);
            patches.extend(self.number(Tag::ExtraSamples, 0));
        }
        patches.extend(block.patches.iter().cloned());
        if self.layout.is_packed() {
            patches.push(self.number(Tag::BitsPerSample, 8)?);
            patches.push(self.number(Tag::ImageWidth, row)?);
            patches.extend(self.number(Tag::TileWidth, row));
        }
        let stored = row * height * samples;
        let mut limits = Limits::default();
        limits.decoding_buffer_size = stored;
        limits.intermediate_buffer_size = stored + self.bytes.len();
        let decoder = Decoder::new(Patched::new(self.bytes, patches)).map_err(failed)?;
        let mut values = DecodingResult::U8(Vec::new());
        decoder.with_limits(limits).read_image_to_buffer(&mut values).map_err(failed)?;
        match values {
            DecodingResult::U8(bytes) if self.layout.is_packed() => Ok(unpacked(&bytes, width, self.layout.bits)),
            DecodingResult::U8(values) => Ok(values.into_iter().map(f32::from).collect()),
            DecodingResult::U16(values) => Ok(values.into_iter().map(f32::from).collect()),
            DecodingResult::F32(values) => Ok(values),
            _ => Err(damaged("samples of another type")),
        }
    }

    /// Decodes tile by tile. The library reads a tile row by row and then fails on valid LZW, because its decoder takes
    /// a short row without new input for the end of the data.
    fn tiles(&self, [across_px, down_px]: [usize; 2]) -> Result<Vec<f32>, Refusal> {
        let PageLayout { width, height, is_planar, .. } = self.layout;
        let [across, down] = [width.div_ceil(across_px), height.div_ceil(down_px)];
        let samples = if is_planar { 1 } else { self.layout.samples };
        let numbers = |tag: Tag| self.tiff.numbers(self.directory, tag.to_u16()).unwrap_or_default();
        let [places, lengths] = [Tag::TileOffsets, Tag::TileByteCounts].map(numbers);
        let tiles = across * down * self.layout.samples / samples;
        if [places.len(), lengths.len()] != [tiles; 2] {
            return Err(damaged(format!("{} of {tiles} tiles", places.len().min(lengths.len()))));
        }
        let mut values = vec![0.0; width * height * self.layout.samples];
        for (number, (place, length)) in places.into_iter().zip(lengths).enumerate() {
            let mut patches = vec![
                self.number(Tag::ImageWidth, across_px)?,
                self.number(Tag::ImageLength, down_px)?,
                self.number(Tag::TileOffsets, place as usize)?,
                self.number(Tag::TileByteCounts, length as usize)?,
            ];
            if is_planar {
                patches.push(self.number(Tag::SamplesPerPixel, 1)?);
                patches.push(self.number(Tag::BitsPerSample, self.layout.bits)?);
                patches.push(self.number(Tag::PlanarConfiguration, 1)?);
                patches.extend(self.number(Tag::SampleFormat, if self.layout.is_float { 3 } else { 1 }));
            }
            let tile = self.block(&Block { size: [across_px, down_px], samples, patches })?;
            let (plane, number) = (number / (across * down), number % (across * down));
            let (top, left) = (number / across * down_px, number % across * across_px);
            let row = samples * across_px.min(width - left);
            for (y, from) in tile.chunks_exact(samples * across_px).enumerate().take(height - top) {
                let start = plane * width * height + ((top + y) * width + left) * samples;
                values[start..start + row].copy_from_slice(&from[..row]);
            }
        }
        Ok(values)
    }

    /// The history in `ImageDescription`; empty if the tag holds other text.
    fn history(&self) -> History {
        let text = self.tiff.text(self.directory, Tag::ImageDescription.to_u16());
        let text = text.split(|&byte| byte == 0).next().unwrap_or_default();
        serde_json::from_slice(text).unwrap_or_default()
    }
}

/// Turns a failure of the library into a refusal.
fn failed(error: TiffError) -> Refusal {
    match error {
        TiffError::UnsupportedError(what) => {
            Refusal::new(format!("a kind of TIFF that is not read ({what})"), "wanted plain grey or RGB")
        }
        error => damaged(error),
    }
}
