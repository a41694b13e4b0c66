//! Volumes drawn from particles, where no volumes are given.

use lf_core::particles::draw;
use lf_core::statistics::median;
use lf_core::{Error, Grid, History, JoinedVolume, Particle, Result};

/// Voxels in the usual distance between particles, and the width of the drawn ones, voxels.
const VOXELS: f64 = 4.0;
const SIGMA_VOX: f64 = 0.7;

/// A voxel is at least this many standard uncertainties of a place long.
const UNCERTAINTIES: f64 = 1.5;

/// Voxels around the outermost particles, and the longest side that can be drawn.
const MARGIN: f64 = 4.0;
const LONGEST: f64 = 1e5;

/// A volume for each table, all of one grid. Every particle has the same light, because only places are to be found.
pub fn volumes(tables: &[Vec<Particle>], names: &[String], histories: &[History]) -> Result<Vec<JoinedVolume>> {
    let refused = |found: String| Error::new(names.join(" and "), found, "wanted more particles, or their volumes");
    let grid = grid(tables).ok_or_else(|| refused("particles too few or too far apart to be drawn".to_owned()))?;
    let drawn = tables.iter().zip(names).zip(histories).map(|((table, name), history)| {
        let (indices, values) = draw(&grid, [SIGMA_VOX; 3], table.len(), |n| (table[n].place_mm, 1.0));
        JoinedVolume::new(name.clone(), grid.clone(), history.clone(), indices, values)
    });
    Ok(drawn.collect())
}

/// The grid around all tables. None where particles lie in one plane, or so far apart that the grid would be huge.
fn grid(tables: &[Vec<Particle>]) -> Option<Grid> {
    let all = || tables.iter().flatten();
    let low = [0, 1, 2].map(|axis| all().map(|particle| particle.place_mm[axis]).fold(f64::INFINITY, f64::min));
    let high = [0, 1, 2].map(|axis| all().map(|particle| particle.place_mm[axis]).fold(f64::NEG_INFINITY, f64::max));
    let sides_mm = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let fewest = tables.iter().map(Vec::len).min()? as f64;
    let apart_mm = (sides_mm.iter().product::<f64>() / fewest).cbrt();
    let spacing_mm = [0, 1, 2].map(|axis| {
        let stds = all().filter_map(|particle| particle.uncertainty).map(|uncertainty| uncertainty.std_mm()[axis]);
        let usual = median(&mut stds.collect::<Vec<f64>>());
        (apart_mm / VOXELS).max(if usual.is_nan() { 0.0 } else { UNCERTAINTIES * usual })
    });
    let counts = [0, 1, 2].map(|axis| (sides_mm[axis] / spacing_mm[axis]).ceil() + 2.0 * MARGIN);
    let is_drawn = apart_mm > 0.0 && counts.iter().all(|count| *count < LONGEST);
    let origin_mm = [0, 1, 2].map(|axis| low[axis] - MARGIN * spacing_mm[axis]);
    is_drawn.then(|| Grid { shape: counts.map(|count| count as usize), spacing_mm, origin_mm })
}
