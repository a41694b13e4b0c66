//! A frame as the stages use it: counts above a background, divided by the flat field.

use super::{decode::Image, files::open_counts};
use crate::{Error, Result, camera::Camera, io};
use ndarray::Array2;
use std::path::Path;

/// A pixel that counts less than this fraction of its light is blind: the flat field would multiply its noise by 20.
pub const BLIND: f32 = 0.05;

/// Reads an image of counts ([`open_counts`]), subtracts the background, sets negative results to 0, and divides by the
/// flat field of `camera`, which was read from `camera_file`. Pixels whose flat field is below [`BLIND`] become NaN:
/// their light is unknown. Refuses images of another size than the camera's sensor.
pub fn open_frame(path: &Path, background: Option<&Path>, camera: &Camera, camera_file: &Path) -> Result<Image> {
    let mut image = open_counts(path)?;
    let (height, width) = image.pixels.dim();
    camera.check_image(&io::name(path), width, height)?;
    if let Some(file) = background {
        let dark = like("background", file, path, &image)?;
        image.pixels.zip_mut_with(&dark, |pixel, dark| *pixel = (*pixel - dark).max(0.0));
    }
    if let Some(file) = camera.flat_field(camera_file) {
        let flat = like("flat field", &file, path, &image)?;
        image.pixels.zip_mut_with(&flat, |pixel, flat| *pixel = if *flat < BLIND { f32::NAN } else { *pixel / flat });
    }
    Ok(image)
}

/// Pixels of `file`, which must be as large as the frame; `what` names it in the message.
fn like(what: &str, file: &Path, frame: &Path, image: &Image) -> Result<Array2<f32>> {
    let pixels = open_counts(file)?.pixels;
    let ((height, width), (wanted_height, wanted_width)) = (pixels.dim(), image.pixels.dim());
    if (height, width) == (wanted_height, wanted_width) {
        return Ok(pixels);
    }
    let wanted = format!("wanted the {wanted_width} x {wanted_height} px of {}", io::name(frame));
    Err(Error::new(io::name(file), format!("{what} of {width} x {height} px"), wanted))
}
