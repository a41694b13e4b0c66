//! One pass at its resolution: its windows, its volumes, what it predicts for the next.

mod search;

pub use search::Counts;
pub(crate) use search::{Done, Search, Trial};

use crate::cost::Estimate;
use crate::fill::filled;
use crate::lattice::Lattice;
use crate::options::Pass;
use crate::peak::Reading;
use crate::predictor::Predictor;
use crate::response::{Noise, noise_ratio, unresolved};
use crate::sparse::Rows;
use std::borrow::Cow;

/// A vector of a pass, in voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Vector {
    Measured(Reading),
    Replaced([f64; 3]),
    NoData,
}

impl Vector {
    pub fn shift_vox(&self) -> Option<[f64; 3]> {
        match self {
            Self::Measured(reading) => Some(reading.shift_vox),
            Self::Replaced(shift_vox) => Some(*shift_vox),
            Self::NoData => None,
        }
    }

    pub fn reading(&self) -> Option<&Reading> {
        match self {
            Self::Measured(reading) => Some(reading),
            _ => None,
        }
    }
}

/// The volume's shape and the pass in bins, and the bin; a pass that may not bin is given back as it is.
pub(crate) fn binned(shape: [usize; 3], pass: &Pass, may_bin: bool) -> ([usize; 3], Pass, [usize; 3]) {
    let bin = [0, 1, 2].map(|axis| if may_bin { pass.bin(axis).min(pass.window[axis]) } else { 1 });
    let shape = [0, 1, 2].map(|axis| shape[axis].div_ceil(bin[axis]));
    let window = [0, 1, 2].map(|axis| pass.window[axis] / bin[axis]);
    let search = [0, 1, 2].map(|axis| pass.search[axis].div_ceil(bin[axis]));
    (shape, Pass { window, search, ..*pass }, bin)
}

/// One pass at its resolution. Inside, lengths are bins; what comes out is voxels.
pub(crate) struct Level<'a> {
    pub pass: Pass,
    pub bin: [usize; 3],
    pub lattice: Lattice,
    /// Standard deviation of the predictor's smoothing, windows.
    smoothing_windows: f64,
    pairs: Vec<[Cow<'a, Rows>; 2]>,
    /// Whether most voxels of a volume are lit.
    full: bool,
}

impl<'a> Level<'a> {
    pub fn new(pairs: &'a [[Rows; 2]], pass: &Pass, smoothing_windows: f64, may_bin: bool) -> Self {
        let (shape, pass, bin) = binned(pairs[0][0].shape, pass, may_bin);
        let pairs = pairs.iter().map(|pair| {
            pair.each_ref().map(|rows| match bin {
                [1, 1, 1] => Cow::Borrowed(rows),
                _ => Cow::Owned(rows.binned(bin)),
            })
        });
        let lattice = Lattice::new(shape, &pass);
        let pairs: Vec<[Cow<Rows>; 2]> = pairs.collect();
        let full = pairs.iter().flatten().any(|rows| 2 * rows.count() > shape.iter().product());
        Self { pass, bin, pairs, full, lattice, smoothing_windows }
    }

    /// The pass in voxels: whole bins of them.
    pub fn pass_vox(&self) -> Pass {
        let whole = |bins: [usize; 3]| std::array::from_fn(|a| bins[a] * self.bin[a]);
        Pass { window: whole(self.pass.window), search: whole(self.pass.search), ..self.pass }
    }

    /// A volume at the resolution of the pass.
    pub fn binned(&self, rows: Rows) -> Rows {
        if self.bin == [1; 3] { rows } else { rows.binned(self.bin) }
    }

    /// The volumes as they are.
    pub fn plain(&self) -> Trial<'_> {
        let pairs = self.pairs.iter().map(|pair| pair.each_ref().map(|rows| rows.as_ref())).collect();
        Trial { pairs, deformed_by: None }
    }

    /// Lit voxels, or bins, of the first volumes and of the second.
    pub fn lit(&self) -> [usize; 2] {
        [0, 1].map(|side| self.pairs.iter().map(|pair| pair[side].count()).sum())
    }

    /// Seconds that the pass would take on one core: by products, every window searched within `radius`; and by transforms as
    /// far as the pass says, read off products.
    fn cost(&self, trial: &Trial, radius: [usize; 3]) -> [f64; 2] {
        trial.pairs.iter().fold([0.0; 2], |[direct, transform], pair| {
            let estimate = Estimate::new(*pair, &self.lattice);
            let read_off = estimate.direct_s(Self::CLOSE);
            [direct + estimate.direct_s(radius), transform + estimate.transform_s(self.pass.search) + read_off]
        })
    }

    /// Whether the sums of the direct path fit into [`Pass::MOST_BYTES`].
    fn fits(&self, radius: [usize; 3]) -> bool {
        let pass = Pass { search: radius, ..self.pass };
        pass.direct_bytes(&self.lattice, self.pairs.len()) <= Pass::MOST_BYTES
    }

    /// Centre of a window, voxels.
    pub fn centre_vox(&self, node: usize) -> [f64; 3] {
        let node = self.lattice.node(node);
        std::array::from_fn(|a| self.voxel(a, self.lattice.axes[a].centre_vox(node[a])))
    }

    /// Distance between windows, voxels.
    pub fn step_vox(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.lattice.axes[a].step * self.bin[a])
    }

    /// A place in bins along `axis`, in voxels.
    fn voxel(&self, axis: usize, place: f64) -> f64 {
        (place + 0.5) * self.bin[axis] as f64 - 0.5
    }

    /// What this pass predicts for the next.
    pub fn predictor(&self, vectors: &[Vector]) -> Option<Predictor> {
        let vectors = vectors.iter().map(Vector::shift_vox).collect();
        let step_vox = self.step_vox().map(|step| step as f64);
        let noise_ratio = noise_ratio(&self.lattice, self.smoothing());
        Predictor::new(self.lattice.shape(), self.centre_vox(0), step_vox, vectors, self.smoothing(), noise_ratio)
    }

    /// What noise becomes after the pass was done `times` times.
    pub fn noise(&self, times: usize) -> Noise {
        Noise::new(&self.lattice, self.smoothing(), times)
    }

    /// What of each vector the windows are too large for, after the pass was done `times` times, voxels. Vectors without
    /// data count as their neighbours have it.
    pub fn unresolved(&self, vectors: &[Vector], times: usize) -> Vec<[f64; 3]> {
        let known = vectors.iter().map(Vector::shift_vox).collect();
        let filled = filled(self.lattice.shape(), known).unwrap_or_else(|| vec![[0.0; 3]; vectors.len()]);
        unresolved(&self.lattice, filled, self.smoothing(), times)
    }

    /// Standard deviation of the predictor's smoothing, nodes.
    fn smoothing(&self) -> [f64; 3] {
        let axes = &self.lattice.axes;
        std::array::from_fn(|a| self.smoothing_windows * axes[a].window as f64 / axes[a].step as f64)
    }
}
