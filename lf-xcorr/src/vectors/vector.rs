//! The vector of a window.

use crate::correlate::PeakFit;
use glam::DVec3;

/// The vector of a window: read off a correlation peak, or taken from the neighbours. Lengths are voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Vector {
    Measured(PeakFit),
    Replaced(DVec3),
    NoData,
}

impl Vector {
    pub fn shift_vox(&self) -> Option<DVec3> {
        match self {
            Self::Measured(fit) => Some(fit.shift_vox),
            Self::Replaced(shift_vox) => Some(*shift_vox),
            Self::NoData => None,
        }
    }

    /// The correlation peak of a measured vector.
    pub fn fit(&self) -> Option<&PeakFit> {
        if let Self::Measured(fit) = self { Some(fit) } else { None }
    }
}
