//! How a page of a TIFF stores its pixels, according to its tags. Valid pages that are not read are refused by name.

use super::directory::Tiff;
use crate::Refusal;
use crate::image::decode::{believable, damaged};
use ::tiff::tags::Tag;

const WANTED: &str = "wanted 8-bit to 16-bit or 32-bit float grey, or 8-bit, 16-bit or 32-bit float RGB";
const WANTED_PACKING: &str = "wanted no compression, LZW, deflate or PackBits";

/// A page that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PageLayout {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Samples of a pixel: 1 or 3, and one more for alpha.
    pub(super) samples: usize,
    /// Bits of a sample.
    pub(super) bits: usize,
    pub(super) is_float: bool,
    pub(super) is_colour: bool,
    pub(super) has_alpha: bool,
    /// Each sample of all pixels is stored apart; otherwise the samples of a pixel stand together.
    pub(super) is_planar: bool,
    /// Width and height of a tile, px; None in strips.
    pub(super) tile: Option<[usize; 2]>,
}

/// The numbers of a page's tags.
struct Tags<'a> {
    tiff: Tiff<'a>,
    directory: usize,
}

impl Tags<'_> {
    fn all(&self, tag: Tag) -> Option<Vec<u64>> {
        self.tiff.numbers(self.directory, tag.to_u16())
    }

    fn one(&self, tag: Tag) -> Option<u64> {
        self.all(tag)?.first().copied()
    }

    /// The number that all samples share; the refusal names the numbers that differ.
    fn shared(&self, tag: Tag, usual: u64, what: &str) -> Result<u64, Refusal> {
        let all = self.all(tag).unwrap_or_else(|| vec![usual]);
        let first = *all.first().unwrap_or(&usual);
        let found = || format!("channels of different {what}");
        Refusal::unless(all.iter().all(|&number| number == first), found, WANTED)?;
        Ok(first)
    }
}

impl PageLayout {
    /// Reads and checks the tags of a page. Its size is one that a file of `length` bytes can hold.
    pub(super) fn read(tiff: Tiff, directory: usize, length: usize) -> Result<Self, Refusal> {
        let tags = Tags { tiff, directory };
        let side = |tag| tags.one(tag).ok_or_else(|| damaged("a page without its size"));
        let [width, height] = [side(Tag::ImageWidth)?, side(Tag::ImageLength)?];
        check_packing(&tags)?;
        let is_colour = is_colour(&tags)?;
        let (samples, has_alpha) = samples(&tags, is_colour)?;
        let (bits, is_float) = sample_kind(&tags, samples)?;
        check_predictor(&tags, bits)?;
        let planes = tags.one(Tag::PlanarConfiguration).unwrap_or(1);
        Refusal::unless((1..=2).contains(&planes), || format!("planar configuration {planes}"), "wanted 1 or 2")?;
        let bytes = bits.div_ceil(8) * samples;
        believable(width, height, bytes, length)?;
        let tile = match (tags.one(Tag::TileWidth), tags.one(Tag::TileLength)) {
            (Some(across @ 1..), Some(down @ 1..)) => {
                believable(across, down, bytes, length)?;
                Some([across as usize, down as usize])
            }
            (None, None) => None,
            _ => return Err(damaged("a tile without its size")),
        };
        let side = |side: u64| usize::try_from(side).map_err(damaged);
        Ok(Self {
            width: side(width)?,
            height: side(height)?,
            samples: samples as usize,
            bits: bits as usize,
            is_float,
            is_colour,
            has_alpha,
            is_planar: planes == 2 && samples > 1,
            tile,
        })
    }

    /// Samples of 9 to 15 bits stand without gaps, the first in the highest bits of its byte; rows begin at a byte.
    pub(super) fn is_packed(&self) -> bool {
        (9..16).contains(&self.bits)
    }

    /// The largest value of a whole sample; 1 of a float.
    pub(super) fn most(&self) -> f32 {
        if self.is_float { 1.0 } else { ((1u32 << self.bits) - 1) as f32 }
    }

    /// Bytes of a row, or of a part of it, as stored.
    pub(super) fn row_bytes(&self, width: usize) -> usize {
        (width * self.bits).div_ceil(8)
    }

    /// Size and samples in words.
    pub(super) fn about(&self) -> String {
        let Self { width, height, bits, is_float, is_colour, has_alpha, .. } = *self;
        let float = if is_float { " float" } else { "" };
        let colour = if is_colour { "RGB" } else { "grey" };
        let alpha = if has_alpha { " with alpha" } else { "" };
        format!("{width} x {height} px, {bits}-bit{float} {colour}{alpha}")
    }
}

/// Refuses compressions and orders of bits that are not read.
fn check_packing(tags: &Tags) -> Result<(), Refusal> {
    let method = tags.one(Tag::Compression).unwrap_or(1);
    let name = match method {
        1 | 5 | 8 | 32773 | 32946 => "",
        2..=4 | 32771 => "fax",
        6 | 7 | 34892 => "JPEG",
        33003 | 33005 | 34712 => "JPEG 2000",
        34887 => "LERC",
        34925 => "LZMA",
        34926 | 50000 => "Zstandard",
        34927 | 50001 => "WebP",
        34933 => "PNG",
        22610 | 34934 => "JPEG XR",
        50002 | 52546 => "JPEG XL",
        _ => return Err(Refusal::new(format!("TIFF of compression {method}"), WANTED_PACKING)),
    };
    Refusal::unless(name.is_empty(), || format!("{name}-compressed TIFF"), WANTED_PACKING)?;
    let is_usual = tags.one(Tag::FillOrder).unwrap_or(1) == 1;
    Refusal::unless(is_usual, || "bits in reversed order (FillOrder 2)", "wanted the highest bit first")
}

/// Whether a pixel is red, green and blue. Refuses all but linear grey and RGB.
fn is_colour(tags: &Tags) -> Result<bool, Refusal> {
    let meaning = tags.one(Tag::PhotometricInterpretation);
    let found = match meaning {
        Some(1) => return Ok(false),
        Some(2) => return Ok(true),
        Some(0) => return Err(Refusal::new("inverted grey, 0 is white", "wanted linear counts, 0 is black")),
        None => "a TIFF that does not say whether 0 is black".to_owned(),
        Some(3) => "a colour palette".to_owned(),
        Some(4) => "a mask".to_owned(),
        Some(5) => "CMYK inks".to_owned(),
        Some(6) => "YCbCr colour".to_owned(),
        Some(8..=10) => "Lab colour".to_owned(),
        Some(32803) => "a colour filter mosaic (Bayer)".to_owned(),
        Some(meaning) => format!("photometric interpretation {meaning}"),
    };
    Err(Refusal::new(found, WANTED))
}

/// Samples of a pixel, and whether the last is alpha.
fn samples(tags: &Tags, is_colour: bool) -> Result<(u64, bool), Refusal> {
    let samples = tags.one(Tag::SamplesPerPixel).unwrap_or(1);
    let own = if is_colour { 3 } else { 1 };
    let extra = tags.one(Tag::ExtraSamples);
    // Early writers store alpha without the tag.
    let has_alpha = samples == own + 1 && (matches!(extra, Some(1 | 2)) || (extra.is_none() && is_colour));
    Refusal::unless(samples == own || has_alpha, || format!("{samples} channels"), WANTED)?;
    Ok((samples, has_alpha))
}

/// Bits of a sample, and whether it is a float.
fn sample_kind(tags: &Tags, samples: u64) -> Result<(u64, bool), Refusal> {
    let bits = tags.shared(Tag::BitsPerSample, 1, "depths")?;
    let format = tags.shared(Tag::SampleFormat, 1, "sample formats")?;
    let found = match (format, bits) {
        (1 | 4, 8 | 16) => return Ok((bits, false)),
        (3, 32) => return Ok((bits, true)),
        (1 | 4, 9..16) if samples == 1 => return Ok((bits, false)),
        (1 | 4, 32) => "32-bit whole numbers".to_owned(),
        (1 | 4, _) if samples == 1 => format!("{bits}-bit grey"),
        (1 | 4, _) => format!("{bits}-bit colour"),
        (2, _) => "signed samples".to_owned(),
        (3, _) => format!("{bits}-bit float"),
        (5 | 6, _) => "complex numbers".to_owned(),
        _ => format!("sample format {format}"),
    };
    Err(Refusal::new(found, WANTED))
}

/// Refuses predictors that are not undone.
fn check_predictor(tags: &Tags, bits: u64) -> Result<(), Refusal> {
    let predictor = tags.one(Tag::Predictor).unwrap_or(1);
    let is_read = match predictor {
        1 => true,
        2 => matches!(bits, 8 | 16 | 32),
        3 => bits == 32,
        _ => false,
    };
    Refusal::unless(is_read, || format!("TIFF of predictor {predictor} on {bits}-bit samples"), "wanted no predictor")
}
