//! The 26 neighbours of a vector.

use glam::DVec3;

/// Calls `visit(neighbour, step)` for each of the up to 26 neighbours of `node` in a field of `shape`. A step is -1, 0
/// or 1 along each axis.
pub(crate) fn each(shape: [usize; 3], node: usize, mut visit: impl FnMut(usize, DVec3)) {
    let [nx, ny, nz] = shape.map(|n| n as i32);
    let (x, y, z) = (node as i32 % nx, node as i32 / nx % ny, node as i32 / nx / ny);
    for dz in (-z).max(-1)..=(nz - 1 - z).min(1) {
        for dy in (-y).max(-1)..=(ny - 1 - y).min(1) {
            for dx in (-x).max(-1)..=(nx - 1 - x).min(1) {
                if (dx, dy, dz) != (0, 0, 0) {
                    let neighbour = x + dx + nx * (y + dy + ny * (z + dz));
                    visit(neighbour as usize, DVec3::new(dx as f64, dy as f64, dz as f64));
                }
            }
        }
    }
}
