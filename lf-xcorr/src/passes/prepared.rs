//! A pass with its windows and its volumes, ready to be correlated.

use super::{pass::BinnedPass, predictor::Predictor};
use crate::vectors::{Noise, Vector, filled, noise_ratio, unresolved};
use crate::{correlate::WindowAxis, correlate::WindowGrid, volumes::Rows};
use glam::DVec3;
use std::borrow::Cow;

/// Pairs of volumes at the resolution of a pass.
pub(crate) struct Volumes<'a> {
    pub pairs: Vec<[&'a Rows; 2]>,
    /// The field that the volumes were deformed by. Measured shifts come on top of it.
    pub deformed_by: Option<&'a Predictor>,
}

/// A pass with its windows and its volumes. Inside, lengths are bins; results are in voxels.
pub(crate) struct PreparedPass<'a> {
    pub binned: BinnedPass,
    pub windows: WindowGrid,
    /// Standard deviation of the predictor's smoothing, windows.
    smoothing_windows: f64,
    pairs: Vec<[Cow<'a, Rows>; 2]>,
    /// Whether most voxels of a volume are lit.
    pub is_full: bool,
}

impl<'a> PreparedPass<'a> {
    pub fn new(pairs: &'a [[Rows; 2]], binned: BinnedPass, smoothing_windows: f64) -> Self {
        let in_bins = |rows: &'a Rows| match binned.bin {
            [1, 1, 1] => Cow::Borrowed(rows),
            bin => Cow::Owned(rows.binned(bin)),
        };
        let pairs: Vec<[Cow<Rows>; 2]> = pairs.iter().map(|pair| pair.each_ref().map(in_bins)).collect();
        let is_full = pairs.iter().flatten().any(|rows| 2 * rows.count() > binned.shape.iter().product());
        Self { windows: binned.windows(), binned, smoothing_windows, pairs, is_full }
    }

    pub fn in_bins(&self, rows: Rows) -> Rows {
        if self.binned.bin == [1; 3] { rows } else { rows.binned(self.binned.bin) }
    }

    /// The volumes that are not deformed.
    pub fn plain(&self) -> Volumes<'_> {
        let pairs = self.pairs.iter().map(|pair| pair.each_ref().map(|rows| rows.as_ref())).collect();
        Volumes { pairs, deformed_by: None }
    }

    /// Lit voxels, or bins, of all first volumes and of all second volumes.
    pub fn lit(&self) -> [usize; 2] {
        [0, 1].map(|side| self.pairs.iter().map(|pair| pair[side].count()).sum())
    }

    pub fn bin_vox(&self) -> DVec3 {
        DVec3::from_array(self.binned.bin.map(|bin| bin as f64))
    }

    pub fn centre_vox(&self, node: usize) -> DVec3 {
        let node = self.windows.node(node);
        let centre = DVec3::from_array([0, 1, 2].map(|a| self.windows.axes[a].centre_vox(node[a])));
        (centre + 0.5) * self.bin_vox() - 0.5
    }

    pub fn step_vox(&self) -> [usize; 3] {
        [0, 1, 2].map(|a| self.windows.axes[a].step * self.binned.bin[a])
    }

    /// The prediction of this pass for the next; `None` if no vector was measured.
    pub fn predictor(&self, vectors: &[Vector]) -> Option<Predictor> {
        let vectors = vectors.iter().map(Vector::shift_vox).collect();
        let step_vox = DVec3::from_array(self.step_vox().map(|step| step as f64));
        let noise_ratio = noise_ratio(&self.windows, self.smoothing());
        Predictor::new(self.windows.shape(), self.centre_vox(0), step_vox, vectors, self.smoothing(), noise_ratio)
    }

    pub fn noise(&self, times: usize) -> Noise {
        Noise::new(&self.windows, self.smoothing(), times)
    }

    /// The part of each vector of volumes that were not deformed that the windows are too large to resolve, voxels.
    /// Vectors without data are taken from their neighbours.
    pub fn unresolved_vox(&self, vectors: &[Vector]) -> Vec<DVec3> {
        let known = vectors.iter().map(Vector::shift_vox).collect();
        let filled = filled(self.windows.shape(), known).unwrap_or_else(|| vec![DVec3::ZERO; vectors.len()]);
        unresolved(&self.windows, &filled)
    }

    /// Standard deviation of the predictor's smoothing, nodes.
    fn smoothing(&self) -> DVec3 {
        let nodes = |axis: &WindowAxis| self.smoothing_windows * axis.window as f64 / axis.step as f64;
        DVec3::from_array(self.windows.axes.each_ref().map(nodes))
    }
}
