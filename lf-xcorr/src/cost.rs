//! What a pass would cost on the direct path and by Fourier transforms.
//!
//! Promise: one look at every lit voxel and a table of cells; where the light is spread evenly, the ratio of the two
//! is within a factor of 2 of what is measured. Departure: every window is taken to be searched about the same shift; the
//! direct path takes longer where neighbours differ, for a cell is summed over all shifts that its windows ask for.

use crate::kernel::lanes_for;
use crate::lattice::{Axis, Lattice};
use crate::sparse::Rows;
use crate::transform::Plan;

/// The light of a pair in the cells of a lattice: what a pass costs is estimated from it. Seconds are of one core.
pub(crate) struct Estimate<'a> {
    light: [Light; 2],
    shape: [usize; 3],
    lattice: &'a Lattice,
}

impl<'a> Estimate<'a> {
    pub fn new(pair: [&Rows; 2], lattice: &'a Lattice) -> Self {
        Self { light: pair.map(|rows| Light::count(rows, lattice)), shape: pair[0].shape, lattice }
    }

    /// By products of lit voxels, shared between windows, every window searched within `radius`.
    pub fn direct_s(&self, radius: [usize; 3]) -> f64 {
        seconds(&direct(&self.light, self.shape, self.lattice, radius), &DIRECT_NS)
    }

    /// By transforms, window after window.
    pub fn transform_s(&self, radius: [usize; 3]) -> f64 {
        seconds(&transform(&self.light, self.lattice, radius), &TRANSFORM_NS)
    }
}

/// What steps taken so often take together.
fn seconds(counts: &[f64], ns: &[f64]) -> f64 {
    counts.iter().zip(ns).map(|(count, ns)| count * ns).sum::<f64>() * 1e-9
}

/// Constant: nanoseconds of a multiplication of the products, a pair of rows, a voxel, a row and shift along x and an
/// addition of the energies, a shift that one set of sums hands to the next, and what is to be added to the last for each
/// doubling of the shifts above 512, as the sums leave the caches. Fitted to `benches/routes.rs` on one core of a Xeon (Sapphire
/// Rapids, AVX2 code) at 0.1 % to 100 % of light, windows of 16 to 64 and radii of 4 to 16: 0.6 to 1.4 of what was measured.
/// Where they are wrong the slower path is taken; vectors are read off direct sums on either.
const DIRECT_NS: [f64; 7] = [0.21, 8.6, 1.0, 44.0, 0.16, 4.8, 1.3];

/// Constant: nanoseconds of an operation of the transforms, a place of a row of the energies, a lit voxel and a shift. As
/// [`DIRECT_NS`].
const TRANSFORM_NS: [f64; 4] = [0.089, 3.1, 0.9, 9.5];

/// How often each step of the direct path is taken, in the order of [`DIRECT_NS`].
fn direct(light: &[Light; 2], shape: [usize; 3], lattice: &Lattice, radius: [usize; 3]) -> [f64; 7] {
    let n = radius.map(|r| 2 * r + 1);
    let r = radius.map(|r| r as f64);
    let [lanes, vectors] = lanes(n[0]);
    let inside: f64 = (0..3).map(|axis| share_inside(shape[axis], radius[axis])).product();
    let mut work = [0.0; 7];
    let [x, y, z] = &lattice.axes;
    let mut place = 0;
    for cz in &z.cells {
        for cy in &y.cells {
            for cx in &x.cells {
                let cell = [cx, cy, cz].map(|range| range.len() as f64);
                let [here, there] = [0, 1].map(|volume| light[volume].at(place, cell));
                place += 1;
                // Products: rows of the first that light may come from, with the rows of the second that they meet.
                let reach = [0, 1, 2].map(|axis| cell[axis] + r[axis]);
                let pairs = inside * (n[1] * n[2]) as f64 * cell[1] * cell[2] * there.rows(reach[0] + 2.0 * r[0]);
                work[0] += pairs * here.density * reach[0] * lanes * vectors;
                work[1] += pairs * here.rows(reach[0]) * vectors;
                // Energies: voxels, rows and planes, each for the shifts whose box holds it.
                let held = [0, 1, 2].map(|axis| n[axis] as f64 * cell[axis] / reach[axis]);
                for light in [here, there] {
                    let rows = light.rows(reach[0]) * reach[1] * reach[2];
                    let planes = light.planes(reach[0] * reach[1]) * reach[2];
                    work[2] += light.density * reach[0] * reach[1] * reach[2] * held[0];
                    work[3] += rows * n[0] as f64;
                    work[4] += n[0] as f64 * (rows * held[1] + planes * n[1] as f64 * held[2]);
                }
            }
        }
    }
    // Sharing: cells into columns, columns into rows, rows into windows.
    let span = |axis: &Axis| axis.spans.iter().map(|span| span.len()).sum::<usize>();
    let columns = x.cells.len() * y.cells.len() * span(z);
    let rows = x.cells.len() * span(y) * z.count();
    let windows = span(x) * y.count() * z.count();
    let shifts = n.iter().product::<usize>() as f64;
    work[5] = (columns + rows + windows) as f64 * shifts;
    work[6] = work[5] * (shifts / 512.0).log2().max(0.0);
    work
}

/// How often each step of the transforms is taken, in the order of [`TRANSFORM_NS`].
fn transform(light: &[Light; 2], lattice: &Lattice, radius: [usize; 3]) -> [f64; 4] {
    let n = radius.map(|r| 2 * r + 1);
    let window = [0, 1, 2].map(|axis| lattice.axes[axis].window);
    let hulls = [window, [0, 1, 2].map(|axis| window[axis] + 2 * radius[axis])].map(|hull| hull.map(|n| n as f64));
    let lit_rows = [0, 1].map(|volume| light[volume].total.rows(hulls[volume][0]));
    let mut work = [Plan::new(window, n).operations(lit_rows), 0.0, 0.0, n.iter().product::<usize>() as f64];
    for ((light, hull), lit_rows) in light.iter().zip(hulls).zip(lit_rows) {
        work[1] += lit_rows * hull[1] * hull[2] * (hull[0] + n[0] as f64);
        work[2] += light.total.density * hull.iter().product::<f64>();
    }
    work.map(|steps| steps * lattice.count() as f64)
}

/// Shifts along x that a vector holds, and vectors that hold `n` of them.
fn lanes(n: usize) -> [f64; 2] {
    let lanes = lanes_for(n);
    [lanes as f64, n.div_ceil(lanes) as f64]
}

/// Share of the pairs of voxels along an axis of `length` voxels that are inside it, over all shifts within `radius`.
fn share_inside(length: usize, radius: usize) -> f64 {
    let pairs = |d: usize| length.saturating_sub(d) as f64;
    (pairs(0) + 2.0 * (1..radius + 1).map(pairs).sum::<f64>()) / ((2 * radius + 1) * length) as f64
}

/// Light of every cell of a lattice, x fastest.
struct Light {
    /// Lit voxels.
    voxels: Vec<u32>,
    /// Rows of the cell that hold any.
    rows: Vec<u32>,
    /// All cells together.
    total: Spread,
}

/// How light is spread.
#[derive(Clone, Copy)]
struct Spread {
    /// Share of the voxels that are lit.
    density: f64,
    /// Share of the rows of `length` voxels that are lit.
    lit_rows: f64,
    length: f64,
}

impl Spread {
    /// Share of the rows of `length` voxels that hold light.
    fn rows(&self, length: f64) -> f64 {
        1.0 - (1.0 - self.lit_rows).powf(length / self.length)
    }

    /// Share of the planes of `area` voxels that hold light.
    fn planes(&self, area: f64) -> f64 {
        self.rows(area)
    }
}

impl Light {
    fn count(volume: &Rows, lattice: &Lattice) -> Self {
        let [nx, ny, nz] = [0, 1, 2].map(|axis| lattice.axes[axis].cells.len());
        let cell_of = [0, 1, 2].map(|axis| {
            let mut cell_of = vec![None; volume.shape[axis]];
            let cells = lattice.axes[axis].cells.iter().enumerate();
            cells.for_each(|(cell, range)| cell_of[range.clone()].fill(Some(cell)));
            cell_of
        });
        let (mut voxels, mut rows) = (vec![0; nx * ny * nz], vec![0; nx * ny * nz]);
        for z in 0..volume.shape[2] {
            for y in 0..volume.shape[1] {
                let (Some(cy), Some(cz)) = (cell_of[1][y], cell_of[2][z]) else { continue };
                let mut last = None;
                for &x in volume.run(y, z, 0, volume.shape[0] as i32).0 {
                    let cx = cell_of[0][x as usize];
                    let Some(place) = cx.map(|cx| cx + nx * (cy + ny * cz)) else { continue };
                    voxels[place] += 1;
                    rows[place] += u32::from(cx != last);
                    last = cx;
                }
            }
        }
        let [x, y, z] =
            lattice.axes.each_ref().map(|axis| axis.cells.iter().map(|cell| cell.len()).sum::<usize>() as f64);
        let sum = |counts: &[u32]| counts.iter().map(|&count| count as f64).sum::<f64>();
        let total = Spread {
            density: sum(&voxels) / (x * y * z),
            lit_rows: sum(&rows) / (nx as f64 * y * z),
            length: x / nx as f64,
        };
        Self { voxels, rows, total }
    }

    fn at(&self, place: usize, cell: [f64; 3]) -> Spread {
        Spread {
            density: self.voxels[place] as f64 / (cell[0] * cell[1] * cell[2]),
            lit_rows: self.rows[place] as f64 / (cell[1] * cell[2]),
            length: cell[0],
        }
    }
}

#[cfg(test)]
mod tests;
