//! `white` and `dark`: images without particles.

use super::images::{rendered, save_image};
use super::{arguments::SceneSource, setup::Setup};
use lf_core::{Result, Session, io};
use lf_synth::rays;
use ndarray::Array2;
use std::path::Path;

/// Numbers of the images for their noise, beyond those of frames.
const WHITE: usize = 1 << 30;
const DARK: usize = 2 << 30;

/// Renders the white image.
pub fn white(source: &SceneSource, output: &Path, session: &mut Session) -> Result<()> {
    let mut setup = Setup::open(source, session)?;
    setup.keep_apart(output, session)?;
    io::check_place(output)?;
    let (seed, white) = (setup.scene.seed, setup.scene.white.clone());
    if let Some(f_number) = white.working_f_number {
        setup.camera.main_lens.working_f_number = f_number;
    }
    // The renderer counts the rows of the sensor and three on either side.
    let rows = (setup.camera.sensor.height as f64 / setup.camera.pitch_px() + 6.0).ceil() as u64;
    let (instrument, camera) = (setup.instrument(), &setup.camera);
    let mut image = rendered("white", ("rows", rows), session, |done| {
        rays::white(&instrument, camera, white.counts, white.rays_per_lenslet, seed, done)
    })?;
    session.count("rays", image.rays);
    setup.record(&mut image.pixels, WHITE, session)?;
    save_image(output, &image.pixels, session)
}

/// Renders the dark image.
pub fn dark(source: &SceneSource, output: &Path, session: &mut Session) -> Result<()> {
    let mut setup = Setup::open(source, session)?;
    setup.keep_apart(output, session)?;
    if setup.scene.sensor_noise.is_none() {
        session.warn("the scene has no 'sensor_noise': the dark image is black");
    }
    // The lens is covered, so there is no background light.
    setup.background = None;
    let mut pixels = Array2::zeros((setup.camera.sensor.height, setup.camera.sensor.width));
    setup.record(&mut pixels, DARK, session)?;
    save_image(output, &pixels, session)
}
