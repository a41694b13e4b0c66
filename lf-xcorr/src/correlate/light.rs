//! The light of a volume, counted in the cells of a window grid.

use super::window_grid::WindowGrid;
use crate::volumes::Rows;

/// Number of lit voxels and of lit rows of every cell, x fastest, and all cells together.
pub(crate) struct CellLight {
    pub voxels: Vec<u32>,
    pub rows: Vec<u32>,
    pub total: Spread,
}

/// How light is spread over voxels and rows.
#[derive(Clone, Copy)]
pub(crate) struct Spread {
    /// Fraction of the voxels that are lit.
    pub density: f64,
    /// Fraction of the rows of `length` voxels that hold light.
    lit_rows: f64,
    length: f64,
}

impl Spread {
    /// Fraction of the runs of `length` voxels that hold light; a run is a row, or a plane of that area.
    pub fn lit(&self, length: f64) -> f64 {
        1.0 - (1.0 - self.lit_rows).powf(length / self.length)
    }
}

impl CellLight {
    pub fn count(volume: &Rows, windows: &WindowGrid) -> Self {
        let [nx, ny, nz] = windows.axes.each_ref().map(|axis| axis.cells.len());
        let cells_along = |axis: usize| -> Vec<Option<usize>> {
            (0..volume.shape[axis]).map(|voxel| windows.axes[axis].cell_of(voxel)).collect()
        };
        let cell_of = [0, 1, 2].map(cells_along);
        let (mut voxels, mut rows) = (vec![0; nx * ny * nz], vec![0; nx * ny * nz]);
        for z in 0..volume.shape[2] {
            for y in 0..volume.shape[1] {
                let (Some(cy), Some(cz)) = (cell_of[1][y], cell_of[2][z]) else { continue };
                let mut last = None;
                for (x, _) in volume.row(y, z) {
                    let cx = cell_of[0][x as usize];
                    let Some(place) = cx.map(|cx| cx + nx * (cy + ny * cz)) else { continue };
                    voxels[place] += 1;
                    rows[place] += u32::from(cx != last);
                    last = cx;
                }
            }
        }
        let length = |cells: &[std::ops::Range<usize>]| cells.iter().map(|cell| cell.len()).sum::<usize>() as f64;
        let [x, y, z] = windows.axes.each_ref().map(|axis| length(&axis.cells));
        let sum = |counts: &[u32]| counts.iter().map(|&count| count as f64).sum::<f64>();
        let total = Spread {
            density: sum(&voxels) / (x * y * z),
            lit_rows: sum(&rows) / (nx as f64 * y * z),
            length: x / nx as f64,
        };
        Self { voxels, rows, total }
    }

    /// The light of the cell at `place`, which has `cell` voxels along x, y, z.
    pub fn of_cell(&self, place: usize, cell: [f64; 3]) -> Spread {
        Spread {
            density: self.voxels[place] as f64 / (cell[0] * cell[1] * cell[2]),
            lit_rows: self.rows[place] as f64 / (cell[1] * cell[2]),
            length: cell[0],
        }
    }
}
