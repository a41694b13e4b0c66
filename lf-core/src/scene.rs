//! The keys of a `scene.json` that more than one tool reads: `camera`, `volume` and `frames`.
//!
//! | key | content |
//! | --- | --- |
//! | `camera` | a camera as in [`crate::camera`], or the path of its file, from the scene's folder: [`CameraSource`] |
//! | `volume` | `{"x_mm", "y_mm", "z_mm"}`, each `[low, high]` in the frame of [`crate::optics`]: [`LitVolume`] |
//! | `frames` | a number of frames, or the list of their times; 2 if absent: [`Frames`] |
//! | `flow` | the motion of the particles: [`crate::flow`] |
//! | `frame` | `right-handed`: [`mod@crate::frame`]. A scene without it is rendered, but is not taken as a truth |
//!
//! lf-synth reads the other keys.

use crate::{Error, Refusal, Result, camera::Camera};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The end of messages about a file that is not a scene.
pub const WANTED: &str = "wanted a scene.json as `lf-synth scene` prints them";

/// A camera inside the scene, or the path of its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum CameraSource {
    /// Path of a camera file.
    Path(PathBuf),
    /// The camera itself.
    Camera(serde_json::Value),
}

impl CameraSource {
    /// The camera's file for a scene in `folder`; None if the camera is inside the scene.
    pub fn file(&self, folder: &Path) -> Option<PathBuf> {
        if let Self::Path(file) = self { Some(folder.join(file)) } else { None }
    }

    /// Reads the camera of a scene in `folder`; `scene` stands for the scene in messages.
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
pub struct LitVolume {
    /// Low and high bound along x.
    pub x_mm: [f64; 2],
    /// Low and high bound along y.
    pub y_mm: [f64; 2],
    /// Low and high bound along z.
    pub z_mm: [f64; 2],
}

impl LitVolume {
    /// Bounds along x, y, z, mm.
    pub fn bounds_mm(&self) -> [[f64; 2]; 3] {
        [self.x_mm, self.y_mm, self.z_mm]
    }

    /// Checks that every pair is finite and rises.
    pub fn check(&self) -> std::result::Result<(), Refusal> {
        ["x_mm", "y_mm", "z_mm"].iter().zip(self.bounds_mm()).try_for_each(|(name, [low, high])| {
            let rises = low.is_finite() && high.is_finite() && low < high;
            Refusal::unless(rises, || format!("volume.{name} [{low}, {high}] does not rise"), "wanted [low, high]")
        })
    }
}

/// Times of the frames. The flow moves by its displacement in a unit of time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Frames {
    /// Number of frames, at 0, 1, 2 ...
    Count(usize),
    /// Rising times.
    Times(Vec<f64>),
}

impl Default for Frames {
    fn default() -> Self {
        Self::Count(2)
    }
}

impl Frames {
    /// The times of all frames.
    pub fn times(&self) -> Vec<f64> {
        match self {
            Self::Count(count) => (0..*count).map(|n| n as f64).collect(),
            Self::Times(times) => times.clone(),
        }
    }

    /// Time from the first frame to the second; 1 if there is one frame.
    pub fn interval(&self) -> f64 {
        let times = self.times();
        times.get(1).map_or(1.0, |second| second - times[0])
    }

    /// Checks that there are 1 to 10000 frames, at rising times within 1e6.
    pub fn check(&self) -> std::result::Result<(), Refusal> {
        let (count, times) = match self {
            Self::Count(count) => (*count, &[][..]),
            Self::Times(times) => (times.len(), times.as_slice()),
        };
        Refusal::unless((1..=10_000).contains(&count), || format!("frames asks for {count}"), "wanted 1 to 10000")?;
        let rise = times.iter().all(|time| time.abs() < 1e6) && times.is_sorted_by(|a, b| a < b);
        Refusal::unless(rise, || "frames has times that do not rise or are beyond 1e6", "wanted rising times")
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
