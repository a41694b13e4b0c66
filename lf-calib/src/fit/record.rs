//! The `calibration` block of a camera: each task writes its own key and keeps the others.

use lf_core::Camera;
use serde_json::{Value, json};

/// Writes `found` as `calibration.<task>`. A `calibration` that is no JSON object is replaced.
pub(crate) fn record(camera: &mut Camera, task: &str, found: Value) {
    let calibration = camera.calibration.get_or_insert_with(|| json!({}));
    if !calibration.is_object() {
        *calibration = json!({});
    }
    calibration[task] = found;
}
