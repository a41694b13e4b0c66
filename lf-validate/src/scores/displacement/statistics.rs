//! Statistics of a set of errors: spread and outliers, coverage by the stated uncertainty, density.

use super::truth::VectorError;
use crate::scores::distribution::{Density, ErrorSpread};
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
        let spreads = self.spread_mm.map(|spread| spread.entries());
        for (unit, per_mm) in &self.units {
            for n in 0..spreads[0].len() {
                for (axis, spread) in spreads.iter().enumerate() {
                    let (name, number_mm) = spread[n];
                    map.serialize_entry(&format!("{name}_{}_{unit}", COMPONENTS[axis]), &(number_mm / per_mm[axis]))?;
                }
            }
        }
        map.end()
    }
}

/// Errors of measured vectors that state a standard uncertainty, for u, v and w; `within_1_u` in JSON. Normally
/// distributed errors with the stated uncertainty are within one of it in a share of 0.683 and within two in a share of
/// 0.954. NaN if no vector states one.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Number of these vectors.
    pub(crate) stated: [usize; 3],
    /// Share of their errors not larger than the stated uncertainty.
    pub within_1: [f64; 3],
    /// Share of their errors not larger than twice the stated uncertainty.
    pub(crate) within_2: [f64; 3],
    pub(crate) rms_stated_mm: [f64; 3],
    /// It equals `rms_stated_mm` if the stated uncertainty is right.
    pub(crate) rms_error_mm: [f64; 3],
}

impl Coverage {
    pub(super) fn of(errors: &[VectorError]) -> Self {
        // Error and stated uncertainty of each vector that has both.
        let pairs = [0, 1, 2].map(|axis| {
            let measured = errors.iter().filter(|error| error.is_measured);
            let pairs = measured.map(|error| (error.error_mm[axis], error.stated_mm[axis]));
            pairs.filter(|(_, stated)| stated.is_finite()).collect::<Vec<(f64, f64)>>()
        });
        let mean = |number: fn(&(f64, f64)) -> f64| {
            pairs.each_ref().map(|pairs| pairs.iter().map(number).sum::<f64>() / pairs.len() as f64)
        };
        Self {
            stated: pairs.each_ref().map(Vec::len),
            within_1: mean(|(error, stated)| f64::from(error.abs() <= *stated)),
            within_2: mean(|(error, stated)| f64::from(error.abs() <= 2.0 * stated)),
            rms_stated_mm: mean(|(_, stated)| stated * stated).map(f64::sqrt),
            rms_error_mm: mean(|(error, _)| error * error).map(f64::sqrt),
        }
    }
}

impl Serialize for Coverage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (axis, name) in COMPONENTS.iter().enumerate() {
            map.serialize_entry(&format!("stated_{name}"), &self.stated[axis])?;
            map.serialize_entry(&format!("within_1_{name}"), &self.within_1[axis])?;
            map.serialize_entry(&format!("within_2_{name}"), &self.within_2[axis])?;
            map.serialize_entry(&format!("rms_stated_{name}_mm"), &self.rms_stated_mm[axis])?;
            map.serialize_entry(&format!("rms_error_{name}_mm"), &self.rms_error_mm[axis])?;
        }
        map.end()
    }
}

/// Bins a pixel for u, v and w. The bins of w are ten times wider: the angle under which the camera sees depth is a few
/// tenths of a radian.
const BINS_PER_PX: [f64; 3] = [20.0, 20.0, 2.0];

/// Bins a voxel for u, v and w. Voxels are long along the depth.
const BINS_PER_VOX: [f64; 3] = [20.0; 3];

/// Bins on either side of the middle one: to 4 px and 40 px, or to 4 voxels. Any two fields in one unit have the same
/// bins, so that their curves can be compared.
const REACH: usize = 80;

/// Density of the error of u, v and w.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ErrorPdf {
    /// `px` with a camera, `vox` without one.
    pub unit: &'static str,
    pub curves: [Density; 3],
}

impl ErrorPdf {
    /// In the last of `units`. None if that unit has no length.
    pub(super) fn of(errors: &[VectorError], units: &[Unit]) -> Option<Self> {
        let &(unit, length_mm) = units.last()?;
        if length_mm.iter().any(|length| *length <= 0.0) {
            return None;
        }
        let per_unit = if unit == "px" { BINS_PER_PX } else { BINS_PER_VOX };
        let curves = [0, 1, 2].map(|axis| {
            let along: Vec<f64> = errors.iter().map(|error| error.error_mm[axis] / length_mm[axis]).collect();
            Density::of(&along, per_unit[axis], REACH)
        });
        Some(Self { unit, curves })
    }
}

impl Serialize for ErrorPdf {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("unit", self.unit)?;
        for (name, curve) in COMPONENTS.iter().zip(&self.curves) {
            curve.serialize_as(name, &mut map)?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::units::units;
    use glam::DVec3;

    #[test]
    fn shares_by_hand() {
        let error = |u: f64, su: f64, is_measured| VectorError {
            error_mm: DVec3::new(u, 0.0, 0.0),
            stated_mm: DVec3::new(su, f64::NAN, 0.0),
            is_measured,
        };
        let found = Coverage::of(&[
            error(1.0, 1.0, true),
            error(-3.0, 2.0, true),
            error(4.0, 1.0, true),
            error(0.0, f64::NAN, true),
            error(0.5, 2.0, true),
            error(9.0, 1.0, false),
        ]);
        assert_eq!(found.stated, [4, 0, 5]);
        assert_eq!((found.within_1[0], found.within_2[0]), (0.5, 0.75));
        assert_eq!((found.rms_stated_mm[0], found.rms_error_mm[0]), (2.5f64.sqrt(), (26.25f64 / 4.0).sqrt()));
        assert!(found.within_1[1].is_nan() && found.rms_stated_mm[1].is_nan());
        assert_eq!((found.within_1[2], found.rms_stated_mm[2]), (1.0, 0.0));
    }

    fn error(error_mm: [f64; 3]) -> VectorError {
        VectorError { error_mm: error_mm.into(), stated_mm: DVec3::NAN, is_measured: true }
    }

    #[test]
    fn bins_are_in_pixels_with_a_camera_else_in_voxels() {
        let errors = [error([0.01, 0.02, 0.1]), error([-0.05, 0.0, 0.41])];
        let px = ErrorPdf::of(&errors, &units([0.01, 0.02, 0.1], Some(0.01))).unwrap();
        assert_eq!((px.unit, px.curves[0].x.len(), px.curves[0].x[83]), ("px", 161, 0.15));
        // 1 px and beyond; 10 px and beyond.
        assert_eq!((px.curves[0].density[100], px.curves[0].below), (10.0, 0.5));
        assert_eq!((px.curves[2].density[100], px.curves[2].above), (1.0, 0.5));
        let vox = ErrorPdf::of(&errors, &units([0.01, 0.02, 0.1], None)).unwrap();
        assert_eq!((vox.unit, vox.curves[1].density[100], vox.curves[2].above), ("vox", 10.0, 0.5));
        assert_eq!(ErrorPdf::of(&errors, &units([0.0; 3], None)), None);
    }
}
