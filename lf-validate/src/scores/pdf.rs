//! How errors are distributed.

use crate::scores::displacement::truth::Sample;
use crate::scores::units::{COMPONENTS, Unit};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// A probability density in bins of one width, one of them about zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Middle of each bin.
    pub x: Vec<f64>,
    /// Density in each bin, per unit of x; its integral is the share inside. NaN of nothing.
    pub density: Vec<f64>,
    /// Share of the values below the first bin.
    pub below: f64,
    /// Share of the values above the last bin.
    pub above: f64,
}

impl Histogram {
    /// The density of `values` in `2 reach + 1` bins, `per_unit` of them to a unit. A value between two bins counts in the
    /// upper one.
    pub fn of(values: &[f64], per_unit: f64, reach: usize) -> Self {
        let (mut counts, mut below, mut above) = (vec![0usize; 2 * reach + 1], 0, 0);
        for value in values {
            let bin = (value * per_unit + 0.5).floor() + reach as f64;
            if bin < 0.0 {
                below += 1;
            } else if let Some(count) = counts.get_mut(bin as usize) {
                *count += 1;
            } else {
                above += 1;
            }
        }
        let share = |count: usize| count as f64 / values.len() as f64;
        Self {
            x: (0..counts.len()).map(|bin| (bin as f64 - reach as f64) / per_unit).collect(),
            density: counts.iter().map(|&count| share(count) * per_unit).collect(),
            below: share(below),
            above: share(above),
        }
    }
}

/// Bins to a unit: u, v and w in pixels. Those of w are ten times wider, for depth is seen under an angle of some tenths.
pub const BINS_PER_PX: [f64; 3] = [20.0, 20.0, 2.0];

/// Bins to a unit: u, v and w in voxels, which are long where the depth is.
pub const BINS_PER_VOX: [f64; 3] = [20.0; 3];

/// Bins on either side of the middle one: to 4 px and 40 px, or to 4 voxels. The bins are the same for any two fields in one
/// unit, so that their curves can be laid over each other.
pub const REACH: usize = 80;

/// Density of the error of each component. In JSON `x_u`, the middles of the bins in `unit`, `u`, the density there per
/// `unit`, and `below_u` and `above_u`, the shares beyond the bins.
#[derive(Debug, Clone, PartialEq)]
pub struct Pdf {
    /// `px` where the camera is known, else `vox`.
    pub unit: &'static str,
    /// That of u, v, w.
    pub curves: [Histogram; 3],
}

impl Pdf {
    /// The densities of the errors in the last of `units`; none where it has no length.
    pub fn of(samples: &[Sample], units: &[Unit]) -> Option<Self> {
        let &(unit, length_mm) = units.last()?;
        if length_mm.iter().any(|length| *length <= 0.0) {
            return None;
        }
        let per_unit = if unit == "px" { BINS_PER_PX } else { BINS_PER_VOX };
        let curves = [0, 1, 2].map(|axis| {
            let errors: Vec<f64> = samples.iter().map(|sample| sample.error_mm[axis] / length_mm[axis]).collect();
            Histogram::of(&errors, per_unit[axis], REACH)
        });
        Some(Self { unit, curves })
    }
}

impl Serialize for Pdf {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("unit", self.unit)?;
        for (name, curve) in COMPONENTS.iter().zip(&self.curves) {
            map.serialize_entry(&format!("x_{name}"), &curve.x)?;
            map.serialize_entry(name, &curve.density)?;
            map.serialize_entry(&format!("below_{name}"), &curve.below)?;
            map.serialize_entry(&format!("above_{name}"), &curve.above)?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::units::units;

    fn sample(error_mm: [f64; 3]) -> Sample {
        Sample { error_mm, stated_mm: [f64::NAN; 3], is_measured: true }
    }

    #[test]
    fn bins_by_hand() {
        // Bins of 0.5 from -1.25 to 1.25: two below, one in each of three, one above.
        let found = Histogram::of(&[-1.3, -7.0, -1.25, 0.2, 0.25, 1.25, 1.2, 0.3], 2.0, 2);
        assert_eq!(found.x, [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(found.density, [0.25, 0.0, 0.25, 0.5, 0.25]);
        assert_eq!((found.below, found.above), (0.25, 0.125));
        let integral: f64 = found.density.iter().map(|density| density * 0.5).sum();
        assert_eq!(integral, 1.0 - found.below - found.above);
        let nothing = Histogram::of(&[], 2.0, 2);
        assert!(nothing.density.iter().all(|density| density.is_nan()) && nothing.below.is_nan());
    }

    #[test]
    fn pixels_where_there_are_some_and_else_voxels() {
        let samples = [sample([0.01, 0.02, 0.1]), sample([-0.05, 0.0, 0.41])];
        let px = Pdf::of(&samples, &units([0.01, 0.02, 0.1], Some(0.01))).unwrap();
        assert_eq!((px.unit, px.curves[0].x.len(), px.curves[0].x[83]), ("px", 161, 0.15));
        // 1 px and beyond; 10 px and beyond.
        assert_eq!((px.curves[0].density[100], px.curves[0].below), (10.0, 0.5));
        assert_eq!((px.curves[2].density[100], px.curves[2].above), (1.0, 0.5));
        let vox = Pdf::of(&samples, &units([0.01, 0.02, 0.1], None)).unwrap();
        assert_eq!((vox.unit, vox.curves[1].density[100], vox.curves[2].above), ("vox", 10.0, 0.5));
        assert_eq!(Pdf::of(&samples, &units([0.0; 3], None)), None);
    }
}
