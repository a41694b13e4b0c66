//! How the errors of a field are distributed.

use super::truth::VectorError;
use crate::scores::density::Density;
use crate::scores::units::{COMPONENTS, Unit};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

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
