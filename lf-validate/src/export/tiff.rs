//! A volume as a stack of TIFF pages, one a slice across z, the deepest first.
//!
//! Row 0 is the top of the picture, so y falls from row to row. The description of the first page is that of ImageJ,
//! which reads the spacings from it; the line `lf_history` holds the history as JSON. A stack above 4 GiB is a BigTIFF.
//! All pages' tags come first, so that the pixels can follow as they are made.

use super::{cutout::Cutout, vti::little_endian};
use lf_core::Refusal;
use std::io::{Error, Result, Write};

/// How a value is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Samples {
    /// The value itself, 32 bits.
    Float,
    /// In 16 bits: a whole number, the value times this factor.
    Whole(f32),
}

impl Samples {
    fn bytes(self) -> u64 {
        if self == Self::Float { 4 } else { 2 }
    }
}

/// Types of tags.
const TEXT: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const RATIO: u16 = 5;
const LONG8: u16 = 16;

/// One stack: sizes, and how long its parts are.
struct TiffStack<'a> {
    part: &'a Cutout<'a>,
    samples: Samples,
    description: String,
    is_big: bool,
}

/// A tag: its number, its type, how many values, and the value or its place.
type Tag = (u16, u16, u64, u64);

impl TiffStack<'_> {
    fn pages(&self) -> u64 {
        self.part.grid().shape[2] as u64
    }

    fn page_bytes(&self) -> u64 {
        self.part.slice_len() as u64 * self.samples.bytes()
    }

    /// Place of the tags of a page: 15 of the first page, which has the description as well, and 14 of each other.
    fn tags_at(&self, page: u64) -> u64 {
        let bytes = |tags: u64| if self.is_big { 8 + 20 * tags + 8 } else { 2 + 12 * tags + 4 };
        let header = if self.is_big { 16 } else { 8 };
        header + if page == 0 { 0 } else { bytes(15) + (page - 1) * bytes(14) }
    }

    /// Places of the two resolutions and of the description, which follow the tags.
    fn ratios_at(&self) -> u64 {
        self.tags_at(self.pages()).next_multiple_of(8)
    }

    fn description_at(&self) -> u64 {
        self.ratios_at() + 16
    }

    /// Place of the pixels of a page.
    fn pixels_at(&self, page: u64) -> u64 {
        (self.description_at() + self.description.len() as u64).next_multiple_of(16) + page * self.page_bytes()
    }

    fn tags(&self, page: u64) -> Vec<Tag> {
        let [nx, ny, _] = self.part.grid().shape.map(|n| n as u64);
        let place = if self.is_big { LONG8 } else { LONG };
        let is_float = self.samples == Samples::Float;
        let mut tags = vec![
            (254, LONG, 1, 0),
            (256, LONG, 1, nx),
            (257, LONG, 1, ny),
            (258, SHORT, 1, 8 * self.samples.bytes()),
            (259, SHORT, 1, 1),
            (262, SHORT, 1, 1),
            (273, place, 1, self.pixels_at(page)),
            (277, SHORT, 1, 1),
            (278, LONG, 1, ny),
            (279, place, 1, self.page_bytes()),
            (282, RATIO, 1, self.ratios_at()),
            (283, RATIO, 1, self.ratios_at() + 8),
            (296, SHORT, 1, 1),
            (339, SHORT, 1, if is_float { 3 } else { 1 }),
        ];
        if page == 0 {
            tags.insert(6, (270, TEXT, self.description.len() as u64, self.description_at()));
        }
        tags
    }

    /// Everything before the pixels.
    fn head(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.pixels_at(0) as usize);
        let first = self.tags_at(0);
        if self.is_big {
            bytes.extend(b"II\x2b\0\x08\0\0\0");
            bytes.extend(first.to_le_bytes());
        } else {
            bytes.extend(b"II\x2a\0");
            bytes.extend((first as u32).to_le_bytes());
        }
        for page in 0..self.pages() {
            let tags = self.tags(page);
            let count = tags.len() as u64;
            bytes.extend(&count.to_le_bytes()[..if self.is_big { 8 } else { 2 }]);
            let width = if self.is_big { 8 } else { 4 };
            for (number, kind, count, value) in tags {
                bytes.extend(number.to_le_bytes());
                bytes.extend(kind.to_le_bytes());
                bytes.extend(&count.to_le_bytes()[..width]);
                // BigTIFF keeps a ratio in the tag itself.
                let value = if self.is_big && kind == RATIO { self.ratio(usize::from(number != 282)) } else { value };
                bytes.extend(&value.to_le_bytes()[..width]);
            }
            let next = if page + 1 < self.pages() { self.tags_at(page + 1) } else { 0 };
            bytes.extend(&next.to_le_bytes()[..width]);
        }
        bytes.resize(self.ratios_at() as usize, 0);
        bytes.extend([0, 1].map(|axis| self.ratio(axis)).iter().flat_map(|ratio| ratio.to_le_bytes()));
        bytes.extend(self.description.as_bytes());
        bytes.resize(self.pixels_at(0) as usize, 0);
        bytes
    }

    /// Pixels per millimetre along an axis: numerator below, denominator above.
    fn ratio(&self, axis: usize) -> u64 {
        const PART: f64 = 1e9;
        let spacing_mm = self.part.grid().spacing_mm[axis];
        let part = if spacing_mm < 4.0 { PART } else { PART * 1e-6 };
        (part as u64) | ((spacing_mm * part).round().clamp(1.0, u32::MAX.into()) as u64) << 32
    }
}

/// Writes the part as a stack.
pub fn write_tiff(part: &Cutout, samples: Samples, out: &mut dyn Write) -> Result<()> {
    let mut stack = TiffStack { part, samples, description: description(part, samples), is_big: false };
    stack.is_big = stack.pixels_at(stack.pages()) > u32::MAX.into();
    if stack.part.grid().shape.iter().any(|n| u32::try_from(*n).is_err()) {
        return Err(Error::other(Refusal::new("more than 2^32 voxels along an axis", "wanted a smaller part")));
    }
    out.write_all(&stack.head())?;
    let nx = part.grid().shape[0];
    let mut bytes = Vec::new();
    part.slices(|slice| {
        for row in slice.chunks(nx).rev() {
            match samples {
                Samples::Float => little_endian(row, &mut bytes),
                Samples::Whole(factor) => {
                    bytes.clear();
                    // A cast from float to integer saturates.
                    bytes.extend(row.iter().flat_map(|value| ((value * factor).round() as u16).to_le_bytes()));
                }
            }
            out.write_all(&bytes)?;
        }
        Ok(())
    })
}

/// The description of the first page, ended by a zero.
fn description(part: &Cutout, samples: Samples) -> String {
    let (grid, largest) = (part.grid(), part.largest());
    let (slices, spacing) = (grid.shape[2], grid.spacing_mm[2]);
    let top = if let Samples::Whole(factor) = samples { largest * factor } else { largest };
    let scale = if let Samples::Whole(factor) = samples { format!("lf_scale={factor}\n") } else { String::new() };
    let [x, y, z] = grid.origin_mm;
    let json = serde_json::to_string(part.history()).unwrap_or_default();
    format!(
        "ImageJ=1.54f\nimages={slices}\nslices={slices}\nunit=mm\nspacing={spacing}\nloop=false\nmin=0.0\nmax={top}\n\
         {scale}lf_origin_mm={x},{y},{z}\nlf_history={}\n\0",
        ascii(&json)
    )
}

/// Letters beyond ASCII as escapes of JSON: the text of a TIFF has no declared encoding.
fn ascii(json: &str) -> String {
    let escaped = |letter: char| -> String {
        if letter.is_ascii() {
            return letter.to_string();
        }
        letter.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}")).collect()
    };
    json.chars().map(escaped).collect()
}
