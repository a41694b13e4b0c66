//! `score`: a result of a case of the benchmark, against the case's truth.

use super::inputs::{open_truth, text};
use super::output::{Picture, print};
use lf_core::{Camera, Error, Field, Result, Session, Verdict, io};
use lf_validate::scores::{benchmark, displacement::displacement, particles::particles as score_particles};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// A result of a case of the benchmark against the case's truth
///
/// CASE is a folder that scripts/benchmark/make has made; its truth is in CASE/truth. RESULT is a
/// folder with any of
///
///   particles.csv  particles of all frames, as `lf-validate particles` scores them
///   tracks.csv     particles of all frames; a particle keeps its id from frame to frame
///   field.exr, .nc the displacement from a frame to the next, as `lf-validate displacement` scores it
///   cost.json      seconds and peak_bytes, which are printed as they are
///
/// A particle matches a true one of its frame within 1.5 px along x and y and 15 px along z, or three
/// of its own standard uncertainties if that is more; a step of a track is right if both its ends
/// are within that box of the ends of a true step. Beside the numbers of those subcommands there are
///
///   over_bound_x   errors over the Cramer-Rao bound of CASE/truth/bound.json at their depth, by
///                  medians: 1.4826 times the median of |error| / bound; also y, z
///   tracks         recall and ghosts of steps, and errors of their middles x, y, z and
///                  displacements u, v, w
///   resolution_mm  effective resolution of a field: the side of the cube over which the mean of the
///                  true flow is nearest to the field; null for a flow without structure
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples, after scripts/benchmark/make wave-0.2-square-low and a run of the method particles:
  lf-validate score report/wave-0.2-square-low results-report/particles/wave-0.2-square-low
  lf-validate score report/wave-0.2-square-low my-results > score.json"
)]
pub struct ScoreArguments {
    /// Folder of the case
    case: PathBuf,
    /// Folder of the result
    result: PathBuf,
}

/// Half of the box of a match, pixels at the focal plane.
const BOX_PX: [f64; 3] = [1.5, 1.5, 15.0];
/// Distances from the focal plane between which particles are scored apart, mm.
const DEPTHS_MM: [f64; 6] = [0.0, 0.5, 1.0, 2.0, 3.0, 4.0];

/// Scores the files of a result.
pub fn judge(arguments: &ScoreArguments, session: &mut Session) -> Result<Verdict> {
    let truth = |name: &str| arguments.case.join("truth").join(name);
    let result = |name: &str| Some(arguments.result.join(name)).filter(|file| file.exists());
    let field = ["field.exr", "field.nc"].into_iter().find_map(result);
    let [particles, tracks, cost] = ["particles.csv", "tracks.csv", "cost.json"].map(result);
    if [&particles, &tracks, &field].iter().all(|file| file.is_none()) {
        let wanted = "wanted a folder with particles.csv, tracks.csv or field.exr";
        return Err(Error::new(io::name(&arguments.result), "no result", wanted));
    }
    let pixel_mm = Camera::open(&truth("camera.json"))?.pixel_in_focus_mm();
    let box_mm = BOX_PX.map(|side| side * pixel_mm);
    let open = |file: &Path, session: &Session| lf_core::particles::open(file, session);
    let mut scores = Map::new();
    scores.insert("case".to_owned(), json!(io::name(&arguments.case)));
    if particles.is_some() || tracks.is_some() {
        let known = session.phase("read", |session| open(&truth("particles.csv"), session))?;
        if let Some(file) = &particles {
            let (known, found) = (benchmark::apart(&known), benchmark::apart(&open(file, session)?));
            let bound: benchmark::Bound = by_depth(&truth("bound.json"))?;
            let mut score = value(&score_particles(&known, &found, box_mm, &DEPTHS_MM, Some(pixel_mm)));
            for (axis, ratio) in ["x", "y", "z"].iter().zip(benchmark::over_bound(&known, &found, box_mm, &bound)) {
                score[format!("over_bound_{axis}")] = json!(ratio);
            }
            scores.insert("particles".to_owned(), score);
        }
        if let Some(file) = &tracks {
            let score = benchmark::tracks(&known, &open(file, session)?, box_mm, pixel_mm);
            scores.insert("tracks".to_owned(), value(&score));
        }
    }
    if let Some(file) = &field {
        let known = open_truth(&truth("scene.json"), None, &Picture::default(), session)?;
        let found = session.phase("read", |_| Field::open(file))?;
        let mut score = session.phase("score", |_| Ok(value(&displacement(&known, &found, Some(pixel_mm)))))?;
        score["resolution_mm"] = json!(session.phase("resolve", |_| Ok(benchmark::resolution_mm(&known, &found)))?);
        scores.insert("field".to_owned(), score);
    }
    if let Some(Value::Object(cost)) = cost.map(|file| json_of(&file)).transpose()? {
        scores.extend(cost);
    }
    print(&scores)?;
    Ok(Verdict::Done)
}

fn value(score: &impl Serialize) -> Value {
    serde_json::to_value(score).unwrap_or_default()
}

fn json_of(file: &Path) -> Result<Value> {
    let (bytes, name) = (io::open(file)?, io::name(file));
    let wrong = |error: serde_json::Error| Error::new(&name, format!("not JSON ({error})"), "wanted JSON");
    serde_json::from_str(text(&bytes, &name, "wanted JSON")?).map_err(wrong)
}

/// The bound by depth, from what `lf-validate precision` prints.
fn by_depth(file: &Path) -> Result<benchmark::Bound> {
    let wrong = |error: serde_json::Error| Error::new(io::name(file), error.to_string(), "wanted the bound's by_depth");
    serde_json::from_value(json_of(file)?["by_depth"].take()).map_err(wrong)
}
