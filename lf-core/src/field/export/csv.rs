//! A field as text for spreadsheets.

use super::{parts, vti::Array};
use crate::field::vectors::Field;
use std::io::{Result, Write};

/// A header line with units, then one vector a line, x fastest. Every number reads back to the same bits.
pub(in crate::field) fn write_csv(field: &Field, more: &[Array], out: &mut dyn Write) -> Result<()> {
    write!(out, "x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,peak,ratio,su_mm,sv_mm,sw_mm,flag,count")?;
    write!(out, "{}", if field.layout.dt_s.is_some() { ",u_mm_s,v_mm_s,w_mm_s" } else { "" })?;
    let more = parts::all(more);
    more.iter().try_for_each(|(name, _)| write!(out, ",{name}"))?;
    writeln!(out)?;
    let components = field.components();
    for i in 0..field.len() {
        let [x, y, z] = field.place_mm(i);
        write!(out, "{x},{y},{z}")?;
        let velocity = field.velocity_mm_s(i);
        for value in components.iter().map(|component| component[i]).chain(velocity.into_iter().flatten()) {
            write!(out, ",{value}")?;
        }
        more.iter().try_for_each(|(_, values)| write!(out, ",{}", values[i]))?;
        writeln!(out)?;
    }
    Ok(())
}
