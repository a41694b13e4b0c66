//! What each task reads and writes.

mod background;
mod lattice;
mod refine;
mod volume;

pub use background::background;
pub use lattice::Lattice;
pub use refine::drift;
pub use volume::{Target, main_lens};

use lf_core::camera::Camera;
use lf_core::cli::Session;
use lf_core::history::History;
use lf_core::{Error, Result, image, io};
use ndarray::Array2;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// This run after the steps that led to the nominal camera.
fn with_history(mut camera: Camera, session: &Session) -> Camera {
    if let Some(Value::Object(calibration)) = &mut camera.calibration {
        let before = calibration.remove("history").and_then(|steps| serde_json::from_value::<History>(steps).ok());
        let history = session.history(&before.unwrap_or_default());
        if !history.is_empty() {
            calibration.insert("history".to_string(), json!(history));
        }
    }
    camera
}

/// A file as the camera that is written to `output` must name it: by its name beside the camera, otherwise by its full path.
fn seen_from(file: &Path, output: &Path, session: &Session) -> Result<PathBuf> {
    let whole = |path: &Path| std::path::absolute(path).map_err(|error| io::writing(&io::output_name(path), &error));
    let file = whole(file)?;
    if !io::is_standard(output) && whole(output)?.parent() == file.parent() {
        return Ok(file.file_name().map_or_else(|| file.clone(), PathBuf::from));
    }
    session.say(format!("the camera names its flat field by its full path, {}", file.display()));
    Ok(file)
}

/// Writes a camera found from a nominal one, whose flat field it keeps, with this run in its history.
fn save_found(camera: Camera, flat: Option<PathBuf>, wanted: &str, output: &Path, session: &mut Session) -> Result<()> {
    let mut camera = with_history(camera, session);
    camera.vignetting = flat.map(|flat| seen_from(&flat, output, session)).transpose()?;
    camera.check().map_err(|refusal| Error::new("the camera found", refusal.found, wanted))?;
    session.phase("write", |_| io::save_text(output, |out| out.write_all(camera.to_json().as_bytes())))
}

/// Frames of a camera's size, less a background, by its flat field; blind pixels are NaN and are passed over.
fn frames<'a>(
    paths: impl IntoIterator<Item = &'a PathBuf>,
    background: Option<&Path>,
    camera: &Camera,
    camera_file: &Path,
) -> Result<Vec<Array2<f32>>> {
    paths.into_iter().map(|path| Ok(image::open_frame(path, background, camera, camera_file)?.pixels)).collect()
}
