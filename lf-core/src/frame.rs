//! The object frame: the one place that knows on which side of the picture X is, and the frame's mark in files.
//!
//! X points right and Y up in the picture as it is stored, Z points towards the camera. [`crate::optics`] derives the
//! rays from this.
//!
//! # The mark
//!
//! lf 0.1.0 had X to the left of the picture: a left-handed frame, and no mark in its files. Files of the two frames
//! must not be mixed, because one is the mirror image of the other. So files say which frame their places are in:
//!
//! | file | mark | without the mark |
//! | --- | --- | --- |
//! | `.lfv` | key `frame` of the header | refused |
//! | vector field, EXR | key `frame` of `lf:field` | refused |
//! | vector field, `.vti` | a comment | not read by the tools |
//! | vector field, `.csv` | none, so that spreadsheets read it | not read by the tools |
//! | `particles.csv`, `dots.csv` | a line `# frame: right-handed` before the header | read, with a warning |
//! | `scene.json` | key `frame` | rendered as it stands; refused as the truth of a field |
//! | `camera.json` | key `frame` | read: no number in it depends on the frame |
//!
//! The value is `right-handed` everywhere. Any other value is refused. To bring a table or a scene of lf 0.1.0 into
//! this frame, change the sign of every x and of every displacement along x.

use crate::Refusal;
use glam::DVec2;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The key of the mark.
pub const KEY: &str = "frame";
/// The value of the mark.
pub const MARK: &str = "right-handed";

/// The frame of a file, as its key `frame`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Frame {
    /// X right and Y up in the picture, Z towards the camera.
    #[default]
    #[serde(rename = "right-handed")]
    RightHanded,
}

/// A place or a displacement in the object along the sensor's axes: (-X, Y). The lens inverts both of these, so columns
/// rise with X and rows fall with Y. The map is its own inverse.
#[inline(always)]
pub fn sensor_axes(object_mm: DVec2) -> DVec2 {
    DVec2::new(-object_mm.x, object_mm.y)
}

/// Whether columns (axis 0) or rows (axis 1) of the picture fall as the object's x or y rises. Those of y do.
pub fn runs_back(axis: usize) -> bool {
    sensor_axes(DVec2::ONE)[axis] > 0.0
}

/// Checks the mark among the keys of a header. Refuses a header without it and another value.
pub(crate) fn check(header: &Map<String, Value>) -> Result<(), Refusal> {
    let wanted = format!("wanted \"{KEY}\": \"{MARK}\"; make the file again from the images");
    match header.get(KEY) {
        Some(value) if value == MARK => Ok(()),
        Some(value) => Err(Refusal::new(format!("its header has the frame {value}"), wanted)),
        None => Err(Refusal::new("its header names no frame: lf 0.1.0 wrote it, with x to the left", wanted)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_header_needs_the_mark() {
        let found = |value: Value| check(value.as_object().unwrap()).map_err(|refusal| refusal.found);
        assert_eq!(found(json!({"frame": "right-handed"})), Ok(()));
        assert_eq!(serde_json::to_value(Frame::default()).unwrap(), MARK);
        assert!(found(json!({})).unwrap_err().contains("names no frame"));
        assert!(found(json!({"frame": "left"})).unwrap_err().contains("\"left\""));
    }

    #[test]
    fn columns_rise_with_x_and_rows_fall_with_y() {
        assert_eq!([0, 1].map(runs_back), [false, true]);
        let place = DVec2::new(2.0, 3.0);
        assert_eq!(sensor_axes(sensor_axes(place)), place);
    }
}
