//! The vector of a window.

use crate::correlate::PeakFit;
use glam::DVec3;

/// The vector of a window. Lengths are voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Vector {
    /// Read off a correlation peak.
    Measured(PeakFit),
    /// Taken from the neighbours.
    Replaced(DVec3),
    /// Neither measured nor replaced.
    NoData,
}

impl Vector {
    /// The displacement; `None` if there is no data.
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
