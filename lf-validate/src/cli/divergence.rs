//! `divergence`: a vector field without the truth.

use super::limits::{are_at_most, components, is_at_most, number, verdict};
use super::{
    inputs::pixel_mm,
    output::{Picture, print},
};
use lf_core::{Field, Result, Session, Verdict, io};
use lf_validate::pictures;
use lf_validate::scores::divergence::divergence;
use std::path::PathBuf;

/// Divergence and noise of a vector field, without the truth
///
/// Differences are taken over as many vectors as a window covers, rounded up (stride, stride_mm), so
/// that the two vectors share no data. Errors that they share nevertheless stay hidden.
///
/// Divergence, without unit: change of volume over volume between the two volumes
///   count         places with data at all six neighbours a stride away
///   mean, rms, median_abs
///                 of du/dx + dv/dy + dw/dz by central differences
///   sigma         its robust standard deviation
///   rms_gradient  RMS of all nine gradients
///   relative      rms over the RMS of sqrt((du/dx)^2 + (dv/dy)^2 + (dw/dz)^2): 0 if the flow keeps
///                 its volume, 1 for noise, and also 1 for a flow of rotation and shear alone
///   rms_of_noise  RMS divergence that the noise alone would give
///   pdf           density in bins of a fifth of sigma up to 8 sigma, with their middles in
///                 x_divergence, and the shares below and above
///
/// noise, for u, v and w, in mm, in vox and, with --camera, in px
///   sigma         standard deviation, from the median absolute deviation of third differences, which
///                 remove a flow up to its second derivative; the smallest of the axes with at least
///                 100 differences
///   axis, differences
///                 that axis, and its number of differences
///   stated        median uncertainty that measured vectors state
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate divergence field-0000-0001.exr -c camera.json
  lf-xcorr volume-0000.lfv volume-0001.lfv --window 80,80,8 | lf-validate divergence --plot div.svg"
)]
pub struct DivergenceArguments {
    /// The field to score
    #[arg(default_value = "-")]
    field: PathBuf,
    /// Camera, for numbers in pixels
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when the RMS divergence is above RMS
    #[arg(long, help_heading = "Limits", value_name = "RMS", value_parser = number)]
    max_divergence: Option<f64>,
    /// Exit code 1 when a component's noise is above PX pixels: one number, or three for u,v,w
    #[arg(long, help_heading = "Limits", value_name = "PX", value_parser = components, requires = "camera")]
    max_noise: Option<[f64; 3]>,
}

/// Scores a field without its truth.
pub fn judge(arguments: &DivergenceArguments, session: &mut Session) -> Result<Verdict> {
    arguments.picture.check([&arguments.field].into_iter().chain(&arguments.camera), session)?;
    let (field, pixel_mm) = session.phase("read", |_| {
        let pixel_mm = pixel_mm(arguments.camera.as_deref())?;
        Ok((Field::open(&arguments.field)?, pixel_mm))
    })?;
    let score = session.phase("score", |_| Ok(divergence(&field, pixel_mm)))?;
    session.count("places", score.count);
    arguments.picture.draw(session, || pictures::divergence(&score))?;
    print(&score)?;
    if score.count == 0 {
        let [x, y, z] = score.stride;
        session.warn(format!(
            "{}: no place has data at its six neighbours {x}, {y} and {z} vectors away",
            io::name(&arguments.field)
        ));
    }
    Ok(verdict(
        is_at_most(Some(score.rms), arguments.max_divergence) && are_at_most(score.noise.px(), arguments.max_noise),
    ))
}
