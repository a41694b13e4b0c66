//! A field as text: a header line with units, then one vector a line, x fastest. Every number reads back to the same
//! bits. `peak`, `ratio`, `flag` and `count` have no unit. Velocities are written if the time between the volumes is
//! known.

use super::vectors::Field;
use std::io::{Result, Write};

pub(super) fn write(field: &Field, out: &mut dyn Write) -> Result<()> {
    write!(out, "x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,peak,ratio,su_mm,sv_mm,sw_mm,flag,count")?;
    writeln!(out, "{}", if field.layout.dt_s.is_some() { ",u_mm_s,v_mm_s,w_mm_s" } else { "" })?;
    let components = field.components();
    for i in 0..field.len() {
        let [x, y, z] = field.place_mm(i);
        write!(out, "{x},{y},{z}")?;
        let velocity = field.velocity_mm_s(i);
        for value in components.iter().map(|component| component[i]).chain(velocity.into_iter().flatten()) {
            write!(out, ",{value}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
