//! `white`, `dark` and `dots`: the images of a calibration.

use super::arguments::{ImageArguments, ImageFormat, SceneSource};
use super::images::{LAST_FILE, begin_folder, check_folder, rendered, save_image, save_text};
use super::setup::Setup;
use lf_core::{Error, Result, Session, io};
use lf_synth::rays::{self, WhiteCells};
use lf_synth::{memory, particles::table};
use ndarray::Array2;
use std::path::Path;

/// Numbers of the images for their noise, beyond those of frames.
const WHITE: usize = 1 << 30;
const DARK: usize = 2 << 30;
const DOTS: usize = 3 << 30;

pub fn white(ImageArguments { source, output }: &ImageArguments, session: &mut Session) -> Result<()> {
    let mut setup = Setup::open(source, session)?;
    setup.keep_apart(output, session)?;
    io::check_place(output)?;
    let (seed, white) = (setup.scene.seed, setup.scene.white.clone());
    if let Some(f_number) = white.working_f_number {
        setup.camera.main_lens.working_f_number = f_number;
    }
    let cells = WhiteCells::new(&setup.camera, white.counts, white.rays_per_lenslet);
    let (instrument, rows) = (setup.instrument(), cells.rows as u64);
    let bytes = memory::white(&instrument, &cells, setup.scene.sensor_noise.as_ref());
    setup.allow_memory(
        bytes,
        || format!("{} with {} rays a lenslet", setup.sensor(), white.rays_per_lenslet),
        session,
    )?;
    let mut image = rendered("white", ("rows", rows), session, |done| rays::white(&instrument, &cells, seed, done))?;
    session.count("rays", image.rays);
    setup.record("the white image", &mut image.pixels, WHITE, session)?;
    save_image(output, &image.pixels, session)
}

pub fn dark(ImageArguments { source, output }: &ImageArguments, session: &mut Session) -> Result<()> {
    let mut setup = Setup::open(source, session)?;
    setup.keep_apart(output, session)?;
    if setup.scene.sensor_noise.is_none() {
        session.warn("the scene has no 'sensor_noise': the dark image is black");
    }
    // The lens is covered, so there is no background light.
    setup.background = None;
    let bytes = memory::dark(&setup.instrument(), setup.scene.sensor_noise.as_ref());
    setup.allow_memory(bytes, || setup.sensor(), session)?;
    let mut pixels = Array2::zeros((setup.camera.sensor.height, setup.camera.sensor.width));
    setup.record("the dark image", &mut pixels, DARK, session)?;
    save_image(output, &pixels, session)
}

/// Renders a target of dots at each of its depths.
pub fn dots(source: &SceneSource, folder: &Path, format: ImageFormat, session: &mut Session) -> Result<()> {
    check_folder(folder)?;
    let setup = Setup::open(source, session)?;
    let Some(dots) = &setup.scene.dots else {
        let found = "has no key 'dots'";
        return Err(Error::new(&setup.name, found, "wanted one, as `lf-synth scene target` has it"));
    };
    let names: Vec<String> = (0..dots.depths_mm.len()).map(|n| format!("dots-{n:04}.{}", format.extension())).collect();
    for name in names.iter().map(String::as_str).chain(["dots.csv", "camera.json", LAST_FILE]) {
        setup.keep_apart(&folder.join(name), session)?;
    }
    let half_view = setup.camera.half_view_mm();
    let targets: Vec<_> = dots.depths_mm.iter().map(|depth| dots.target(half_view, *depth)).collect();
    let instrument = setup.instrument();
    let glow = dots.glow(setup.scene.rays(dots.intensity));
    let most = targets.iter().max_by_key(|target| target.len()).map_or(&[][..], Vec::as_slice);
    let bytes = memory::frames(&instrument, most, &glow, targets.len(), setup.scene.sensor_noise.as_ref(), None);
    setup.allow_memory(bytes, || format!("{} and {} dots", setup.sensor(), most.len()), session)?;
    begin_folder(folder, &names, session)?;
    for (n, (target, name)) in targets.iter().zip(&names).enumerate() {
        let seed = setup.scene.seed ^ ((n as u64) << 32);
        let mut image = rendered(&format!("depth {n}"), ("dots", target.len() as u64), session, |done| {
            rays::frame(&instrument, target, &glow, seed, done)
        })?;
        setup.record(&format!("image {n} of the target"), &mut image.pixels, DOTS + n, session)?;
        save_image(&folder.join(name), &image.pixels, session)?;
    }
    session.phase("write", |_| {
        save_text(&folder.join("dots.csv"), &table::to_csv(&targets))?;
        setup.save(folder)
    })?;
    session.count("dots", targets.first().map_or(0, Vec::len));
    session.count("depths", targets.len());
    Ok(())
}
