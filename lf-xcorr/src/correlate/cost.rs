//! The time that a pass would take by direct sums and by Fourier transforms.
//!
//! Promise: the estimate reads every lit voxel once and keeps a table of cells. If the light is spread evenly, the
//! ratio of the two times is within a factor of 2 of the measured one. Departure: all windows count as searched about
//! the same shift. Where neighbours differ, direct sums take longer, because a cell is summed over all shifts of its
//! windows.

use super::window_grid::{WindowAxis, WindowGrid};
use super::{kernel::lanes_for, light::CellLight, transform::Transforms};
use crate::volumes::Rows;

/// Estimates the time of a pass from the light of a pair in the cells of a window grid. Seconds are of one core.
pub(crate) struct Estimate<'a> {
    light: [CellLight; 2],
    shape: [usize; 3],
    windows: &'a WindowGrid,
}

impl<'a> Estimate<'a> {
    pub fn new(pair: [&Rows; 2], windows: &'a WindowGrid) -> Self {
        Self { light: pair.map(|rows| CellLight::count(rows, windows)), shape: pair[0].shape, windows }
    }

    /// By products of lit voxels, shared between windows; every window is searched within `radius`.
    pub fn direct_s(&self, radius: [usize; 3]) -> f64 {
        seconds(&self.direct_steps(radius), &DIRECT_NS)
    }

    pub fn transform_s(&self, radius: [usize; 3]) -> f64 {
        seconds(&self.transform_steps(radius), &TRANSFORM_NS)
    }

    /// Number of each kind of step of the direct sums, in the order of [`DIRECT_NS`].
    fn direct_steps(&self, radius: [usize; 3]) -> [f64; 7] {
        let n = radius.map(|r| 2 * r + 1);
        let r = radius.map(|r| r as f64);
        let [lanes, vectors] = lanes(n[0]);
        let inside: f64 = (0..3).map(|axis| share_inside(self.shape[axis], radius[axis])).product();
        let mut steps = [0.0; 7];
        let [x, y, z] = &self.windows.axes;
        for place in 0..self.windows.cell_count() {
            let cell = self.windows.cell(place).map(|range| range.len() as f64);
            let [here, there] = [0, 1].map(|volume| self.light[volume].of_cell(place, cell));
            // Products: the rows of the first volume that send light, with the rows of the second that they meet.
            let reach = [0, 1, 2].map(|axis| cell[axis] + r[axis]);
            let pairs = inside * (n[1] * n[2]) as f64 * cell[1] * cell[2] * there.lit(reach[0] + 2.0 * r[0]);
            steps[0] += pairs * here.density * reach[0] * lanes * vectors;
            steps[1] += pairs * here.lit(reach[0]) * vectors;
            // Energies: voxels, rows and planes, each for the shifts that it is summed at.
            let held = [0, 1, 2].map(|axis| n[axis] as f64 * cell[axis] / reach[axis]);
            for light in [here, there] {
                let rows = light.lit(reach[0]) * reach[1] * reach[2];
                let planes = light.lit(reach[0] * reach[1]) * reach[2];
                steps[2] += light.density * reach[0] * reach[1] * reach[2] * held[0];
                steps[3] += rows * n[0] as f64;
                steps[4] += n[0] as f64 * (rows * held[1] + planes * n[1] as f64 * held[2]);
            }
        }
        // Sharing: cells into columns, columns into rows, rows into windows.
        let span = |axis: &WindowAxis| axis.spans.iter().map(|span| span.len()).sum::<usize>();
        let columns = x.cells.len() * y.cells.len() * span(z);
        let rows = x.cells.len() * span(y) * z.count();
        let windows = span(x) * y.count() * z.count();
        let shifts = n.iter().product::<usize>() as f64;
        steps[5] = (columns + rows + windows) as f64 * shifts;
        steps[6] = steps[5] * (shifts / 512.0).log2().max(0.0);
        steps
    }

    /// Number of each kind of step of the transforms, in the order of [`TRANSFORM_NS`].
    fn transform_steps(&self, radius: [usize; 3]) -> [f64; 4] {
        let n = radius.map(|r| 2 * r + 1);
        let window = self.windows.window();
        let hulls = [window, [0, 1, 2].map(|axis| window[axis] + 2 * radius[axis])];
        let hulls = hulls.map(|hull| hull.map(|n| n as f64));
        let lit_rows = [0, 1].map(|volume| self.light[volume].total.lit(hulls[volume][0]));
        let shifts = n.iter().product::<usize>() as f64;
        let mut steps = [Transforms::new(window, n).operations(lit_rows), 0.0, 0.0, shifts];
        for ((light, hull), lit_rows) in self.light.iter().zip(hulls).zip(lit_rows) {
            steps[1] += lit_rows * hull[1] * hull[2] * (hull[0] + n[0] as f64);
            steps[2] += light.total.density * hull.iter().product::<f64>();
        }
        steps.map(|steps| steps * self.windows.count() as f64)
    }
}

fn seconds(counts: &[f64], ns: &[f64]) -> f64 {
    counts.iter().zip(ns).map(|(count, ns)| count * ns).sum::<f64>() * 1e-9
}

/// Constant: nanoseconds of a multiplication of the products; of a pair of rows; of a voxel, of a row and shift along
/// x, and of an addition of the energies; of a shift that is added from one set of sums to the next; and the extra time
/// of the last for each doubling of the shifts above 512, as the sums leave the caches. Fitted to `benches/routes.rs`
/// on one core of a Xeon (Sapphire Rapids, AVX2 code) at 0.1 % to 100 % of light, windows of 16 to 64 and radii of 4 to
/// 16: 0.6 to 1.4 of the measured times. Wrong constants cost time only; vectors are read off direct sums either way.
const DIRECT_NS: [f64; 7] = [0.21, 8.6, 1.0, 44.0, 0.16, 4.8, 1.3];

/// Constant: nanoseconds of an operation of the transforms, of an element of a row of the energies, of a lit voxel and
/// of a shift. Fitted like [`DIRECT_NS`].
const TRANSFORM_NS: [f64; 4] = [0.089, 3.1, 0.9, 9.5];

/// Shifts along x that a vector holds, and vectors that hold `n` of them.
fn lanes(n: usize) -> [f64; 2] {
    let lanes = lanes_for(n);
    [lanes as f64, n.div_ceil(lanes) as f64]
}

/// Fraction of the pairs of voxels along an axis that are inside its `length`, over all shifts within `radius`.
fn share_inside(length: usize, radius: usize) -> f64 {
    let pairs = |d: usize| length.saturating_sub(d) as f64;
    (pairs(0) + 2.0 * (1..radius + 1).map(pairs).sum::<f64>()) / ((2 * radius + 1) * length) as f64
}

#[cfg(test)]
mod tests;
