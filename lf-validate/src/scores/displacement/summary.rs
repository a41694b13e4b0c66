//! Bias, RMS, spread and outliers of a set of errors.

use super::truth::VectorError;
use crate::scores::spread::ErrorSpread;
use crate::scores::units::{COMPONENTS, Unit, in_px};
use lf_core::statistics::robust;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// An error is an outlier if it is more than this many robust standard deviations from the median error of its
/// component: one vector in two million of a normal distribution.
const OUTLIER_SIGMAS: f64 = 5.0;

/// An outlier is also more than this many voxels from the median error: the uncertainty of correlation in good data.
/// Without this floor ordinary vectors would be outliers where the others agree very closely.
const OUTLIER_FLOOR_VOX: f64 = 0.1;

/// Errors of a set of vectors, or of the field at particles. In JSON one key for each of bias, rms, std and median_abs,
/// component and unit: `rms_u_px`.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorSummary {
    /// Vectors scored, or particles if they are the truth.
    pub vectors: usize,
    /// All other numbers include them.
    pub(crate) outliers: usize,
    pub(crate) spread_mm: [ErrorSpread; 3],
    units: Vec<Unit>,
}

impl ErrorSummary {
    pub(super) fn of(errors: &[VectorError], voxel_mm: [f64; 3], units: Vec<Unit>) -> Self {
        let components = [0, 1, 2].map(|axis| errors.iter().map(|error| error.error_mm[axis]).collect::<Vec<f64>>());
        // Median and largest distance from it that is not an outlier.
        let limits = [0, 1, 2].map(|axis| {
            let (centre, sigma) = robust(&components[axis]);
            (centre, (OUTLIER_SIGMAS * sigma).max(OUTLIER_FLOOR_VOX * voxel_mm[axis]))
        });
        let is_outlier =
            |error: &&VectorError| (0..3).any(|axis| (error.error_mm[axis] - limits[axis].0).abs() > limits[axis].1);
        Self {
            vectors: errors.len(),
            outliers: errors.iter().filter(is_outlier).count(),
            spread_mm: components.map(|component| ErrorSpread::of(&component)),
            units,
        }
    }

    /// The RMS error of each component in pixels. None without a camera, NaN without vectors.
    pub fn rms_px(&self) -> Option<[f64; 3]> {
        in_px(self.spread_mm.map(|spread| spread.rms), &self.units)
    }

    /// The mean error of each component in pixels. None without a camera, NaN without vectors.
    pub fn bias_px(&self) -> Option<[f64; 3]> {
        in_px(self.spread_mm.map(|spread| spread.bias), &self.units)
    }

    /// Share of the vectors that are outliers. NaN without vectors.
    pub fn outlier_share(&self) -> f64 {
        self.outliers as f64 / self.vectors as f64
    }
}

impl Serialize for ErrorSummary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("vectors", &self.vectors)?;
        map.serialize_entry("outliers", &self.outliers)?;
        for (unit, per_mm) in &self.units {
            for (name, number) in [
                ("bias", (|spread| spread.bias) as fn(&ErrorSpread) -> f64),
                ("rms", |spread| spread.rms),
                ("std", |spread| spread.std),
                ("median_abs", |spread| spread.median_abs),
            ] {
                for axis in 0..3 {
                    let key = format!("{name}_{}_{unit}", COMPONENTS[axis]);
                    map.serialize_entry(&key, &(number(&self.spread_mm[axis]) / per_mm[axis]))?;
                }
            }
        }
        map.end()
    }
}
