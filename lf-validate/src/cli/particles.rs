//! `particles`: particles that were found, against the true ones.

use super::inputs::{open_particles, pixel_mm};
use super::limits::{is_at_most, number, share, verdict};
use super::output::print;
use lf_core::cli::numbers;
use lf_core::{Error, Particle, Result, Session, Verdict, io, particles};
use lf_validate::scores::particles::particles as score;
use lf_validate::scores::slabs::slabs;
use std::path::{Path, PathBuf};

/// Recall, ghosts and errors of particles, and their stated uncertainties
///
/// A found particle matches a true one that is at most --box away along each axis, or three of its
/// own standard uncertainties if that is more. The nearest two match first; no particle matches twice.
///
///   recall        share of the true particles that are found
///   ghosts        share of the found particles that match no true one
///   gain          median light of a found particle over the true one's
///   rms, bias, median_abs, p90
///                 of the errors found - true along x, y and z, in mm and, with --camera, in px of
///                 the focal plane; p90: nine in ten are at most this
///   rms_stated    RMS of the stated standard uncertainties
///   within_1, within_2
///                 shares of the errors within one and two stated standard uncertainties; 0.683 and
///                 0.954 for normal errors if the stated uncertainty is right
///   rms_intensity RMS of the relative error of the light, after the gain
///   by_depth      the same between the distances --depths from the focal plane
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, in out/ after scripts/demo:
  lf-validate particles scene/particles.csv fitted-0000.csv -c camera.json
  lf-validate particles scene/particles.csv fitted-0001.csv --frame 1 -c camera.json --min-recall 0.97"
)]
pub struct ParticlesArguments {
    /// The true particles (particles.csv)
    truth: PathBuf,
    /// The particles that were found: one frame, with or without uncertainties
    #[arg(default_value = "-")]
    found: PathBuf,
    /// Frame of the true particles
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: usize,
    /// Camera, for numbers in pixels
    #[arg(short, long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// A match may be this far away along each axis, or farther by its uncertainty: pixels with --camera, else mm
    /// [default: 1.5,1.5,1.5 with --camera, else uncertainties alone]
    #[arg(long = "box", value_name = "X,Y,Z", value_parser = numbers::<3>)]
    least: Option<[f64; 3]>,
    /// Only particles with their place, true or found, in this box, mm
    #[arg(long, value_name = "X0,X1,Y0,Y1,Z0,Z1", allow_hyphen_values = true, value_parser = numbers::<6>)]
    bounds: Option<[f64; 6]>,
    /// Distances from the focal plane between which particles are scored apart, rising, mm [default:
    /// 0,0.15,0.3,0.5,1,2,3,4,5 and on to the farthest; of a microscope a tenth or a hundredth]
    #[arg(long, value_name = "Z,Z,...", value_delimiter = ',', value_parser = number)]
    depths: Option<Vec<f64>>,
    /// Exit code 1 when the recall is below this
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = share)]
    min_recall: Option<f64>,
    /// Exit code 1 when the share of ghosts is above this
    #[arg(long, help_heading = "Limits", value_name = "SHARE", value_parser = share)]
    max_ghosts: Option<f64>,
    /// Exit code 1 when the RMS error along x, y or z is above this, px; needs --camera
    #[arg(long, help_heading = "Limits", value_name = "X,Y,Z", value_parser = numbers::<3>, requires = "camera")]
    max_rms: Option<[f64; 3]>,
}

/// The usual `--depths`.
const USUAL_DEPTHS: [f64; 9] = [0.0, 0.15, 0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0];

/// Scores the particles of one frame.
pub fn judge(arguments: &ParticlesArguments, session: &mut Session) -> Result<Verdict> {
    let files: Vec<&Path> =
        [&arguments.truth, &arguments.found].into_iter().chain(&arguments.camera).map(PathBuf::as_path).collect();
    session.keep_apart(Path::new("-"), &files)?;
    let (truth, found, pixel_mm) = session.phase("read", |session| {
        let truth = bounded(open_particles(&arguments.truth, arguments.frame, session)?, arguments.bounds);
        Ok((truth, found(arguments, session)?, pixel_mm(arguments.camera.as_deref())?))
    })?;
    let unit_mm = pixel_mm.unwrap_or(1.0);
    let least = arguments.least.unwrap_or([if pixel_mm.is_some() { 1.5 } else { 0.0 }; 3]);
    if let Some(wrong) = least.iter().find(|side| **side < 0.0) {
        return Err(Error::new("--box", format!("{wrong}"), "wanted lengths of 0 or more"));
    }
    if least == [0.0; 3] && found.iter().all(|particle| particle.uncertainty.is_none()) {
        let wanted = "wanted --camera or --box, because these particles state no uncertainty";
        return Err(Error::new(io::name(&arguments.found), "no length within which particles match", wanted));
    }
    let box_mm = least.map(|side| side * unit_mm);
    let depths =
        slabs(arguments.depths.as_deref(), &USUAL_DEPTHS, &truth).map_err(|refusal| refusal.about("--depths"))?;
    let score = session.phase("score", |_| Ok(score(&truth, &found, box_mm, &depths, pixel_mm)))?;
    let [of_truth, of_found, both] = score.all.counts;
    for (name, count) in [("truth", of_truth), ("found", of_found), ("matched", both)] {
        session.count(name, count);
    }
    if both == 0 && of_truth > 0 && of_found > 0 {
        session.warn("no particle matches a true one: check --frame, --box, and the axes and units of both tables");
    }
    print(&score)?;
    let recall = score.all.recall();
    let has_recall = arguments.min_recall.is_none_or(|least| recall.is_some_and(|recall| recall >= least));
    let rms_px = |axis: usize| score.all.rms_mm(axis).map(|rms| rms / unit_mm);
    let is_near = (0..3).all(|axis| is_at_most(rms_px(axis), arguments.max_rms.map(|limits| limits[axis])));
    Ok(verdict(has_recall && is_near && is_at_most(score.all.ghosts(), arguments.max_ghosts)))
}

fn found(arguments: &ParticlesArguments, session: &Session) -> Result<Vec<Particle>> {
    let all = particles::open(&arguments.found, session)?;
    if let Some(other) = all.iter().find(|particle| particle.frame != all[0].frame) {
        let found = format!("particles of frames {} and {}", all[0].frame, other.frame);
        return Err(Error::new(io::name(&arguments.found), found, "wanted the particles of one frame"));
    }
    Ok(bounded(all, arguments.bounds))
}

fn bounded(mut particles: Vec<Particle>, bounds: Option<[f64; 6]>) -> Vec<Particle> {
    if let Some(bounds) = bounds {
        let is_in = |axis: usize, place: f64| (bounds[2 * axis]..=bounds[2 * axis + 1]).contains(&place);
        particles.retain(|particle| (0..3).all(|axis| is_in(axis, particle.place_mm[axis])));
    }
    particles
}
