//! `lf-calib refine`: what frames of particles say of their camera in, the corrected camera out.

use super::{arguments::RefineArguments, files::save_found};
use lf_calib::Refined;
use lf_core::camera::{EXPLAINED, Evidence};
use lf_core::{Camera, Error, Refusal, Result, Session, Verdict, io};
use std::path::Path;

/// Frames of one camera differ from it by less than this times what they state.
const ALIKE: f64 = 2.0;

pub fn refine(arguments: &RefineArguments, session: &mut Session) -> Result<Verdict> {
    let RefineArguments { camera, evidence, output, .. } = arguments;
    let inputs: Vec<&Path> = evidence.iter().chain([camera]).map(|path| path.as_path()).collect();
    session.keep_apart(output, &inputs)?;
    io::check_place(output)?;
    let given = Camera::open(camera)?;
    session.explain(format!("camera: {}", given.about()));
    let frames = session
        .phase("read", |_| evidence.iter().map(|file| open(file, &given, camera)).collect::<Result<Vec<Evidence>>>())?;
    let subject = |refusal: Refusal| refusal.about(format!("{} frames", frames.len()));
    let found = session.phase("refine", |_| lf_calib::refine(&given, &frames).map_err(subject))?;
    report(&found, &frames, session);
    save_found(found.camera, given.flat_field(camera), "wanted particles that fit one", output, session)?;
    Ok(Verdict::Done)
}

/// The evidence of one frame, which must be about the given camera.
fn open(file: &Path, given: &Camera, camera: &Path) -> Result<Evidence> {
    let evidence = Evidence::open(file)?;
    let is_given = evidence.is_about(given).map_err(|refusal| refusal.about(io::name(camera)))?;
    let other = || Error::new(io::name(file), "of another camera", format!("wanted lf-fit -c {}", camera.display()));
    if is_given { Ok(evidence) } else { Err(other()) }
}

fn report(found: &Refined, frames: &[Evidence], session: &mut Session) {
    session.count("frames", frames.len());
    session.count("particles", found.particles);
    session.count("scatter", found.scatter);
    for one in &found.corrected {
        session.say(format!("the {}", one.words()));
        session.count(one.parameter.key, vec![one.step, one.std]);
        one.doubt().into_iter().for_each(|doubt| session.warn(doubt));
    }
    if found.corrected.is_empty() {
        session.say("the particles show no error of the camera that refine knows");
    }
    for (n, one) in found.corrected.iter().enumerate() {
        for (other, correlation) in found.corrected.iter().zip(&found.correlations[n]).take(n) {
            session
                .explain(format!("correlation of {} and {}: {correlation:.2}", one.parameter.key, other.parameter.key));
        }
    }
    for (frame, [x, y], [std_x, std_y]) in &found.drifts {
        session.explain(format!("frame {frame}: drift ({x:.4} +- {std_x:.4}, {y:.4} +- {std_y:.4}) px"));
    }
    if found.scatter > ALIKE {
        session.warn(format!(
            "the frames differ from one camera by {:.1} times what they state, and uncertainties are as much larger: the \
             camera moved between them, or its model is wrong; -v prints the drift of each",
            found.scatter
        ));
    }
    let worst = frames.iter().max_by(|a, b| a.chi2.total_cmp(&b.chi2)).filter(|frame| frame.chi2 > EXPLAINED);
    if let Some(frame) = worst {
        let what = if found.corrected.is_empty() {
            "check the background, the blur and what the data sheets say of the camera"
        } else {
            "fit again with the refined camera and refine that"
        };
        session.warn(format!(
            "noise does not explain frame {}: chi2 is {:.2}, up to {EXPLAINED} is good; {what}",
            frame.frame, frame.chi2
        ));
    }
}
