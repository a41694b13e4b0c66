//! `displacement`: a vector field against the true displacement.

use super::limits::{are_at_most, components, counts, is_at_most, share, verdict};
use super::{
    inputs::{open_truth, pixel_mm},
    output::{Picture, print},
};
use lf_core::{Field, Result, Session, Verdict, io};
use lf_validate::pictures;
use lf_validate::scores::displacement::{Displacement, ParticleCounts, displacement};
use std::path::PathBuf;

/// Error of a vector field, component by component, and its stated uncertainty
///
/// error = measured - true. The truth is one of
///   a field         interpolated to the places of the measured vectors
///   scene.json      its steady flow is known everywhere: displacement from frame 0 to frame 1
///   particles.csv   its particles move from frame A to frame B; the measured field is interpolated
///                   to the middle of each path: structures below a window are part of the error
///
/// Numbers, for u, v and w, in mm, in vox (the voxels correlated) and, with --camera, in px of the
/// focal plane
///   bias, rms, std, median_abs, p90
///                   mean, RMS, standard deviation and median of the absolute value of the errors;
///                   nine in ten absolute values are at most p90
///   vectors         vectors that are scored; with a particles.csv, particles
///   outliers        vectors more than 5 robust standard deviations and 0.1 voxel from the median
///                   error; all other numbers include them
///   measured_only   the same without replaced vectors
///   interpolation_mm
///                   RMS error of interpolation in a true field, estimated: a part of the errors.
///                   A warning says so where it is large
///   pdf             density of each component's error: `u`, per `unit`, in bins about `x_u`, with the
///                   shares beyond, below_u and above_u. Bins of 0.05 px up to 4 px for u and v, of
///                   0.5 px up to 40 px for w; without a camera of 0.05 vox up to 4 vox
///
/// uncertainty, of measured vectors that state one
///   stated          number of these vectors
///   within_1, _2    shares of their errors within one and two stated standard uncertainties;
///                   0.683 and 0.954 for normal errors if the stated uncertainty is right
///   rms_stated      RMS of the stated uncertainty, mm
///   rms_error       RMS of these errors, mm
///
/// Counted, but not scored
///   no_data         places without data
///   outside_truth   vectors outside the truth
///   outside_field   particles outside the field or beside vectors without data
///   unpaired        particles in only one of the frames
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate displacement scene/scene.json field-0000-0001.exr -c camera.json --max-rms 0.3,0.2,0.5
  lf-validate displacement scene/particles.csv field-0000-0001.exr -c camera.json --plot error.svg"
)]
pub struct DisplacementArguments {
    /// The true displacement: a field, in any layout, a scene.json with a steady flow, or a particles.csv
    truth: PathBuf,
    /// The field to score
    #[arg(default_value = "-")]
    field: PathBuf,
    /// Camera, for numbers in pixels
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// The two frames of a particles.csv that the field was measured from [default: 0,1]
    #[arg(long, value_name = "A,B", value_parser = counts::<2>)]
    frames: Option<[usize; 2]>,
    #[command(flatten)]
    picture: Picture,
    /// Exit code 1 when an RMS error is above PX pixels: one number, or three for u,v,w
    #[arg(long, help_heading = "Limits", value_name = "PX", value_parser = components, requires = "camera")]
    max_rms: Option<[f64; 3]>,
    /// Exit code 1 when a bias is above PX pixels in absolute value: one number, or three for u,v,w
    #[arg(long, help_heading = "Limits", value_name = "PX", value_parser = components, requires = "camera")]
    max_bias: Option<[f64; 3]>,
    /// Exit code 1 when more than this share of the vectors are outliers, 0 to 1
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = share)]
    max_outliers: Option<f64>,
    /// Exit code 1 when within_1 of a component is below this share, 0 to 1
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = share)]
    min_coverage: Option<f64>,
}

/// Scores a field against the true displacement.
pub fn judge(arguments: &DisplacementArguments, session: &mut Session) -> Result<Verdict> {
    let inputs = [&arguments.truth, &arguments.field];
    arguments.picture.check(inputs.into_iter().chain(&arguments.camera), session)?;
    let (truth, field, pixel_mm) = session.phase("read", |session| {
        let pixel_mm = pixel_mm(arguments.camera.as_deref())?;
        let truth = open_truth(&arguments.truth, arguments.frames, &arguments.picture, session)?;
        Ok((truth, Field::open(&arguments.field)?, pixel_mm))
    })?;
    session.explain(match pixel_mm {
        None => "numbers are in mm and voxels; numbers in pixels need --camera".to_string(),
        Some(pixel_mm) => format!("a pixel at the focal plane is {pixel_mm:.6} mm"),
    });
    let score = session.phase("score", |_| Ok(displacement(&truth, &field, pixel_mm)))?;
    session.count("vectors", score.all.vectors);
    arguments.picture.draw(session, || pictures::displacement(&score))?;
    print(&score)?;
    if score.all.vectors == 0 {
        let name = io::name(&arguments.field);
        session.warn(format!("{name}: no vector could be scored: {}", reasons(&score)));
    }
    if let Some(errors_mm) = score.of_coarse_truth_mm() {
        let (per_mm, unit) = pixel_mm.map_or((1.0, "mm"), |pixel_mm| (pixel_mm.recip(), "px"));
        let [u, v, w] = errors_mm.map(|error| per_mm * error);
        let found =
            format!("interpolation between its vectors errs by {u:.2}, {v:.2}, {w:.2} {unit} or more for u, v, w");
        let name = io::name(&arguments.truth);
        session.warn(format!("{name}: {found}, a large part of the scored errors; a scene.json is exact"));
    }
    Ok(verdict(
        are_at_most(score.all.rms_px(), arguments.max_rms)
            && are_at_most(score.all.bias_px().map(|bias| bias.map(f64::abs)), arguments.max_bias)
            && is_at_most(Some(score.all.outlier_share()), arguments.max_outliers)
            && arguments
                .min_coverage
                .is_none_or(|least| score.uncertainty.within_1.iter().all(|share| *share >= least)),
    ))
}

/// Why no vector could be scored.
fn reasons(score: &Displacement) -> String {
    let Displacement { places, no_data, outside_truth, .. } = score;
    match score.particles {
        Some(ParticleCounts { particles, outside_field, .. }) => {
            format!("of {particles} particles, {outside_field} outside the field")
        }
        None => format!("of {places}, {no_data} without data, {outside_truth} outside the truth"),
    }
}
