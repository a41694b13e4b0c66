//! `dots`: images of a target, and its table.

use super::arguments::{ImageFormat, SceneSource};
use super::images::{check_folder, create_folder, rendered, save_image, save_text};
use super::setup::Setup;
use lf_core::{Error, Result, Session, io};
use lf_synth::particles::table;
use lf_synth::rays;
use std::path::Path;

/// Number of the first image for its noise, beyond those of frames, white and dark images.
const DOTS: usize = 3 << 30;

/// Renders a target of dots at each of its depths.
pub fn render(source: &SceneSource, folder: &Path, format: ImageFormat, session: &mut Session) -> Result<()> {
    check_folder(folder)?;
    let setup = Setup::open(source, session)?;
    let Some(dots) = &setup.scene.dots else {
        let found = "has no key 'dots'";
        return Err(Error::new(io::name(&source.scene), found, "wanted one, as `lf-synth scene target` has it"));
    };
    let names: Vec<String> = (0..dots.depths_mm.len()).map(|n| format!("dots-{n:04}.{}", format.extension())).collect();
    for name in names.iter().map(String::as_str).chain(["dots.csv", "camera.json", "scene-used.json"]) {
        setup.keep_apart(&folder.join(name), session)?;
    }
    let half_view = setup.camera.half_view_mm();
    let targets: Vec<_> = dots.depths_mm.iter().map(|depth| dots.target(half_view, *depth)).collect();
    create_folder(folder)?;
    let instrument = setup.instrument();
    let glow = dots.glow(setup.scene.rays(dots.intensity));
    for (n, (target, name)) in targets.iter().zip(&names).enumerate() {
        let seed = setup.scene.seed ^ ((n as u64) << 32);
        let mut image = rendered(&format!("depth {n}"), ("dots", target.len() as u64), session, |done| {
            rays::frame(&instrument, target, &glow, seed, done)
        })?;
        setup.record(&mut image.pixels, DOTS + n, session)?;
        save_image(&folder.join(name), &image.pixels, session)?;
    }
    session.phase("write", |_| {
        save_text(&folder.join("dots.csv"), &table::to_csv(&targets))?;
        save_text(&folder.join("camera.json"), &setup.camera.to_json())?;
        save_text(&folder.join("scene-used.json"), &setup.used())
    })?;
    session.count("dots", targets.first().map_or(0, Vec::len));
    session.count("depths", targets.len());
    Ok(())
}
