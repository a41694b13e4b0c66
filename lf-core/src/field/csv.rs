//! A field as text: a header line with units, then one vector a line, x fastest. Every number reads back to the same bits.

use super::Field;
use std::io::{Result, Write};

pub(super) fn write(field: &Field, out: &mut dyn Write) -> Result<()> {
    writeln!(out, "x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,peak,ratio,su_mm,sv_mm,sw_mm,flag")?;
    let components = field.components();
    for i in 0..field.len() {
        let [x, y, z] = field.place_mm(i);
        write!(out, "{x},{y},{z}")?;
        for component in components {
            write!(out, ",{}", component[i])?;
        }
        writeln!(out)?;
    }
    Ok(())
}
