//! The noise of a field, from the field alone.

use crate::scores::units::{AXES, COMPONENTS, Unit, in_px, units};
use lf_core::statistics::{median, robust};
use lf_core::{Field, field::MEASURED};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// An axis with fewer third differences is not used: from this many the robust standard deviation is known to 12 %.
const LEAST_DIFFERENCES: usize = 100;

/// A third difference f0 - 3 f1 + 3 f2 - f3 of independent errors has the variance (1 + 9 + 9 + 1) sigma^2.
const VARIANCE: f64 = 20.0;

/// Noise of one component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NoiseEstimate {
    pub sigma_mm: f64,
    /// Axis of the differences.
    pub axis: usize,
    pub differences: usize,
}

/// Noise of u, v and w.
///
/// It comes from third differences along each axis, between neighbours that share no data. Third differences remove a
/// flow up to its second derivative. The robust standard deviation about their median also removes a third derivative
/// that is constant. All that remains of the flow counts as noise, so that each component takes the axis with the
/// smallest estimate. Errors that neighbours share stay hidden.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldNoise {
    /// None if no axis has [`LEAST_DIFFERENCES`].
    estimates: [Option<NoiseEstimate>; 3],
    /// Median of the uncertainties that measured vectors state. NaN if none is stated.
    stated_mm: [f64; 3],
    units: Vec<Unit>,
}

/// The noise of `field`, from differences over `stride` vectors.
pub(super) fn noise(field: &Field, stride: [usize; 3], pixel_mm: Option<f64>) -> FieldNoise {
    let stated = |values: &Vec<f32>| {
        let measured = values.iter().zip(&field.flag).filter(|(_, flag)| **flag == MEASURED);
        let finite = measured.map(|(value, _)| f64::from(*value)).filter(|value| value.is_finite());
        median(&mut finite.collect::<Vec<f64>>())
    };
    FieldNoise {
        estimates: [&field.u, &field.v, &field.w].map(|values| estimate(field, values, stride)),
        stated_mm: [&field.su, &field.sv, &field.sw].map(stated),
        units: units(field.layout.voxel_mm, pixel_mm),
    }
}

/// Noise of one component: the smallest of the three axes.
fn estimate(field: &Field, values: &[f32], stride: [usize; 3]) -> Option<NoiseEstimate> {
    let along = |axis: usize| {
        let differences = third_differences(field, values, axis, stride[axis]);
        let sigma_mm = robust(&differences).1 / VARIANCE.sqrt();
        NoiseEstimate { sigma_mm, axis, differences: differences.len() }
    };
    let long_enough = [0, 1, 2].map(along).into_iter().filter(|found| found.differences >= LEAST_DIFFERENCES);
    long_enough.min_by(|a, b| a.sigma_mm.total_cmp(&b.sigma_mm))
}

/// Third differences of all sets of four measured vectors in line. A replaced vector has the errors of its neighbours.
fn third_differences(field: &Field, values: &[f32], axis: usize, stride: usize) -> Vec<f64> {
    let difference = |first: usize| {
        let last = field.layout.neighbour(first, axis, 3 * stride as isize)?;
        let four = [0, 1, 2, 3].map(|n| first + n * (last - first) / 3);
        let is_measured = four.iter().all(|&at| field.flag[at] == MEASURED);
        let [a, b, c, d] = four.map(|at| f64::from(values[at]));
        is_measured.then_some((a - d) + 3.0 * (c - b))
    };
    (0..field.len()).filter_map(difference).collect()
}

impl FieldNoise {
    /// The noise of each component in pixels. NaN without an estimate; none without a camera.
    pub fn px(&self) -> Option<[f64; 3]> {
        in_px([0, 1, 2].map(|axis| self.sigma_mm(axis)), &self.units)
    }

    /// The noise of a component. NaN without an estimate.
    pub(crate) fn sigma_mm(&self, component: usize) -> f64 {
        self.estimates[component].map_or(f64::NAN, |estimate| estimate.sigma_mm)
    }
}

impl Serialize for FieldNoise {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (n, name) in COMPONENTS.iter().enumerate() {
            for (unit, per_mm) in &self.units {
                map.serialize_entry(&format!("sigma_{name}_{unit}"), &(self.sigma_mm(n) / per_mm[n]))?;
            }
            for (unit, per_mm) in &self.units {
                map.serialize_entry(&format!("stated_{name}_{unit}"), &(self.stated_mm[n] / per_mm[n]))?;
            }
            map.serialize_entry(&format!("axis_{name}"), &self.estimates[n].map(|estimate| AXES[estimate.axis]))?;
            let differences = self.estimates[n].map(|estimate| estimate.differences);
            map.serialize_entry(&format!("differences_{name}"), &differences)?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::{disturb, field};
    use lf_core::field::NO_DATA;

    #[test]
    fn added_noise_is_found() {
        // The flow is quadratic along every axis. It changes by 2 mm across the field, a thousand times the noise.
        let flow = |[x, y, z]: [f64; 3]| [0.01 * x * x - 0.3 * y * y, 0.02 * y * z, 0.1 + 0.001 * z * z + 0.1 * x * y];
        let sigma = [0.002, 0.001, 0.03];
        for stride in [[1, 1, 1], [2, 3, 1]] {
            let mut found = field([40, 36, 30], flow);
            disturb(&mut found, sigma, 7);
            let found = noise(&found, stride, Some(0.01));
            for n in 0..3 {
                let ratio = found.sigma_mm(n) / sigma[n];
                assert!((ratio - 1.0).abs() < 0.05, "{stride:?} component {n}: {ratio}");
            }
            assert!((found.px().unwrap()[2] - 3.0).abs() < 0.15);
        }
    }

    #[test]
    fn the_axis_with_the_smallest_estimate_counts_if_it_is_long_enough() {
        // The third difference of a cubic along x is constant. A fast wave along x is not seen along y.
        let quiet = noise(&field([40, 12, 4], |[x, ..]| [0.1 * x * x * x, (9.0 * x).sin(), 0.0]), [1; 3], None);
        assert!(quiet.sigma_mm(0) < 1e-4 && quiet.sigma_mm(1) < 1e-6 && quiet.sigma_mm(2) == 0.0);
        assert_eq!(quiet.estimates[1].map(|estimate| (estimate.axis, estimate.differences)), Some((1, 40 * 9 * 4)));
        // 3 x 8 x 4 differences along x, none along the others.
        let short = noise(&field([6, 8, 4], |_| [0.0; 3]), [1, 3, 2], Some(0.01));
        assert_eq!(short.estimates, [None; 3]);
        assert!(short.px().unwrap()[0].is_nan());
        let text = serde_json::to_string(&short).unwrap();
        assert!(text.contains(r#""sigma_u_px":null"#) && text.contains(r#""axis_w":null"#), "{text}");
    }

    #[test]
    fn gaps_are_left_out_and_stated_uncertainties_are_given() {
        let mut found = field([20, 10, 4], |_| [0.0; 3]);
        for at in [5, 300, 301, 799] {
            found.flag[at] = NO_DATA;
            found.u[at] = f32::NAN;
            found.su[at] = 9.0;
        }
        found.su[..3].copy_from_slice(&[0.1, 0.3, 0.2]);
        let found = noise(&found, [1; 3], None);
        assert_eq!(found.sigma_mm(0), 0.0);
        assert!((found.stated_mm[0] - 0.2).abs() < 1e-7 && found.stated_mm[1].is_nan());
    }
}
