//! How well the stated uncertainty covers the errors.

use super::truth::VectorError;
use crate::scores::units::COMPONENTS;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

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

#[cfg(test)]
mod tests {
    use super::*;
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
}
