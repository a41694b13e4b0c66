//! One pass of the multigrid, and the bins it works in.

use crate::correlate::WindowGrid;

/// One pass of the multigrid: interrogation windows of one size on one grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// Interrogation window, voxels.
    pub window: [usize; 3],
    /// Fraction of a window that the next one covers too, 0 to below 1.
    pub overlap: f64,
    /// Search radius about the predicted shift, voxels. The first pass searches about zero.
    pub search: [usize; 3],
}

impl Pass {
    /// Distance between neighbouring windows along `axis`, voxels; at least 1.
    pub fn step(&self, axis: usize) -> usize {
        ((self.window[axis] as f64 * (1.0 - self.overlap)).round() as usize).max(1)
    }

    pub(crate) fn windows(&self, shape: [usize; 3]) -> WindowGrid {
        WindowGrid::new(shape, self.window, [0, 1, 2].map(|axis| self.step(axis)))
    }

    /// Voxels binned into one along `axis`: one for a search up to [`Pass::FINE_SEARCH`], two beyond, and more where
    /// the search would otherwise be wider than [`Pass::BINNED_SEARCH`] bins.
    pub fn bin(&self, axis: usize) -> usize {
        let search = self.search[axis];
        if search <= Self::FINE_SEARCH { 1 } else { search.div_ceil(Self::BINNED_SEARCH).max(2) }
    }

    /// The search of the pass after this one: `usual`, or more after bins, because the error of a pass is up to a bin,
    /// and the fit of a peak needs one voxel more.
    pub fn search_after(&self, usual: [usize; 3]) -> [usize; 3] {
        let after_bins = |axis: usize| if self.bin(axis) > 1 { self.bin(axis) + 1 } else { 1 };
        [0, 1, 2].map(|axis| usual[axis].max(after_bins(axis)))
    }

    /// The pass in bins, in a volume of `shape` voxels. The last pass does not bin: its bins are voxels.
    pub(crate) fn binned(&self, shape: [usize; 3], is_last: bool) -> BinnedPass {
        let bin = [0, 1, 2].map(|axis| if is_last { 1 } else { self.bin(axis).min(self.window[axis]) });
        let shape = [0, 1, 2].map(|axis| shape[axis].div_ceil(bin[axis]));
        let window = [0, 1, 2].map(|axis| self.window[axis] / bin[axis]);
        let search = [0, 1, 2].map(|axis| self.search[axis].div_ceil(bin[axis]));
        BinnedPass { shape, pass: Self { window, search, ..*self }, bin }
    }

    /// Constant: widest search in bins. Only the last pass does not bin. Time and memory grow with the number of trial
    /// shifts, (2 x 8 + 1)^3 at most; the next pass recovers the detail that bins blur.
    pub const BINNED_SEARCH: usize = 8;
    /// Constant: widest search without bins. Bins of two voxels cost an eighth, and the next pass finds what they miss.
    pub const FINE_SEARCH: usize = 5;
}

/// A pass whose lengths are bins, in a volume of `shape` bins of `bin` voxels.
pub(crate) struct BinnedPass {
    pub shape: [usize; 3],
    pub pass: Pass,
    pub bin: [usize; 3],
}

impl BinnedPass {
    pub fn windows(&self) -> WindowGrid {
        self.pass.windows(self.shape)
    }

    /// The pass in voxels: whole bins of them.
    pub fn in_voxels(&self) -> Pass {
        let voxels = |bins: [usize; 3]| std::array::from_fn(|a| bins[a] * self.bin[a]);
        Pass { window: voxels(self.pass.window), search: voxels(self.pass.search), ..self.pass }
    }
}

/// `160 x 160 x 16`.
pub fn triple(n: [usize; 3]) -> String {
    format!("{} x {} x {}", n[0], n[1], n[2])
}
