//! Files that several tasks read and write: frames, and a camera with its history and its flat field.

use lf_core::image::{self, Channel, FrameFiles, Stack};
use lf_core::{Camera, Error, History, Result, Session, io};
use ndarray::Array2;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Adds this run to the steps that led to the nominal camera.
pub fn with_history(mut camera: Camera, session: &Session) -> Camera {
    if let Some(Value::Object(calibration)) = &mut camera.calibration {
        let before = calibration.remove("history").and_then(|steps| serde_json::from_value::<History>(steps).ok());
        let history = session.history(&before.unwrap_or_default());
        if !history.is_empty() {
            calibration.insert("history".to_string(), json!(history));
        }
    }
    camera
}

/// The path by which a camera at `output` names a file: its name if it is beside the camera, otherwise its full path.
pub fn path_from_camera(file: &Path, output: &Path, session: &Session) -> Result<PathBuf> {
    let whole = |path: &Path| std::path::absolute(path).map_err(|error| io::writing(&io::output_name(path), &error));
    let file = whole(file)?;
    if !io::is_standard(output) && whole(output)?.parent() == file.parent() {
        return Ok(file.file_name().map_or_else(|| file.clone(), PathBuf::from));
    }
    session.say(format!("the camera names its flat field by its full path, {}", file.display()));
    Ok(file)
}

/// Writes a camera that was found from a nominal one. It keeps the flat field, and its history contains this run.
pub fn save_found(
    camera: Camera,
    flat: Option<PathBuf>,
    wanted: &str,
    output: &Path,
    session: &mut Session,
) -> Result<()> {
    let mut camera = with_history(camera, session);
    camera.vignetting = flat.map(|flat| path_from_camera(&flat, output, session)).transpose()?;
    camera.check().map_err(|refusal| Error::new("the camera found", refusal.found, wanted))?;
    session.phase("write", |_| io::save_text(output, |out| out.write_all(camera.to_json().as_bytes())))
}

/// Frames of a camera's size, minus a background, divided by the camera's flat field. Blind and masked pixels are NaN.
pub fn frames<'a>(
    paths: impl IntoIterator<Item = &'a PathBuf>,
    files: FrameFiles,
    camera: &Camera,
    camera_file: &Path,
    channel: Option<Channel>,
) -> Result<Vec<Array2<f32>>> {
    let frame = |path| image::open_frame(path, files, camera, camera_file, channel);
    paths.into_iter().map(|path| Ok(frame(path)?.pixels.into_owned())).collect()
}

/// The size that all images of a run have: that of the first.
#[derive(Default)]
pub struct Sizes {
    first: Option<[usize; 2]>,
}

impl Sizes {
    /// Checks the sizes by the headers, before a pixel is decoded. Leaves out pipes, which can be read only once.
    pub fn of<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> Result<Self> {
        let mut sizes = Self::default();
        for file in files.into_iter().filter(|file| io::split_page(file).0.is_file()) {
            sizes.check(file, Stack::open(file)?.size_px(0)?)?;
        }
        Ok(sizes)
    }

    /// Refuses another size than that of the first image.
    pub fn check(&mut self, file: &Path, size: [usize; 2]) -> Result<()> {
        let first = *self.first.get_or_insert(size);
        if size == first {
            return Ok(());
        }
        let [found, wanted] = [size, first].map(|[width, height]| format!("{width} x {height} px"));
        Err(Error::new(io::name(file), format!("image of {found}"), format!("wanted {wanted} like the first")))
    }

    /// Width and height, px, if an image has been read.
    pub fn first(&self) -> Option<[usize; 2]> {
        self.first
    }
}

/// A file in `folder` for each frame: its name, and its page if it is one of several, as EXR. Refuses two of one name.
/// Page numbers have as many digits as the largest, so that names sort as the pages do.
pub fn named_in<'a>(folder: &Path, frames: impl IntoIterator<Item = &'a PathBuf>) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Err(Error::new(io::output_name(folder), "no such folder", "wanted an existing folder for the frames"));
    }
    let frames: Vec<&PathBuf> = frames.into_iter().collect();
    let largest = frames.iter().filter_map(|file| io::split_page(file).1).max().unwrap_or(0);
    let digits = largest.to_string().len();
    let mut known = BTreeSet::new();
    let unique = |file: &PathBuf| {
        let (path, page) = io::split_page(file);
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let page = page.map(|page| format!("-{page:0digits$}")).unwrap_or_default();
        let place = folder.join(format!("{stem}{page}.exr"));
        if known.insert(place.clone()) {
            return Ok(place);
        }
        Err(Error::new(io::name(file), format!("a second frame for {}", place.display()), "wanted different names"))
    };
    frames.into_iter().map(unique).collect()
}
