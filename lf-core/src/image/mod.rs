//! Light-field images: EXR, TIFF, PNG to and from `Array2<f32>` of shape (height, width), row 0 at the top.
//!
//! What is written, by the extension of the name: EXR in one part with one `f32` channel `Y`, linear counts, ZIP1, rows
//! from top to bottom, and one text attribute `lf:history` with the steps as JSON; or, under `.tif` and `.tiff`, TIFF
//! of one page with 16-bit grey, whole counts, not compressed, and the same steps in the tag `ImageDescription`. Equal
//! images and histories give equal bytes.
//! What is read, by the first bytes and not by the name: that (EXR also with half or whole-number samples, any
//! compression the library knows), TIFF of one page (of many through [`Stack`]) with 8-bit, 16-bit or `f32` grey, PNG with 8-bit or 16-bit grey.
//! Values are taken as they stand: no gamma, no scaling.

pub(crate) mod exr;
mod frame;
mod noise;
mod png;
mod stack;
mod tiff;

pub use frame::{BLIND, open_frame};
pub use noise::noise;
pub use stack::Stack;

use crate::history::History;
use crate::{Error, Result, io};
use ndarray::Array2;
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;

/// The attribute that holds the steps.
const HISTORY: &str = "lf:history";

/// The most pixel bytes that one byte of a file is believed to stand for. Deflate cannot pass 1032 and LZW stays below
/// 1400, so no true file is refused; a header that promises more would make us allocate for nothing.
const RATIO: u64 = 2048;

/// An image read from a file.
pub struct Image {
    /// Counts, shape (height, width).
    pub pixels: Array2<f32>,
    /// The steps that led to it; empty where the file has none.
    pub history: History,
}

/// What was found and what was wanted; the file's name is added outside.
type Refusal = (String, String);

fn refusal(found: impl Into<String>, wanted: impl Into<String>) -> Refusal {
    (found.into(), wanted.into())
}

/// A decoder's failure in its own words.
fn damaged(error: impl std::fmt::Display) -> Refusal {
    refusal(format!("cannot be decoded ({error})"), "wanted a whole, valid file")
}

/// Reads EXR, TIFF or PNG by its first bytes, `-` is standard input. Pixels may be negative or not finite here.
///
/// # Errors
/// Colour, alpha, several pages or parts, other sample types, damage, and no pixels.
pub fn open(path: &Path) -> Result<Image> {
    let bytes = io::open(path)?;
    from_bytes(&bytes, &io::name(path))
}

/// Reads an image from memory as [`open`] does; `name` is what messages call it.
///
/// # Errors
/// As [`open`].
pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Image> {
    guarded(|| match bytes {
        [0x76, 0x2f, 0x31, 0x01, ..] => light_field(bytes),
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => tiff::read(bytes),
        [0x89, b'P', b'N', b'G', ..] => png::read(bytes).map(plain),
        [] => Err(refusal("empty", "wanted an EXR, TIFF or PNG image")),
        _ => Err(refusal("not an image by its first bytes", "wanted EXR, TIFF or PNG")),
    })
    .map_err(|(found, wanted)| Error::new(name, found, wanted))
}

/// Reads as [`open`] and refuses pixels that are NaN, infinite or negative, saying how many and where the first is.
///
/// # Errors
/// Also those of [`open`].
pub fn open_counts(path: &Path) -> Result<Image> {
    counts(open(path)?, &io::name(path))
}

/// An image that holds nothing but counts.
fn counts(image: Image, name: &str) -> Result<Image> {
    let is_count = |value: f32| (0.0..f32::INFINITY).contains(&value);
    let bad = image.pixels.iter().filter(|&&value| !is_count(value)).count();
    match image.pixels.indexed_iter().find(|&(_, &value)| !is_count(value)) {
        None => Ok(image),
        Some(((y, x), value)) => {
            let pixels = if bad == 1 { "1 pixel is" } else { &format!("{bad} pixels are") };
            let found = format!("{pixels} not a count, the first {value} at x {x}, y {y}");
            Err(Error::new(name, found, "wanted finite values that are not negative"))
        }
    }
}

/// Writes an EXR, or a 16-bit TIFF where the name ends in `.tif` or `.tiff`; `-` is an EXR on standard output. A TIFF
/// holds counts rounded to whole ones and clipped to 0..=65535: [`outside_u16`] says how many are clipped.
///
/// # Errors
/// Those of writing, no pixels, a name that promises another format, and NaN for a TIFF.
pub fn save(path: &Path, pixels: &Array2<f32>, history: &History) -> Result<()> {
    let name = io::output_name(path);
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let bytes = match extension.as_str() {
        "png" | "jpg" | "jpeg" => {
            Err(refusal(format!("the name of a .{extension} file"), "wanted .exr or .tif, the formats written"))
        }
        "tif" | "tiff" => steps(history).and_then(|steps| guarded(|| tiff::write(pixels, steps))),
        _ => steps(history).and_then(|steps| {
            let (height, width) = pixels.dim();
            let steps = steps.map(|steps| (HISTORY, steps));
            guarded(|| exr::write(width, height, vec![("Y", pixels.iter().copied().collect())], steps))
        }),
    };
    let bytes = bytes.map_err(|(found, wanted)| Error::new(&name, found, wanted))?;
    io::save(path, |out| out.write_all(&bytes))
}

/// How many pixels [`save`] clips in a TIFF: those that do not round to 0..=65535, NaN among them.
pub fn outside_u16(pixels: &Array2<f32>) -> u64 {
    pixels.iter().filter(|value| !(0.0..=65535.0).contains(&value.round())).count() as u64
}

/// The steps as JSON; None where there are none.
fn steps(history: &History) -> std::result::Result<Option<String>, Refusal> {
    if history.is_empty() { Ok(None) } else { serde_json::to_string(history).map(Some).map_err(damaged) }
}

fn plain(pixels: Array2<f32>) -> Image {
    Image { pixels, history: History::new() }
}

fn light_field(bytes: &[u8]) -> std::result::Result<Image, Refusal> {
    let one_channel = "wanted one channel Y, linear counts";
    let header = exr::Header::read(bytes)?;
    match header.channels.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["Y"] => {}
        names if ["u", "v", "w"].iter().all(|name| names.contains(name)) => {
            return Err(refusal("a vector field", one_channel));
        }
        names if names.iter().any(|name| ["R", "G", "B", "RY", "BY"].contains(name)) => {
            return Err(refusal(format!("colour, channels {}", names.join(", ")), one_channel));
        }
        ["A", "Y"] => return Err(refusal("an alpha channel", one_channel)),
        [name] => return Err(refusal(format!("channel {name}"), one_channel)),
        names => return Err(refusal(format!("channels {}", names.join(", ")), one_channel)),
    }
    let history = match header.text(HISTORY) {
        None => History::new(),
        Some(text) => serde_json::from_str(&text)
            .map_err(|error| refusal(format!("attribute {HISTORY}: {error}"), "wanted the steps as JSON"))?,
    };
    let (width, height) = (header.width, header.height);
    let [values]: [Vec<f32>; 1] = exr::read(bytes, header, ["Y"])?;
    Ok(Image { pixels: array(width, height, values)?, history })
}

fn array(width: usize, height: usize, values: Vec<f32>) -> std::result::Result<Array2<f32>, Refusal> {
    if width == 0 || height == 0 {
        return Err(refusal(format!("{width} x {height} pixels"), "wanted an image with pixels"));
    }
    Array2::from_shape_vec((height, width), values).map_err(damaged)
}

/// Refuses sizes that a file of `length` bytes cannot hold, before anything is allocated for them.
fn believable(width: u64, height: u64, bytes_per_pixel: u64, length: usize) -> std::result::Result<(), Refusal> {
    let wanted = u128::from(width) * u128::from(height) * u128::from(bytes_per_pixel);
    if wanted > u128::from(RATIO) * length as u128 {
        let found = format!("{width} x {height} pixels in a file of {length} bytes");
        return Err(refusal(found, "wanted a file that holds what its header gives"));
    }
    Ok(())
}

/// A decoder that panics on damage has found damage.
pub(crate) fn guarded<T>(
    work: impl FnOnce() -> std::result::Result<T, (String, String)>,
) -> std::result::Result<T, (String, String)> {
    panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(damaged("the decoder gave up")))
}
