//! The stored voxels of a volume as text.

use super::cutout::Cutout;
use lf_core::{frame::MARK, history};
use std::io::{Result, Write};

/// Writes lines with `#` for frame and history, a header with units, then a voxel a line in rising order. Voxels that
/// are not stored are 0 and left out. Places are rounded to 0.1 nm.
pub fn write_csv(part: &Cutout, name: &str, out: &mut dyn Write) -> Result<()> {
    writeln!(out, "# frame: {MARK}")?;
    history::lines(part.history()).iter().try_for_each(|line| writeln!(out, "# history: {line}"))?;
    writeln!(out, "x_mm,y_mm,z_mm,{name}")?;
    let grid = part.grid();
    part.voxels(|voxel, value| {
        let [x, y, z] = [0, 1, 2].map(|axis| (1e7 * grid.centre_mm(axis, voxel[axis])).round() * 1e-7 + 0.0);
        writeln!(out, "{x:.7},{y:.7},{z:.7},{value}")
    })
}
