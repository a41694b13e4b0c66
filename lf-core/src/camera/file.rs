//! `camera.json` from and to text, and what belongs to its file.

use super::model::Camera;
use crate::{Error, Refusal, Result, io};
use std::path::{Path, PathBuf};

const WANTED: &str = "wanted a camera.json";

impl Camera {
    /// Reads and checks a camera file; `-` is standard input.
    pub fn open(path: &Path) -> Result<Self> {
        let text = io::open_text(path).map_err(|error| match error.found.ends_with("no text") {
            true => Error { wanted: WANTED.to_string(), ..error },
            false => error,
        })?;
        Self::from_json(&text).map_err(|refusal| refusal.about(io::name(path)))
    }

    /// Reads and checks a camera.
    pub fn from_json(text: &str) -> std::result::Result<Self, Refusal> {
        let value: serde_json::Value =
            serde_json::from_str(text).map_err(|error| Refusal::new(format!("not JSON ({error})"), WANTED))?;
        let camera: Self = serde_json::from_value(value).map_err(|error| Refusal::new(error.to_string(), WANTED))?;
        camera.check().map(|()| camera)
    }

    /// The camera as indented JSON with a final line end.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a camera is plain data") + "\n"
    }

    /// Path of the flat-field image of a camera that was read from `file`: `vignetting`, relative to the file's folder.
    pub fn flat_field(&self, file: &Path) -> Option<PathBuf> {
        self.vignetting.as_ref().map(|flat| file.parent().unwrap_or(Path::new("")).join(flat))
    }

    /// Checks that an image is as large as the sensor. `name` is its name in the message.
    pub fn check_image(&self, name: &str, width: usize, height: usize) -> Result<()> {
        let wanted = format!("wanted the camera's {} x {} px", self.sensor.width, self.sensor.height);
        let fits = (width, height) == (self.sensor.width, self.sensor.height);
        Refusal::unless(fits, || format!("image of {width} x {height} px"), wanted)
            .map_err(|refusal| refusal.about(name))
    }
}
