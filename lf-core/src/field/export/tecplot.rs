//! A field as Tecplot ASCII data (`.dat`): one ordered zone of points, x fastest.
//!
//! The format has no NaN. A number that does not exist is -1 where no other number can be negative (uncertainties,
//! count), and 0 for a displacement without data; `flag` tells which vectors these are.

use super::{parts, vti::Array};
use crate::field::vectors::{Field, NO_DATA};
use crate::{frame::MARK, history};
use std::io::{Result, Write};

/// Names and units of the columns after the places.
const COLUMNS: [&str; 10] =
    ["u [mm]", "v [mm]", "w [mm]", "peak", "ratio", "su [mm]", "sv [mm]", "sw [mm]", "flag", "count"];
const VELOCITIES: [&str; 3] = ["u [mm/s]", "v [mm/s]", "w [mm/s]"];

pub(in crate::field) fn write_tecplot(field: &Field, more: &[Array], out: &mut dyn Write) -> Result<()> {
    let layout = &field.layout;
    writeln!(out, "TITLE = \"displacement, light-field PIV\"")?;
    let velocities = VELOCITIES.iter().filter(|_| layout.dt_s.is_some());
    let more = parts::all(more);
    let names = ["x [mm]", "y [mm]", "z [mm]"].iter().chain(&COLUMNS).chain(velocities).copied();
    let names = names.chain(more.iter().map(|(name, _)| name.as_str()));
    let names: Vec<String> = names.map(|name| format!("\"{name}\"")).collect();
    writeln!(out, "VARIABLES = {}", names.join(", "))?;
    writeln!(out, "DATASETAUXDATA frame = \"{MARK}\"")?;
    writeln!(out, "DATASETAUXDATA flag = \"0 measured, 1 replaced, 2 no data; -1: not known\"")?;
    if let Some(dt_s) = layout.dt_s {
        writeln!(out, "DATASETAUXDATA dt_s = \"{dt_s}\"")?;
    }
    for (n, line) in history::lines(&layout.history).iter().enumerate() {
        writeln!(out, "DATASETAUXDATA history_{} = \"{}\"", n + 1, line.replace('\\', "/").replace('"', "'"))?;
    }
    let [nx, ny, nz] = layout.shape;
    writeln!(out, "ZONE T = \"field\", I = {nx}, J = {ny}, K = {nz}, DATAPACKING = POINT")?;
    let components = field.components();
    for i in 0..field.len() {
        let [x, y, z] = field.place_mm(i);
        write!(out, "{x} {y} {z}")?;
        let is_known = field.flag[i] != NO_DATA;
        for (n, values) in components.iter().enumerate() {
            let missing = if n < 3 { 0.0 } else { -1.0 };
            let value = values[i];
            write!(out, " {}", if value.is_finite() && (n >= 3 || is_known) { value } else { missing })?;
        }
        let velocity = field.velocity_mm_s(i).into_iter().flatten();
        velocity.map(|value| if is_known { value } else { 0.0 }).try_for_each(|value| write!(out, " {value}"))?;
        let finite = |value: f32| if value.is_finite() { value } else { 0.0 };
        more.iter().try_for_each(|(_, values)| write!(out, " {}", finite(values[i])))?;
        writeln!(out)?;
    }
    Ok(())
}
