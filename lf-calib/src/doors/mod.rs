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
use lf_core::{Error, Result};
use serde_json::{Value, json};
use std::path::Path;

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

/// Standard input can be read once.
fn check_inputs(inputs: &[&Path]) -> Result<()> {
    if inputs.iter().filter(|path| **path == Path::new("-")).count() > 1 {
        return Err(Error::new("standard input", "named more than once", "wanted - for one input only"));
    }
    Ok(())
}
