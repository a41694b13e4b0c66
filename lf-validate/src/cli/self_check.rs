//! `self`: fits to parts of a real frame against each other, and against pixels that they did not see.

use super::limits::{is_at_most, number, verdict};
use super::output::print;
use super::split::NoiseOptions;
use lf_core::cli::ImageOptions;
use lf_core::image::{self, FrameFiles};
use lf_core::{Camera, Error, Result, Session, Verdict, io, particles};
use lf_validate::scores::self_check::{Agreement, HeldOut, agreement, held_out, self_check};
use lf_validate::scores::slabs::slabs;
use std::path::{Path, PathBuf};

/// A fit checked on its own frame, without a truth
///
/// Two tables of lf-fit, of the two parts that `lf-validate split` makes of a frame by noise or by
/// pupil, must agree within their stated uncertainties. With --expected, an image by a fit to one
/// part of the pixels must predict the others.
///
///   verdict      one sentence
///   factor       the largest factor by which stated uncertainties are too small
///   held_out     chi2 of the held-out pixels with light, and of the others: mean squared difference
///                over the variance by noise; 1 where the fit explains them. Squares count up to 25
///   a, b, pairs  particles in each table, and in both
///   alone        share of the particles without a partner
///   rms, stated  RMS difference along x, y and z over the root of 2, and the RMS that the tables
///                state, px
///   within_1     share of the differences within one stated standard uncertainty; 0.683 is right
///   factor_z     the factor on the stated uncertainties that makes this share 0.683
///   shift_z      median difference, px
///   by_depth     the same between the distances --depths from the focal plane
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, after lf-validate split --by pupil and two fits; --by pixels and one fit:
  lf-validate self a.csv b.csv -c camera.json
  lf-validate self -i scene/frame-0000.exr -c b.json --expected a-expected.exr --gain 1 --read-noise 3"
)]
pub struct SelfArguments {
    /// Particles of the two parts (particles.csv); none, or two
    #[arg(value_name = "PARTICLES", num_args = 0..=2)]
    tables: Vec<PathBuf>,
    /// Camera (camera.json); with --expected, the one that sees the held-out pixels alone
    #[arg(short, long, value_name = "FILE")]
    camera: PathBuf,
    /// Image that a fit expects (lf-fit --expected)
    #[arg(long, value_name = "FILE", requires = "image")]
    expected: Option<PathBuf>,
    /// The frame whose pixels were held out
    #[arg(short, long, value_name = "FILE", requires = "expected")]
    image: Option<PathBuf>,
    /// Background of the frame
    #[arg(short, long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Mask of the frame, as lf-fit took it
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    noise: NoiseOptions,
    /// Distances from the focal plane between which particles are compared apart, rising, mm [default:
    /// 0,0.5,1,2,3,4,5 and on to the farthest; of a microscope a tenth or a hundredth]
    #[arg(long, value_name = "Z,Z,...", value_delimiter = ',', value_parser = number)]
    depths: Option<Vec<f64>>,
    #[command(flatten)]
    reading: ImageOptions,
    /// Exit code 1 when stated uncertainties are too small by more than this
    #[arg(long, help_heading = "Limits", value_name = "FACTOR", value_parser = number)]
    max_factor: Option<f64>,
    /// Exit code 1 when chi2 of the held-out pixels is above this
    #[arg(long, help_heading = "Limits", value_name = "CHI2", value_parser = number, requires = "expected")]
    max_chi2: Option<f64>,
}

/// A pair is apart by this at most across the axis, pixels at the focal plane. Along it, by the depth that the camera
/// resolves.
const ASIDE_PX: f64 = 1.5;
/// The usual `--depths`.
const USUAL_DEPTHS: [f64; 7] = [0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0];

/// Compares, and prints the checks.
pub fn judge(arguments: &SelfArguments, session: &mut Session) -> Result<Verdict> {
    let SelfArguments { tables, camera: file, expected, image, background, mask, .. } = arguments;
    let inputs: Vec<&Path> = tables
        .iter()
        .chain([file])
        .chain([expected, image, background, mask].into_iter().flatten())
        .map(PathBuf::as_path)
        .collect();
    session.keep_apart(Path::new("-"), &inputs)?;
    if tables.len() == 1 || (tables.is_empty() && expected.is_none()) {
        let wanted = "wanted the tables of two parts, or --expected";
        return Err(Error::new("self", format!("{} tables of particles", tables.len()), wanted));
    }
    let camera = Camera::open(file)?;
    let held_out = predicted(arguments, &camera, session)?;
    let agreement = compared(arguments, &camera, session)?;
    let check = self_check(agreement, held_out);
    print(&check)?;
    let chi2 = check.held_out.map(|held_out| held_out.chi2);
    Ok(verdict(is_at_most(check.factor, arguments.max_factor) && is_at_most(chi2, arguments.max_chi2)))
}

/// chi2 of the pixels that the camera sees.
fn predicted(arguments: &SelfArguments, camera: &Camera, session: &mut Session) -> Result<Option<HeldOut>> {
    let (Some(expected), Some(file)) = (&arguments.expected, &arguments.image) else { return Ok(None) };
    let noise = arguments.noise.of(camera, &arguments.camera)?;
    let files = FrameFiles { background: arguments.background.as_deref(), mask: arguments.mask.as_deref() };
    let (seen, light) = session.phase("read", |_| {
        let frame = image::open_signed_frame(file, files, camera, &arguments.camera, arguments.reading.channel)?;
        let light = image::open(expected)?.pixels;
        camera.check_image(&io::name(expected), light.ncols(), light.nrows())?;
        Ok((frame.pixels.into_owned(), light))
    })?;
    held_out(&seen, &light, &noise).map(Some).map_err(|refusal| refusal.about(io::name(file)))
}

/// The agreement of the two tables.
fn compared(arguments: &SelfArguments, camera: &Camera, session: &mut Session) -> Result<Option<Agreement>> {
    let [one, other] = arguments.tables.as_slice() else { return Ok(None) };
    let [a, b] = [particles::open(one, session)?, particles::open(other, session)?];
    let box_px = [ASIDE_PX, ASIDE_PX, camera.depth_resolution_px()];
    let depths = slabs(arguments.depths.as_deref(), &USUAL_DEPTHS, &a).map_err(|refusal| refusal.about("--depths"))?;
    agreement([&a, &b], box_px, &depths, camera.pixel_in_focus_mm())
        .map(Some)
        .map_err(|(n, refusal)| refusal.about(io::name(&arguments.tables[n])))
}
