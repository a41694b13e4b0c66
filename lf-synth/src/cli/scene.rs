//! `scene`: prints or lists ready scenes.

use super::images::save_text;
use lf_core::{Error, Result};
use lf_synth::Scene;
use lf_synth::scene::ready::{self, READY};
use std::path::Path;

/// Prints a ready scene with keys set, or a list of all.
pub fn print(name: Option<&str>, set: &[String]) -> Result<()> {
    let text = match name {
        Some(name) => changed(name, set)?,
        None => READY.iter().map(|ready| format!("{:16}{}\n", ready.name, ready.about)).collect(),
    };
    save_text(Path::new("-"), &text)
}

/// The text of a ready scene with keys set.
fn changed(name: &str, set: &[String]) -> Result<String> {
    let names = || READY.map(|ready| ready.name).join(", ");
    let no_scene = || Error::new(name, "not a ready scene", format!("wanted one of {}", names()));
    let mut scene = ready::scene(name).ok_or_else(no_scene)?;
    for assignment in set {
        ready::set(&mut scene, assignment).map_err(|refusal| refusal.about("--set"))?;
    }
    serde_json::from_value::<Scene>(scene.clone())
        .map_err(|error| Error::new("--set", error.to_string(), "wanted keys and values that a scene.json has"))?;
    Ok(format!("{}\n", serde_json::to_string_pretty(&scene).expect("a scene is plain data")))
}
