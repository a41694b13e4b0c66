//! Which voxels have so little light that they are dropped, where that may not depend on what lies far away.

use crate::operator::keep;
use lf_core::grid::Grid;

/// Voxels in blocks of the whole grid, across z undivided: a voxel is spent by the strongest of its block and the eight about
/// it. A part of a volume so drops what the whole drops, but for voxels near its end.
pub(crate) struct Near {
    /// Blocks along x and y, one more on every side.
    blocks: [usize; 2],
    /// Block of each voxel held.
    block: Vec<u32>,
    /// The strongest of each block and of those about it.
    strongest: Vec<f32>,
    near: Vec<f32>,
}

impl Near {
    /// For voxels of a grid, in blocks of so many along x and y.
    pub(crate) fn new(grid: &Grid, block_vox: [usize; 2], indices: &[u64]) -> Self {
        let blocks = [0, 1].map(|axis| grid.shape[axis].div_ceil(block_vox[axis]) + 2);
        let of = |index: &u64| {
            let [x, y, _] = grid.voxel(*index);
            (x / block_vox[0] + 1 + blocks[0] * (y / block_vox[1] + 1)) as u32
        };
        let count = blocks[0] * blocks[1];
        Self { blocks, block: indices.iter().map(of).collect(), strongest: vec![0.0; count], near: vec![0.0; count] }
    }

    /// Puts out the voxels below a share of the strongest near them.
    pub(crate) fn put_out(&mut self, strengths: &mut [f32], share: f32) {
        self.strongest.fill(0.0);
        for (block, strength) in self.block.iter().zip(&*strengths) {
            let strongest = &mut self.strongest[*block as usize];
            *strongest = strongest.max(*strength);
        }
        let [across, down] = self.blocks;
        for y in 1..down - 1 {
            for x in 1..across - 1 {
                let rows = (y - 1..=y + 1).map(|y| &self.strongest[x - 1 + across * y..][..3]);
                self.near[x + across * y] = rows.flatten().fold(0.0, |near, strongest| near.max(*strongest));
            }
        }
        for (block, strength) in self.block.iter().zip(strengths) {
            if *strength <= share * self.near[*block as usize] {
                *strength = 0.0;
            }
        }
    }

    /// Forgets the voxels that are not held.
    pub(crate) fn retain(&mut self, held: &[bool]) {
        keep(&mut self.block, held);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of 2 x 2: the strongest counts within its block and the next, not beyond.
    #[test]
    fn the_strongest_near_by_decides() {
        let grid = Grid { shape: [8, 2, 2], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let indices: Vec<u64> = (0..grid.len()).collect();
        let mut near = Near::new(&grid, [2, 2], &indices);
        let mut strengths = vec![1.0f32; indices.len()];
        strengths[grid.index([0, 1, 1]) as usize] = 100.0;
        near.put_out(&mut strengths, 0.02);
        for (index, strength) in indices.iter().zip(&strengths) {
            let [x, _, _] = grid.voxel(*index);
            assert_eq!(*strength > 0.0, x >= 4 || *index == grid.index([0, 1, 1]), "{index}");
        }
        near.retain(&strengths.iter().map(|strength| *strength > 0.0).collect::<Vec<_>>());
        strengths.retain(|strength| *strength > 0.0);
        near.put_out(&mut strengths, 0.02);
        assert_eq!(strengths.len(), 2 * 2 * 4 + 1);
        assert!(strengths.iter().all(|strength| *strength > 0.0));
    }
}
