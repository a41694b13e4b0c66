//! The result of a correlation: the field, and how it came about.

use super::{pass::Pass, prepared::PreparedPass};
use crate::vectors::{Uncertainty, Vector};
use glam::DVec3;
use lf_core::statistics::upper_median;
use lf_core::{Field, Grid, VectorGrid, field};

/// The origin of the vectors of a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Windows without light.
    pub dark: usize,
    /// Windows whose correlation had no peak inside the search.
    pub outside: usize,
    /// Peaks that failed the median test.
    pub outliers: usize,
    /// Windows of `outside` or `outliers` whose second peak, near their neighbours' displacement, was taken.
    pub recovered: usize,
    /// Vectors replaced from their neighbours.
    pub replaced: usize,
    /// Dark windows, and windows that have nothing to replace them from.
    pub no_data: usize,
}

/// A pass done once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeat {
    /// Whether the volumes were deformed.
    pub deformed: bool,
    /// Predicted change of the displacement across a window, voxels; 0 without a prediction.
    pub change_across_vox: f64,
    /// Root mean square change of the measured vectors since the repeat before, voxels; NaN for the first.
    pub change_vox: f64,
    /// Mean correlation at the peaks.
    pub correlation: f64,
    /// The origin of the vectors.
    pub counts: Counts,
}

/// A pass and all its repeats. Lengths are voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct PassReport {
    /// Interrogation window.
    pub window: [usize; 3],
    /// Distance between windows.
    pub step: [usize; 3],
    /// Search radius.
    pub search: [usize; 3],
    /// Voxels binned into one; 1, 1, 1 at full resolution.
    pub bin: [usize; 3],
    /// Lit voxels (or bins) of all first volumes and of all second volumes.
    pub lit: [usize; 2],
    /// Windows along x, y, z.
    pub nodes: [usize; 3],
    /// One entry for each time that the pass was done.
    pub repeats: Vec<Repeat>,
}

/// The field, and how it came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Displacement of the second volume against the first, mm, at the windows' centres. The history is left empty. A
    /// replaced vector has `peak` and `ratio` 0 and no uncertainty, because nothing was measured. Without data u, v, w
    /// are NaN too, so that they cannot be read as a displacement of zero.
    pub field: Field,
    /// One report for each pass.
    pub passes: Vec<PassReport>,
}

impl Outcome {
    /// Particle images of the median window that has data; 0 without any.
    pub fn in_median_window(&self) -> usize {
        let lit = (0..self.field.len()).filter(|&i| self.field.flag[i] != field::NO_DATA);
        let mut counts: Vec<f32> = lit.map(|i| self.field.count[i]).collect();
        upper_median(&mut counts).unwrap_or(0.0) as usize
    }
}

impl PassReport {
    pub(crate) fn new(pass: &PreparedPass, repeats: Vec<Repeat>) -> Self {
        let Pass { window, search, .. } = pass.binned.in_voxels();
        Self {
            window,
            step: pass.step_vox(),
            search,
            bin: pass.binned.bin,
            lit: pass.lit(),
            nodes: pass.windows.shape(),
            repeats,
        }
    }

    /// The origin of the vectors of the last repeat.
    pub fn counts(&self) -> Counts {
        self.repeats.last().map(|repeat| repeat.counts).unwrap_or_default()
    }
}

/// The vectors of the last pass, which has bins of one voxel, as a field in millimetres.
pub(crate) fn field(pass: &PreparedPass, vectors: &[Vector], uncertainties: &[Uncertainty], grid: &Grid) -> Field {
    let [spacing_mm, origin_mm] = [grid.spacing_mm, grid.origin_mm].map(DVec3::from_array);
    let step_vox = DVec3::from_array(pass.step_vox().map(|step| step as f64));
    let mut field = Field::empty(VectorGrid {
        shape: pass.windows.shape(),
        spacing_mm: (step_vox * spacing_mm).into(),
        origin_mm: (origin_mm + pass.centre_vox(0) * spacing_mm).into(),
        voxel_mm: grid.spacing_mm,
        window: pass.binned.pass.window,
        overlap: pass.binned.pass.overlap,
        dt_s: None,
        history: Vec::new(),
    });
    let millimetres = |vox: DVec3| (vox * spacing_mm).as_vec3().to_array();
    for (node, (vector, uncertainty)) in vectors.iter().zip(uncertainties).enumerate() {
        [field.u[node], field.v[node], field.w[node]] = millimetres(vector.shift_vox().unwrap_or(DVec3::NAN));
        (field.peak[node], field.ratio[node], field.flag[node]) = match vector {
            Vector::Measured(fit) => (fit.height as f32, fit.ratio as f32, field::MEASURED),
            Vector::Replaced(_) => (0.0, 0.0, field::REPLACED),
            Vector::NoData => (0.0, 0.0, field::NO_DATA),
        };
        field.count[node] = uncertainty.particles as f32;
        if vector.fit().is_some() {
            [field.su[node], field.sv[node], field.sw[node]] = millimetres(uncertainty.std_vox);
        }
    }
    field
}
