//! The keys of a `scene.json` that more than the renderer reads: camera, volume and frames; the flow is in [`crate::flow`].

use crate::camera::Camera;
use crate::{Error, Refusal, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What a message wants where a file is no scene.
pub const WANTED: &str = "wanted a scene.json as `lf-synth scene` prints them";

/// A camera in place or by path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum CameraSource {
    /// Path of a camera file.
    Path(PathBuf),
    /// The camera itself.
    Camera(serde_json::Value),
}

impl CameraSource {
    /// The camera's file, where it has its own, for a scene in `folder`.
    pub fn file(&self, folder: &Path) -> Option<PathBuf> {
        match self {
            Self::Path(file) => Some(folder.join(file)),
            Self::Camera(_) => None,
        }
    }

    /// Reads the camera of the scene in `folder` that messages call `scene`.
    ///
    /// # Errors
    /// Those of [`Camera::open`].
    pub fn open(&self, folder: &Path, scene: &str) -> Result<Camera> {
        match self {
            Self::Path(file) => Camera::open(&folder.join(file)),
            Self::Camera(value) => Camera::from_json(&value.to_string())
                .map_err(|Refusal { found, wanted }| Error::new(scene, format!("camera: {found}"), wanted)),
        }
    }
}

/// Bounds of the lit volume, mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Volume {
    /// Low and high bound along x.
    pub x_mm: [f64; 2],
    /// Low and high bound along y.
    pub y_mm: [f64; 2],
    /// Low and high bound along z.
    pub z_mm: [f64; 2],
}

impl Volume {
    /// The bounds along x, y, z, mm.
    pub fn bounds_mm(&self) -> [[f64; 2]; 3] {
        [self.x_mm, self.y_mm, self.z_mm]
    }

    /// Checks what the types do not.
    ///
    /// # Errors
    /// Names the key.
    pub fn check(&self) -> std::result::Result<(), String> {
        for (name, [low, high]) in ["x_mm", "y_mm", "z_mm"].iter().zip(self.bounds_mm()) {
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(format!("volume.{name} [{low}, {high}] does not rise"));
            }
        }
        Ok(())
    }
}

/// When the frames are taken, in intervals of time between which the flow moves by its displacement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Frames {
    /// So many, at 0, 1, 2 ...
    Count(usize),
    /// At these times, rising.
    Times(Vec<f64>),
}

impl Default for Frames {
    fn default() -> Self {
        Self::Count(2)
    }
}

impl Frames {
    /// The times.
    pub fn times(&self) -> Vec<f64> {
        match self {
            Self::Count(count) => (0..*count).map(|n| n as f64).collect(),
            Self::Times(times) => times.clone(),
        }
    }

    /// Time from the first frame to the second; 1 where there is one.
    pub fn interval(&self) -> f64 {
        let times = self.times();
        times.get(1).map_or(1.0, |second| second - times[0])
    }

    /// Checks what the types do not.
    ///
    /// # Errors
    /// Names the key.
    pub fn check(&self) -> std::result::Result<(), String> {
        let (count, rise) = match self {
            Self::Count(count) => (*count, true),
            Self::Times(times) => {
                (times.len(), times.iter().all(|t| t.abs() < 1e6) && times.windows(2).all(|pair| pair[0] < pair[1]))
            }
        };
        if !(1..=10_000).contains(&count) {
            return Err(format!("frames asks for {count}, outside 1 to 10000"));
        }
        if rise { Ok(()) } else { Err("frames has times that do not rise, or beyond 1e6".to_string()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_from_the_first_frame_to_the_second() {
        let interval = |text: &str| serde_json::from_str::<Frames>(text).unwrap().interval();
        assert_eq!([interval("2"), interval("1"), interval("[0.5]"), interval("[0, 0.25, 2]")], [1.0, 1.0, 1.0, 0.25]);
    }
}
