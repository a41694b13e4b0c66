//! A frame as the stages want it: counts above a background.

use super::{Image, open_counts};
use crate::{Error, Result, io};
use std::path::Path;

/// Reads an image of counts ([`open_counts`]) and subtracts a background of the same size; what falls below zero
/// becomes zero.
pub fn open_frame(path: &Path, background: Option<&Path>) -> Result<Image> {
    let mut image = open_counts(path)?;
    if let Some(file) = background {
        let dark = open_counts(file)?;
        let ((height, width), (wanted_height, wanted_width)) = (dark.pixels.dim(), image.pixels.dim());
        if (height, width) != (wanted_height, wanted_width) {
            return Err(Error::new(
                io::name(file),
                format!("background of {width} x {height} px"),
                format!("wanted the {wanted_width} x {wanted_height} px of {}", io::name(path)),
            ));
        }
        image.pixels.zip_mut_with(&dark.pixels, |pixel, dark| *pixel = (*pixel - dark).max(0.0));
    }
    Ok(image)
}
