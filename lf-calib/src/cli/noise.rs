//! `lf-calib noise`: white and dark images and a camera in, the camera with the noise of its sensor out.

use super::{arguments::NoiseArguments, files::save_found};
use lf_calib::{PhotonTransfer, photon_transfer};
use lf_core::{Camera, Result, Session, Verdict, camera::SensorNoise, image, io};
use ndarray::Array2;
use std::path::{Path, PathBuf};

/// Warn if a level's variance is off the line by more than this share of it.
const NOTABLE_DEPARTURE: f64 = 0.25;

pub fn noise(arguments: &NoiseArguments, session: &mut Session) -> Result<Verdict> {
    let NoiseArguments { whites, dark, camera, reading, output } = arguments;
    let inputs: Vec<&Path> = whites.iter().chain(dark).chain([camera]).map(PathBuf::as_path).collect();
    session.keep_apart(output, &inputs)?;
    io::check_place(output)?;
    let mut found = Camera::open(camera)?;
    let read = |files: &[PathBuf]| -> Result<Vec<Array2<f32>>> {
        let one = |path: &PathBuf| {
            let image = image::open_counts(path, reading.channel)?.pixels;
            found.check_image(&io::name(path), image.ncols(), image.nrows()).map(|()| image)
        };
        image::frames(files).iter().map(one).collect()
    };
    let [whites, darks] = session.phase("read", |_| Ok([read(whites)?, read(dark)?]))?;
    let PhotonTransfer { noise, uncertainty, departure } = session.phase("noise", |_| {
        photon_transfer(&whites, &darks).map_err(|refusal| refusal.about("the white and dark images"))
    })?;
    let SensorNoise { gain_counts, read_noise_counts } = noise;
    session.explain(format!(
        "gain {gain_counts:.4} +- {:.4} counts for an electron, read noise {read_noise_counts:.3} +- {:.3} counts",
        uncertainty.gain_counts, uncertainty.read_noise_counts
    ));
    if departure > NOTABLE_DEPARTURE {
        session.warn(format!(
            "the variance is up to {:.0} % off a line: the sensor is not linear, pixels are clipped, or the light changed \
             between the images",
            100.0 * departure
        ));
    }
    found.sensor_noise = Some(noise);
    let flat = found.flat_field(camera);
    save_found(found, flat, "wanted a noise above 0", output, session)?;
    Ok(Verdict::Done)
}
