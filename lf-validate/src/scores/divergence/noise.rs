//! The noise of a field, from nothing but the field.

use crate::scores::units::{AXES, COMPONENTS, Unit, units};
use lf_core::field::{Field, MEASURED};
use lf_core::statistics::{median, robust};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// An axis with fewer third differences than this says nothing: of so many the robust standard deviation is known to 12 %.
pub const LEAST_DIFFERENCES: usize = 100;

/// A third difference f0 - 3 f1 + 3 f2 - f3 of independent errors has the variance (1 + 9 + 9 + 1) sigma^2.
const VARIANCE: f64 = 20.0;

/// Noise of one component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Standard deviation, mm.
    pub sigma_mm: f64,
    /// The axis that it was found along.
    pub axis: usize,
    /// Third differences along that axis.
    pub differences: usize,
}

/// Noise of u, v and w.
///
/// From third differences along each axis at neighbours that share no data: they take away all of a flow up to its second
/// derivative, and the robust standard deviation about their median takes the third where it is even. What is left of
/// the flow counts as noise, so each component takes the axis that says least. Errors that neighbours share are not seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// None where no axis has [`LEAST_DIFFERENCES`].
    pub estimates: [Option<Estimate>; 3],
    /// Median uncertainty stated of measured vectors, mm; NaN where none is.
    pub stated_mm: [f64; 3],
    units: Vec<Unit>,
}

/// The noise of `field`, from differences over `stride` vectors; `pixel_mm` is a pixel at the focal plane.
pub fn noise(field: &Field, stride: [usize; 3], pixel_mm: Option<f64>) -> Noise {
    let stated = |values: &[f32]| {
        let measured = values.iter().zip(&field.flag).filter(|(_, flag)| **flag == MEASURED);
        let finite = measured.map(|(value, _)| f64::from(*value)).filter(|value| value.is_finite());
        median(&mut finite.collect::<Vec<f64>>())
    };
    Noise {
        estimates: [&field.u, &field.v, &field.w].map(|values| estimate(field, values, stride)),
        stated_mm: [&field.su, &field.sv, &field.sw].map(|values| stated(values)),
        units: units(field.layout.voxel_mm, pixel_mm),
    }
}

fn estimate(field: &Field, values: &[f32], stride: [usize; 3]) -> Option<Estimate> {
    let along = |axis: usize| {
        let differences = third_differences(field, values, axis, stride[axis]);
        let sigma_mm = robust(&differences).1 / VARIANCE.sqrt();
        Estimate { sigma_mm, axis, differences: differences.len() }
    };
    let long_enough = [0, 1, 2].map(along).into_iter().filter(|found| found.differences >= LEAST_DIFFERENCES);
    long_enough.min_by(|a, b| a.sigma_mm.total_cmp(&b.sigma_mm))
}

/// Those of four vectors in line that were all measured: one replaced from its neighbours has their errors.
fn third_differences(field: &Field, values: &[f32], axis: usize, stride: usize) -> Vec<f64> {
    let shape = field.layout.shape;
    let step: usize = shape[..axis].iter().product();
    let difference = |at: usize| {
        if at / step % shape[axis] + 3 * stride >= shape[axis] {
            return None;
        }
        let line = [0, 1, 2, 3].map(|n| at + n * stride * step);
        let has_data = line.iter().all(|&at| field.flag[at] == MEASURED);
        let [a, b, c, d] = line.map(|at| f64::from(values[at]));
        has_data.then_some((a - d) + 3.0 * (c - b))
    };
    (0..field.len()).filter_map(difference).collect()
}

impl Noise {
    /// The noise of each component in pixels, NaN where there is no estimate; none without a pixel's size.
    pub fn px(&self) -> Option<[f64; 3]> {
        let (_, per) = self.units.iter().find(|(unit, _)| *unit == "px")?;
        Some([0, 1, 2].map(|axis| self.sigma_mm(axis) / per[axis]))
    }

    /// The noise of a component, mm; NaN where there is no estimate.
    pub fn sigma_mm(&self, component: usize) -> f64 {
        self.estimates[component].map_or(f64::NAN, |estimate| estimate.sigma_mm)
    }
}

impl Serialize for Noise {
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
pub(crate) mod tests {
    use super::*;
    use crate::scores::displacement::trilinear::tests::field;
    use lf_core::field::NO_DATA;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    /// Adds independent normal errors to every vector.
    pub(crate) fn disturb(field: &mut Field, sigma_mm: [f64; 3], seed: u64) {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        for (component, sigma) in [&mut field.u, &mut field.v, &mut field.w].into_iter().zip(sigma_mm) {
            for value in component {
                let normal: f64 = StandardNormal.sample(&mut random);
                *value += (sigma * normal) as f32;
            }
        }
    }

    #[test]
    fn noise_that_was_added_comes_back() {
        // The flow is quadratic along every axis: 2 mm across the field, a thousand times the noise.
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
    fn the_axis_that_says_least_and_none_that_is_short() {
        // A cubic along x is even in its third difference; a fast wave along x is not, and y sees nothing of it.
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
    fn gaps_are_left_out_and_what_is_stated_stands_beside() {
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
