//! The particle images in volumes.

use crate::correlate::WindowGrid;
use crate::error::Refused;
use crate::passes::Pass;
use crate::vectors::ParticleImages;
use crate::volumes::{Mask, Rows, Sparse};
use lf_core::Grid;
use lf_core::statistics::{median, upper_median};

/// The particle images in pairs of volumes that show the same flow.
#[derive(Debug, Clone, PartialEq)]
pub struct Seeding {
    /// The grid of the voxels that windows may hold.
    pub part: Grid,
    /// The brightest voxel of every particle image, of all pairs together.
    pub tops: Vec<[usize; 3]>,
    /// Median length of the particle images along x, y, z at half of their peak, voxels. NaN without particles.
    pub length_vox: [f64; 3],
}

impl Seeding {
    /// The particle images inside `mask`, in voxels of at least `floor` times the volume's brightest. The volume of a
    /// pair with fewer of them counts, because a particle must be in both to be correlated. Refuses and panics like
    /// [`crate::Plan::new`].
    pub fn find(pairs: &[[Sparse; 2]], mask: &Mask, floor: f32) -> Result<Self, Refused> {
        let part = Sparse::check_pairs(pairs, mask)?;
        let (mut tops, mut lengths) = (Vec::new(), [Vec::new(), Vec::new(), Vec::new()]);
        for pair in pairs {
            let of_volume = |volume: &Sparse| {
                let rows = Rows::new(volume, mask, floor);
                let tops = ParticleImages::new([&rows, &rows]).tops();
                (rows, tops)
            };
            let [first, second] = pair.each_ref().map(of_volume);
            let (rows, fewer) = if first.1.len() <= second.1.len() { first } else { second };
            for &top in &fewer {
                (0..3).for_each(|axis| lengths[axis].push(length(&rows, top, axis)));
            }
            tops.extend(fewer);
        }
        Ok(Self { part, tops, length_vox: lengths.map(|mut lengths| median(&mut lengths)) })
    }

    /// Number of particle images in the median window of a pass, among the windows that have any; otherwise 0.
    pub fn in_median_window(&self, pass: &Pass) -> usize {
        let windows = pass.windows(self.part.shape);
        let cells = self.in_cells(&windows);
        let of_window = |node: usize| windows.cells_of(node).map(|cell| cells[cell]).sum::<u32>() as f64;
        let mut counts: Vec<f64> = (0..windows.count()).map(of_window).filter(|count| *count > 0.0).collect();
        upper_median(&mut counts).unwrap_or(0.0) as usize
    }

    /// Particle images in every cell of a window grid.
    fn in_cells(&self, windows: &WindowGrid) -> Vec<u32> {
        let mut counts = vec![0; windows.cell_count()];
        let [nx, ny, _] = windows.axes.each_ref().map(|axis| axis.cells.len());
        for top in &self.tops {
            if let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(|axis| windows.axes[axis].cell_of(top[axis])) {
                counts[x + nx * (y + ny * z)] += 1;
            }
        }
        counts
    }
}

/// Full width at half maximum, along `axis`, of the particle image with this top, voxels. Its light is linear between
/// voxels.
fn length(rows: &Rows, top: [usize; 3], axis: usize) -> f64 {
    let light = |offset: i64| -> f64 {
        let mut place = top.map(|place| place as i64);
        place[axis] += offset;
        if (0..3).any(|a| place[a] < 0 || place[a] >= rows.shape[a] as i64) {
            return 0.0;
        }
        let [x, y, z] = place;
        rows.run(y as usize, z as usize, x as i32, x as i32 + 1).1.first().map_or(0.0, |&value| value as f64)
    };
    let half = 0.5 * light(0);
    let side = |step: i64| {
        let below = (1..).find(|&n| light(n * step) < half).expect("light ends at the volume's sides");
        let (inner, outer) = (light((below - 1) * step), light(below * step));
        below as f64 - 1.0 + (inner - half) / (inner - outer)
    };
    side(1) + side(-1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: a triangle of light 1, 2, 3, 4, 3, 2, 1 is at half its peak two voxels from its top.
    #[test]
    fn a_triangle_by_hand() {
        let mut dense = [0f32; 11 * 3 * 3];
        (0..7).for_each(|k| dense[2 + k + 11 * 4] = [1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0][k]);
        let rows = Rows::of_dense([11, 3, 3], &dense);
        assert_eq!(length(&rows, [5, 1, 1], 0), 4.0);
        // One voxel thick: half way to the dark neighbours.
        assert_eq!(length(&rows, [5, 1, 1], 1), 1.0);
        let at_side = Rows::of_dense([2, 1, 1], &[4.0, 1.0]);
        assert!((length(&at_side, [0, 0, 0], 0) - (0.5 + 2.0 / 3.0)).abs() < 1e-12);
    }
}
