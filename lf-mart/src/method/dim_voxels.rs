//! Finds the voxels of a tile that have too little light to be kept. Voxels far away may not matter.

use crate::operator::keep;
use lf_core::Grid;

/// Voxels in blocks along x and y of the whole grid; z is not divided. The strongest voxel in a voxel's block and the
/// eight around it decides, so a tile drops what the whole volume drops, except near its edge.
pub(super) struct Neighbourhood {
    /// Blocks along x and y, one more on every side.
    blocks: [usize; 2],
    /// Block of each voxel held.
    block: Vec<u32>,
    /// The strongest of each block.
    strongest: Vec<f32>,
    /// The strongest of each block and those around it.
    near: Vec<f32>,
}

impl Neighbourhood {
    pub(super) fn new(grid: &Grid, block_vox: [usize; 2], indices: &[u64]) -> Self {
        let blocks = [0, 1].map(|axis| grid.shape[axis].div_ceil(block_vox[axis]) + 2);
        let block = |index: &u64| {
            let [x, y, _] = grid.voxel(*index);
            (x / block_vox[0] + 1 + blocks[0] * (y / block_vox[1] + 1)) as u32
        };
        let count = blocks[0] * blocks[1];
        Self { blocks, block: indices.iter().map(block).collect(), strongest: vec![0.0; count], near: vec![0.0; count] }
    }

    /// Extinguishes the voxels below a share of the strongest near them.
    pub(super) fn extinguish(&mut self, strengths: &mut [f32], share: f32) {
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

    pub(super) fn retain(&mut self, held: &[bool]) {
        keep(&mut self.block, held);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of 2 x 2: the strongest counts in its block and in the next, not beyond.
    #[test]
    fn the_strongest_nearby_decides() {
        let grid = Grid { shape: [8, 2, 2], spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let indices: Vec<u64> = (0..grid.len()).collect();
        let mut near = Neighbourhood::new(&grid, [2, 2], &indices);
        let mut strengths = vec![1.0f32; indices.len()];
        strengths[grid.index([0, 1, 1]) as usize] = 100.0;
        near.extinguish(&mut strengths, 0.02);
        for (index, strength) in indices.iter().zip(&strengths) {
            let [x, _, _] = grid.voxel(*index);
            assert_eq!(*strength > 0.0, x >= 4 || *index == grid.index([0, 1, 1]), "{index}");
        }
        near.retain(&strengths.iter().map(|strength| *strength > 0.0).collect::<Vec<_>>());
        strengths.retain(|strength| *strength > 0.0);
        near.extinguish(&mut strengths, 0.02);
        assert_eq!(strengths.len(), 2 * 2 * 4 + 1);
        assert!(strengths.iter().all(|strength| *strength > 0.0));
    }
}
