use lf_core::Grid;

/// The voxels that pruning keeps.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// Rising linear indices.
    pub indices: Vec<u64>,
    /// Score of each: the geometric mean in counts, or the share of pixels.
    pub scores: Vec<f32>,
}

impl Support {
    /// (inside, lost): how many of these places lie in `grid`, and how many of them in voxels that are not kept.
    pub fn lost(&self, grid: &Grid, places_mm: &[[f64; 3]]) -> (usize, usize) {
        let (mut inside, mut lost) = (0, 0);
        for place in places_mm {
            let voxel = [0, 1, 2].map(|axis| grid.place_vox(axis, place[axis]).round());
            if (0..3).all(|axis| voxel[axis] >= 0.0 && voxel[axis] < grid.shape[axis] as f64) {
                inside += 1;
                let index = grid.index(voxel.map(|step| step as usize));
                lost += usize::from(self.indices.binary_search(&index).is_err());
            }
        }
        (inside, lost)
    }
}
