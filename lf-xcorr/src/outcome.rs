//! What a correlation gives: the field, and how it came about.

use crate::level::{Counts, Level, Vector};
use crate::options::Pass;
use crate::uncertainty::Statistics;
use lf_core::field::{self, Field, VectorGrid};
use lf_core::grid::Grid;

/// What a pass did.
#[derive(Debug, Clone, PartialEq)]
pub struct PassReport {
    /// Interrogation window, voxels.
    pub window: [usize; 3],
    /// Distance between windows, voxels.
    pub step: [usize; 3],
    /// Search radius, voxels.
    pub search: [usize; 3],
    /// Voxels binned into one; 1, 1, 1 at full resolution.
    pub bin: [usize; 3],
    /// Lit voxels (or bins) of the first volumes and of the second.
    pub lit: [usize; 2],
    /// Windows along x, y, z.
    pub nodes: [usize; 3],
    /// Each time it was done.
    pub repeats: Vec<Repeat>,
}

/// A pass done once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeat {
    /// Whether the volumes were deformed.
    pub deformed: bool,
    /// Change of the displacement across a window that was predicted, voxels; 0 where nothing was.
    pub change_across_vox: f64,
    /// Change of the measured vectors since the repeat before, root mean square, voxels; NaN for the first.
    pub change_vox: f64,
    /// Mean correlation at the peaks.
    pub correlation: f64,
    /// What the direct path was estimated to take on one core, seconds.
    pub direct_s: f64,
    /// What transforms were estimated to take on one core, seconds.
    pub transform_s: f64,
    /// Whether transforms were used.
    pub transform: bool,
    /// Where the vectors came from.
    pub counts: Counts,
}

/// The field, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Displacement of the second volume against the first, mm, at the windows' centres. The history is left empty.
    ///
    /// Convention: a replaced vector has `peak` and `ratio` 0 and no uncertainty, for nothing was measured; a vector without
    /// data has u, v, w NaN as well, so that it cannot pass for a displacement of zero.
    pub field: Field,
    /// One report per pass.
    pub passes: Vec<PassReport>,
}

impl PassReport {
    pub(crate) fn new(level: &Level, repeats: Vec<Repeat>) -> Self {
        let Pass { window, search, .. } = level.pass_vox();
        Self {
            window,
            step: level.step_vox(),
            search,
            bin: level.bin,
            lit: level.lit(),
            nodes: level.lattice.shape(),
            repeats,
        }
    }

    /// Where the vectors it gave came from.
    pub fn counts(&self) -> Counts {
        self.repeats.last().map(|repeat| repeat.counts).unwrap_or_default()
    }
}

/// The vectors of the last pass as a field in millimetres.
pub(crate) fn field(level: &Level, vectors: &[Vector], statistics: &[Statistics], grid: &Grid) -> Field {
    let centre_vox = level.centre_vox(0);
    let mut field = Field::empty(VectorGrid {
        shape: level.lattice.shape(),
        spacing_mm: std::array::from_fn(|a| level.lattice.axes[a].step as f64 * grid.spacing_mm[a]),
        origin_mm: std::array::from_fn(|a| grid.origin_mm[a] + centre_vox[a] * grid.spacing_mm[a]),
        voxel_mm: grid.spacing_mm,
        window: level.pass.window,
        overlap: level.pass.overlap,
        dt_s: None,
        history: Vec::new(),
    });
    for (node, (vector, statistics)) in vectors.iter().zip(statistics).enumerate() {
        let millimetres = |vox: [f64; 3]| -> [f32; 3] { std::array::from_fn(|a| (vox[a] * grid.spacing_mm[a]) as f32) };
        [field.u[node], field.v[node], field.w[node]] = millimetres(vector.shift_vox().unwrap_or([f64::NAN; 3]));
        (field.peak[node], field.ratio[node], field.flag[node]) = match vector {
            Vector::Measured(reading) => (reading.height as f32, reading.ratio as f32, field::MEASURED),
            Vector::Replaced(_) => (0.0, 0.0, field::REPLACED),
            Vector::NoData => (0.0, 0.0, field::NO_DATA),
        };
        field.count[node] = statistics.particles as f32;
        if vector.reading().is_some() {
            [field.su[node], field.sv[node], field.sw[node]] = millimetres(statistics.uncertainty_vox);
        }
    }
    field
}
