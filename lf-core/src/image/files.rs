//! Opens an image in any of the formats, also as a frame whose background and flat field are removed; saves it.

use super::black::ClippedBlack;
use super::clipped::clipped_share;
use super::noise::noise;
use super::{
    channel::Channel,
    decode::{Image, damaged, finite, guarded},
    light_field,
    stack::Stack,
    tiff,
};
use crate::io;
use crate::{Error, Refusal, Result, camera::Camera, history::History};
use ndarray::{ArcArray2, Array2};
use std::path::{Path, PathBuf};

/// Reads EXR, TIFF or PNG by its first bytes; `-` is standard input, and `file.tif:3` names a page, from 0. Refuses
/// several pages if none is named, and colour whose channels differ. Pixels may be negative or not finite.
pub fn open(path: &Path) -> Result<Image> {
    Stack::open(path)?.only(None)
}

/// Reads like [`open`], colour by `channel`. Refuses pixels that are NaN or infinite. Pixels may be negative: a
/// background may have been subtracted.
pub fn open_counts(path: &Path, channel: Option<Channel>) -> Result<Image> {
    finite(Stack::open(path)?.only(channel)?, &io::name(path))
}

/// The paths, with each multi-page TIFF replaced by its pages `file.tif:0`, `file.tif:1` and so on. Pipes and files
/// that cannot be read stay as they are.
pub fn frames(paths: &[PathBuf]) -> Vec<PathBuf> {
    let page = |path: &Path, number: usize| {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(":{number}"));
        PathBuf::from(name)
    };
    let pages = |path: &PathBuf| match path.is_file().then(|| Stack::open(path)) {
        Some(Ok(stack)) if stack.images() > 1 => (0..stack.images()).map(|number| page(path, number)).collect(),
        _ => vec![path.clone()],
    };
    paths.iter().flat_map(pages).collect()
}

/// A pixel that counts less than this fraction of its light is blind: the flat field would multiply its noise by 20. A
/// negative one is blind too, and has the light of its absolute value.
pub const BLIND: f32 = 0.05;

/// Images of the sensor's size that belong to a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameFiles<'a> {
    /// Subtracted first.
    pub background: Option<&'a Path>,
    /// 0 where a wall or a reflection hides the particles. Such pixels count as blind.
    pub mask: Option<&'a Path>,
}

/// A frame without its background.
pub struct Frame {
    /// Counts, shape (height, width); NaN where the pixel is blind, masked, cut by a second stop, or clipped in a frame
    /// for a fit.
    pub pixels: ArcArray2<f32>,
    /// The flat field, if the pixels have not been divided by it.
    pub flat: Option<Array2<f32>>,
    /// The steps that led to it; empty if the file has none.
    pub history: History,
    /// Level, counts, and share of the pixels that were clipped when the frame was taken: see [`clipped_share`].
    pub clipped: Option<(f32, f64)>,
    /// Its black level, if it was clipped when the frame was taken.
    pub black: Option<ClippedBlack>,
    /// Standard deviation of a dark pixel, counts: [`noise`], before pixels are clipped or set to 0.
    pub noise: f64,
    /// Counts of the background over those of the frame.
    pub background_share: Option<f64>,
}

/// Reads a frame, subtracts the background, sets negative results to 0, and divides by the flat field of `camera`,
/// which was read from `camera_file`. Pixels below [`BLIND`], masked ones and those that its second stop cuts become
/// NaN. All images are sensor-sized.
pub fn open_frame(
    path: &Path,
    files: FrameFiles,
    camera: &Camera,
    camera_file: &Path,
    channel: Option<Channel>,
) -> Result<Frame> {
    read_frame(path, files, (camera, camera_file), channel, false)
}

/// Like [`open_frame`], but as a fit needs it. Pixels darker than the background stay negative, so that their mean is
/// that of the light. They are not divided by the flat field, which is given along: noise is that of the counts. Where
/// a second stop or blades cut, the flat field is what they leave. Pixels at a clipped black level get the mean of
/// what was cut off, and those at a clipped brightest level become NaN.
pub fn open_signed_frame(
    path: &Path,
    files: FrameFiles,
    camera: &Camera,
    camera_file: &Path,
    channel: Option<Channel>,
) -> Result<Frame> {
    read_frame(path, files, (camera, camera_file), channel, true)
}

/// If `is_signed`, negative differences from the background are kept, and pixels are not divided by the flat field.
fn read_frame(
    path: &Path,
    files: FrameFiles,
    (camera, camera_file): (&Camera, &Path),
    channel: Option<Channel>,
    is_signed: bool,
) -> Result<Frame> {
    let mut image = open_counts(path, channel)?;
    let (height, width) = image.pixels.dim();
    camera.check_image(&io::name(path), width, height)?;
    if let Some(file) = files.mask {
        let mask = like("mask", file, path, &image, channel)?;
        Refusal::unless(mask.iter().any(|value| *value > 0.0), || "all pixels are 0", "wanted pixels that are used")
            .map_err(|refusal| refusal.about(io::name(file)))?;
        image.pixels.zip_mut_with(&mask, |pixel, used| *pixel = if *used > 0.0 { *pixel } else { f32::NAN });
    }
    let clipped = clipped_share(image.pixels.view());
    let black = ClippedBlack::of(image.pixels.view());
    if let Some((level, _)) = clipped.filter(|_| is_signed) {
        image.pixels.mapv_inplace(|pixel| if pixel >= level { f32::NAN } else { pixel });
    }
    if let Some(black) = black.filter(|_| is_signed) {
        black.unclip(&mut image.pixels);
    }
    let mut background_share = None;
    if let Some(file) = files.background {
        let dark = like("background", file, path, &image, channel)?;
        // Pixels that a mask or clipped light takes from the frame count on neither side.
        let both = image.pixels.iter().zip(&dark).filter(|(pixel, dark)| pixel.is_finite() && dark.is_finite());
        let [counts, dark_counts] =
            both.fold([0.0; 2], |[a, b], (pixel, dark)| [a + f64::from(*pixel), b + f64::from(*dark)]);
        background_share = Some(dark_counts / counts.max(f64::MIN_POSITIVE));
        image.pixels -= &dark;
    }
    let noise = black.map_or_else(|| noise(image.pixels.view()), |black| black.noise);
    if !is_signed {
        image.pixels.mapv_inplace(|pixel| if pixel < 0.0 { 0.0 } else { pixel });
    }
    let mut flat =
        camera.flat_field(camera_file).map(|file| like("flat field", &file, path, &image, channel)).transpose()?;
    if let Some(flat) = &flat {
        image.pixels.zip_mut_with(flat, |pixel, flat| {
            if *flat < BLIND {
                *pixel = f32::NAN;
            } else if !is_signed {
                *pixel /= flat;
            }
        });
    }
    if let Some(cut) = camera.cut_pixels() {
        image.pixels.zip_mut_with(&cut, |pixel, share| *pixel = if share.is_nan() { *pixel } else { f32::NAN });
        // Light that arrives at a cut pixel spreads to others. A measured flat field knows how much it is.
        if is_signed {
            flat.get_or_insert_with(|| cut.mapv_into(|share| if share.is_nan() { 1.0 } else { share }));
        }
    }
    // The light of a blind pixel spreads to others.
    let flat = flat.filter(|_| is_signed).map(|flat| flat.mapv_into(f32::abs));
    Ok(Frame {
        pixels: image.pixels.into_shared(),
        flat,
        history: image.history,
        clipped,
        black,
        noise,
        background_share,
    })
}

/// The sum of an image's finite pixels.
pub fn all_counts(pixels: &Array2<f32>) -> f64 {
    pixels.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value)).sum()
}

/// Pixels of `file`, which must be as large as the frame; `what` names it in the message.
fn like(what: &str, file: &Path, frame: &Path, image: &Image, channel: Option<Channel>) -> Result<Array2<f32>> {
    let pixels = open_counts(file, channel)?.pixels;
    let ((height, width), (wanted_height, wanted_width)) = (pixels.dim(), image.pixels.dim());
    if (height, width) == (wanted_height, wanted_width) {
        return Ok(pixels);
    }
    let wanted = format!("wanted the {wanted_width} x {wanted_height} px of {}", io::name(frame));
    Err(Error::new(io::name(file), format!("{what} of {width} x {height} px"), wanted))
}

/// Writes an EXR, or a 16-bit TIFF for `.tif` and `.tiff`; `-` is an EXR on standard output. A TIFF holds whole counts,
/// rounded and clipped to 0..=65535 ([`outside_u16`]). Refuses names of other formats, and NaN in a TIFF.
pub fn save(path: &Path, pixels: &Array2<f32>, history: &History) -> Result<()> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let bytes = match extension.as_str() {
        "png" | "jpg" | "jpeg" => {
            let found = format!("the name of a .{extension} file");
            Err(Refusal::new(found, "wanted .exr or .tif, the formats written"))
        }
        "tif" | "tiff" => steps(history).and_then(|steps| guarded(|| tiff::write(pixels, steps))),
        _ => steps(history).and_then(|steps| guarded(|| light_field::write(pixels, steps))),
    };
    let bytes = bytes.map_err(|refusal| refusal.about(io::output_name(path)))?;
    io::save(path, |out| out.write_all(&bytes))
}

/// Number of pixels that [`save`] clips in a TIFF: those that do not round to 0..=65535, NaN among them.
pub fn outside_u16(pixels: &Array2<f32>) -> u64 {
    pixels.iter().filter(|value| !(0.0..=65535.0).contains(&value.round())).count() as u64
}

/// The history as JSON; None if it is empty.
fn steps(history: &History) -> std::result::Result<Option<String>, Refusal> {
    if history.is_empty() { Ok(None) } else { serde_json::to_string(history).map(Some).map_err(damaged) }
}
