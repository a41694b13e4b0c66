//! `profile`: lines and planes, written as a table or as JSON.

use super::arguments::ProfileArguments;
use super::treat::open;
use glam::DVec3;
use lf_core::cli::MemoryLimit;
use lf_core::field::Cut;
use lf_core::{Error, Result, Session, io};
use lf_flow::{self as flow, Task};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Writes the line or the plane that is asked for.
pub fn run(arguments: &ProfileArguments, limit: MemoryLimit, session: &mut Session) -> Result<()> {
    let inputs: Vec<&Path> = arguments.fields.iter().map(PathBuf::as_path).collect();
    session.keep_apart(&arguments.output, &inputs)?;
    io::check_place(&arguments.output)?;
    session.count("fields", inputs.len());
    let text = match (arguments.from, arguments.to, arguments.plane) {
        (Some(from), Some(to), None) => line(&inputs, [from, to], arguments.points as usize, limit, session)?,
        (_, _, Some(plane)) => planes(&inputs, plane, limit, session)?,
        _ => return Err(Error::new("profile", "no line and no plane", "wanted --from and --to, or --plane")),
    };
    session.phase("write", |_| io::save_text(&arguments.output, |out| out.write_all(text.as_bytes())))
}

fn line(
    inputs: &[&Path],
    ends: [[f64; 3]; 2],
    points: usize,
    limit: MemoryLimit,
    session: &mut Session,
) -> Result<String> {
    let [from, to] = ends.map(DVec3::from);
    let mut text = String::from("field,distance_mm,x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,su_mm,sv_mm,sw_mm\n");
    for path in inputs {
        let (field, name) = (open(path, Task::Profile { points }, limit, session)?, io::name(path));
        let places = flow::profile(&field, from, to, points);
        if places.iter().all(|place| !place.displacement_mm.is_finite()) {
            let found = "no vectors along the line";
            return Err(Error::new(
                name,
                found,
                "wanted a line between vectors of the field; lf-validate info shows where they are",
            ));
        }
        let quoted = if name.contains([',', '"']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name };
        for place in places {
            let ([x, y, z], [u, v, w]) = (place.place_mm.to_array(), place.displacement_mm.to_array());
            let [su, sv, sw] = place.uncertainty_mm.to_array();
            text += &format!("{quoted},{},{x},{y},{z},{u},{v},{w},{su},{sv},{sw}\n", place.distance_mm);
        }
    }
    Ok(text)
}

fn planes(inputs: &[&Path], plane: Cut, limit: MemoryLimit, session: &mut Session) -> Result<String> {
    let one = |path: &Path, session: &mut Session| {
        let field = open(path, Task::Flux, limit, session)?;
        let flux = flow::flux(&field, plane).map_err(|refusal| refusal.about(io::name(path)))?;
        let mut plane = json!({"field": io::name(path)});
        for (key, value) in json!(flux).as_object().into_iter().flatten() {
            plane[key] = value.clone();
        }
        Ok(plane)
    };
    let planes: Vec<_> = inputs.iter().map(|path| one(path, session)).collect::<Result<_>>()?;
    Ok(format!("{:#}\n", json!({"planes": planes})))
}
