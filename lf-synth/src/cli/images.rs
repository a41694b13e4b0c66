//! Images and texts that are written.

use lf_core::{Error, Result, Session, image, io};
use lf_synth::rays::Rendered;
use ndarray::Array2;
use std::path::Path;
use std::time::Instant;

/// Refuses a file as an output folder.
pub fn check_folder(folder: &Path) -> Result<()> {
    if folder.is_dir() || !folder.exists() {
        return Ok(());
    }
    Err(Error::new(io::output_name(folder), "a file", "wanted a folder to write into"))
}

/// The file that is written last: a folder that holds it is whole.
pub const LAST_FILE: &str = "scene-used.json";

/// Creates the folder of a series. In an old one, removes the camera and the [`LAST_FILE`] of the run before, so that a
/// run that ends half-way leaves no folder that looks whole, and warns of images of a run before that `names`, those of
/// this run, do not replace.
pub fn begin_folder(folder: &Path, names: &[String], session: &mut Session) -> Result<()> {
    let failed = |path: &Path, error: &std::io::Error| io::writing(&io::output_name(path), error);
    std::fs::create_dir_all(folder).map_err(|error| failed(folder, &error))?;
    for path in [LAST_FILE, "camera.json"].map(|name| folder.join(name)) {
        if path.symlink_metadata().is_ok_and(|found| found.is_file()) {
            std::fs::remove_file(&path).map_err(|error| failed(&path, &error))?;
        }
    }
    let entries = std::fs::read_dir(folder).map_err(|error| failed(folder, &error))?;
    let found = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let is_ours = |name: &String| {
        let number = ["frame-", "truth-", "dots-"].iter().find_map(|start| name.strip_prefix(start));
        name == "flow.exr" || number.is_some_and(|rest| rest.starts_with(|first: char| first.is_ascii_digit()))
    };
    let mut old: Vec<String> = found.filter(|name| is_ours(name) && !names.contains(name)).collect();
    old.sort();
    if let Some(first) = old.first() {
        let others = if old.len() > 1 { format!(" and {} more", old.len() - 1) } else { String::new() };
        let name = io::output_name(&folder.join(first));
        session.warn(format!("{name}{others}: of another run; remove it or take a new folder"));
    }
    Ok(())
}

pub fn save_text(path: &Path, text: &str) -> Result<()> {
    io::save_text(path, |out| out.write_all(text.as_bytes()))
}

/// Writes an image. A TIFF cuts counts outside 16 bits, with a warning.
pub fn save_image(path: &Path, pixels: &Array2<f32>, session: &mut Session) -> Result<()> {
    let is_tiff = path.extension().is_some_and(|end| ["tif", "tiff"].iter().any(|tiff| end.eq_ignore_ascii_case(tiff)));
    let cut = if is_tiff { image::outside_u16(pixels) } else { 0 };
    if cut > 0 {
        session.warn(format!("{}: {cut} pixels outside 0 to 65535 are cut", io::output_name(path)));
    }
    session.phase("write", |session| image::save(path, pixels, &session.history(&Vec::new())))
}

/// Renders an image and says how much light arrived and how fast the rays were. `total` is the number of steps of the
/// progress bar `steps`; `render` gets a function that counts them.
pub fn rendered(
    what: &str,
    (steps, total): (&str, u64),
    session: &mut Session,
    render: impl FnOnce(&(dyn Fn(u64) + Sync)) -> Rendered,
) -> Result<Rendered> {
    session.phase("render", |session| {
        let progress = session.progress(steps, total);
        let started = Instant::now();
        let image = render(&|n| progress.add(n));
        session.explain(format!(
            "{what}: {:.2} % of the light reached the sensor; {:.1} million rays, {:.0} million a second",
            100.0 * image.arrived / image.emitted.max(f64::MIN_POSITIVE),
            1e-6 * image.rays as f64,
            1e-6 * image.rays as f64 / started.elapsed().as_secs_f64().max(1e-9),
        ));
        Ok(image)
    })
}
