//! Shared by all decoders: the image they give, and their guards against damaged files.

use crate::{Error, Refusal, Result as Outcome, history::History};
use ndarray::Array2;
use std::panic::{self, AssertUnwindSafe};

/// Maximum pixel bytes for a byte of a file. Deflate cannot exceed 1032 and LZW stays below 1400, so no valid file is
/// refused. Without the limit a damaged header would make us allocate memory for nothing.
pub(super) const RATIO: u64 = 2048;

/// An image read from a file.
pub struct Image {
    /// Counts, shape (height, width).
    pub pixels: Array2<f32>,
    /// The steps that led to it; empty if the file has none.
    pub history: History,
}

/// A decoder's failure, with its own message.
pub(super) fn damaged(error: impl std::fmt::Display) -> Refusal {
    Refusal::new(format!("cannot be decoded ({error})"), "wanted a whole, valid file")
}

pub(super) fn has_pixels(width: usize, height: usize) -> Result<(), Refusal> {
    Refusal::unless(width * height > 0, || format!("{width} x {height} pixels"), "wanted an image with pixels")
}

/// Pixels in rows from the top as an array.
pub(super) fn array(width: usize, height: usize, values: Vec<f32>) -> Result<Array2<f32>, Refusal> {
    has_pixels(width, height)?;
    Array2::from_shape_vec((height, width), values).map_err(damaged)
}

/// The beginning of a message about some pixels.
pub(super) fn pixels_are(count: usize) -> String {
    if count == 1 { "1 pixel is".to_owned() } else { format!("{count} pixels are") }
}

/// Refuses a size that a file of `length` bytes cannot hold, before memory is allocated for it.
pub(super) fn believable(width: u64, height: u64, bytes_per_pixel: u64, length: usize) -> Result<(), Refusal> {
    let size = u128::from(width) * u128::from(height) * u128::from(bytes_per_pixel);
    let found = || format!("{width} x {height} pixels in a file of {length} bytes");
    Refusal::unless(size <= u128::from(RATIO) * length as u128, found, "wanted a file that holds what its header gives")
}

/// Runs a decoder. A panic in it counts as a damaged file.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, Refusal>) -> Result<T, Refusal> {
    panic::catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(damaged("the decoder gave up")))
}

/// Refuses pixels of an image `name` that are NaN or infinite.
pub(super) fn finite(image: Image, name: &str) -> Outcome<Image> {
    let bad = image.pixels.iter().filter(|value| !value.is_finite()).count();
    match image.pixels.indexed_iter().find(|(_, value)| !value.is_finite()) {
        None => Ok(image),
        Some(((y, x), value)) => {
            let found = format!("{} not finite, the first {value} at x {x}, y {y}", pixels_are(bad));
            Err(Error::new(name, found, "wanted finite values"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{RATIO, believable};

    /// By hand: a file of 3 bytes may hold 3 RATIO bytes, as rows of RATIO pixels of a byte.
    #[test]
    fn a_size_that_its_file_cannot_hold_is_refused() {
        assert!(believable(RATIO, 3, 1, 3).is_ok());
        assert!(believable(RATIO, 3, 2, 3).is_err());
        assert!(believable(RATIO + 1, 3, 1, 3).is_err());
        assert!(believable(RATIO, 4, 1, 3).is_err());
        assert!(believable(u64::from(u32::MAX), u64::from(u32::MAX), 4, 1 << 20).is_err());
    }
}
