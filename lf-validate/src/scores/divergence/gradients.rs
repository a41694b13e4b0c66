//! The divergence of a field: how far it is from a flow that keeps its volume. It needs no truth.

use super::noise::{FieldNoise, noise};
use crate::scores::distribution::{Density, ErrorSpread};
use glam::DVec3;
use lf_core::{Field, VectorGrid, field::NO_DATA, statistics::robust};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// Bins of the density in one robust standard deviation of the divergence.
const BINS_PER_SIGMA: f64 = 5.0;

/// Bins on either side of the middle one: to 8 robust standard deviations.
const REACH: usize = 40;

/// Divergence and noise of a field. Divergences have no unit: change of volume over volume between the two volumes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Divergence {
    /// Vectors of the field.
    places: usize,
    no_data: usize,
    /// Size of a pixel at the focal plane. Without a camera it is absent, and so is every `px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) pixel_mm: Option<f64>,
    /// Voxel spacing of the volumes correlated.
    pub(crate) voxel_mm: [f64; 3],
    /// Vectors from one to the next that shares no data with it; see `stride`.
    pub stride: [usize; 3],
    stride_mm: [f64; 3],
    /// Places with data at all six neighbours a stride away. Replaced vectors count as data.
    pub count: usize,
    mean: f64,
    /// Root mean square of the divergence.
    pub rms: f64,
    /// Median of its absolute value.
    median_abs: f64,
    /// Its robust standard deviation.
    sigma: f64,
    /// Root mean square of all nine gradients of the displacement at all places.
    pub(crate) rms_gradient: f64,
    /// `rms` over the root of the mean of (du/dx)^2 + (dv/dy)^2 + (dw/dz)^2. It is 0 for a flow that keeps its volume,
    /// and 1 where the three are independent, as those of noise are. A flow of rotation and shear alone has no such
    /// gradients: it also gives 1, from its noise, and NaN without noise.
    relative: f64,
    /// RMS divergence of the noise alone: the root of the sum of sigma^2 / (2 stride_mm^2) over the axes.
    pub(crate) rms_of_noise: f64,
    /// Noise of the components.
    pub noise: FieldNoise,
    /// Density of the divergence, with [`BINS_PER_SIGMA`] bins in a `sigma`. None if `sigma` is 0 or does not exist.
    #[serde(serialize_with = "as_divergence")]
    pub(crate) pdf: Option<Density>,
}

/// Vectors along each axis that an interrogation window covers, rounded up, and at least one. Windows so far apart
/// share no data.
fn stride(layout: &VectorGrid) -> [usize; 3] {
    // Rounding of the product may exceed a whole number by this much.
    const ROUNDING: f64 = 1e-6;
    [0, 1, 2].map(|axis| (layout.window_in_spacings(axis) - ROUNDING).ceil().max(1.0) as usize)
}

/// Divergence and noise of `field`, by differences over a `stride` to either side. `pixel_mm`: size of a pixel at the
/// focal plane.
pub fn divergence(field: &Field, pixel_mm: Option<f64>) -> Divergence {
    let stride = stride(&field.layout);
    let stride_mm = [0, 1, 2].map(|axis| stride[axis] as f64 * field.layout.spacing_mm[axis]);
    let gradients: Vec<[DVec3; 3]> = (0..field.len()).filter_map(|at| gradient(field, at, stride, stride_mm)).collect();
    let divergences: Vec<f64> = gradients.iter().map(|[x, y, z]| x.x + y.y + z.z).collect();
    let count = gradients.len() as f64;
    let squares = |numbers: &[f64]| numbers.iter().map(|number| number * number).sum::<f64>();
    let straight = gradients.iter().map(|[x, y, z]| squares(&[x.x, y.y, z.z])).sum::<f64>() / count;
    let all = gradients.iter().map(|g| squares(g.map(|d| d.to_array()).as_flattened())).sum::<f64>() / (9.0 * count);
    let spread = ErrorSpread::of(&divergences);
    let (_, sigma) = robust(&divergences);
    let noise = noise(field, stride, pixel_mm);
    let of_noise = |axis: usize| 0.5 * (noise.sigma_mm(axis) / stride_mm[axis]).powi(2);
    Divergence {
        places: field.len(),
        no_data: field.flag.iter().filter(|flag| **flag == NO_DATA).count(),
        pixel_mm,
        voxel_mm: field.layout.voxel_mm,
        stride,
        stride_mm,
        count: gradients.len(),
        mean: spread.bias,
        rms: spread.rms,
        median_abs: spread.median_abs,
        sigma,
        rms_gradient: all.sqrt(),
        relative: spread.rms / straight.sqrt(),
        rms_of_noise: (0..3).map(of_noise).sum::<f64>().sqrt(),
        noise,
        pdf: (sigma > 0.0).then(|| Density::of(&divergences, BINS_PER_SIGMA / sigma, REACH)),
    }
}

/// Derivatives of the displacement along x, y and z at a place, by central differences. None if one of the six
/// neighbours has no data.
fn gradient(field: &Field, at: usize, stride: [usize; 3], stride_mm: [f64; 3]) -> Option<[DVec3; 3]> {
    let mut gradient = [DVec3::ZERO; 3];
    for axis in 0..3 {
        let steps = stride[axis] as isize;
        let low = field.layout.neighbour(at, axis, -steps)?;
        let high = field.layout.neighbour(at, axis, steps)?;
        if field.flag[low] == NO_DATA || field.flag[high] == NO_DATA {
            return None;
        }
        gradient[axis] = (field.displacement_mm(high) - field.displacement_mm(low)) / (2.0 * stride_mm[axis]);
    }
    Some(gradient)
}

fn as_divergence<S: Serializer>(pdf: &Option<Density>, serializer: S) -> Result<S::Ok, S::Error> {
    let Some(density) = pdf else { return serializer.serialize_none() };
    let mut map = serializer.serialize_map(None)?;
    density.serialize_as("divergence", &mut map)?;
    map.end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::{disturb, field};
    use lf_core::flow::Flows;

    /// A flow on the vectors of the field.
    fn flowing(shape: [usize; 3], text: &str) -> Field {
        let flows: Flows = serde_json::from_str(text).unwrap();
        let flow = flows.velocity(Vec::new(), [[-2.0, 2.0]; 3], 0.0055);
        field(shape, |place| flow.at(place.into()).to_array())
    }

    #[test]
    fn the_stride_is_the_vectors_of_a_window() {
        // Spacings of 0.5, 0.25 and 2 mm, voxels of 0.01, 0.02 and 0.1 mm.
        let mut layout = field([2, 2, 2], |_| [0.0; 3]).layout;
        assert_eq!(stride(&layout), [1, 1, 1]);
        layout.window = [200, 50, 10];
        assert_eq!(stride(&layout), [4, 4, 1]);
        layout.window = [201, 51, 21];
        assert_eq!(stride(&layout), [5, 5, 2]);
        // 32 voxels of 0.01 mm over 0.08 mm are 4.000000000000001.
        (layout.window[0], layout.spacing_mm[0]) = (32, 0.08);
        assert_eq!(stride(&layout)[0], 4);
    }

    #[test]
    fn a_flow_that_keeps_its_volume_has_no_divergence() {
        let abc = r#"{"kind": "abc", "wavelength_mm": 9.0, "displacement_mm": [0.1, 0.07, 0.04]}"#;
        let turn = r#"{"kind": "rotation", "axis": [1, -2, 3], "angle_rad": 0.2}"#;
        let shear = r#"{"kind": "shear", "along": "z", "across": "x", "rate": 0.1}"#;
        for flow in [abc, turn, shear] {
            for window in [[0; 3], [100, 25, 20]] {
                let mut flow = flowing([9, 10, 8], flow);
                flow.layout.window = window;
                let found = divergence(&flow, None);
                assert!(found.rms < 1e-6 && found.rms_gradient > 1e-3, "{found:?}");
                assert!(found.count > 100);
            }
        }
        // It has no straight gradients to compare with.
        assert!(divergence(&flowing([9, 10, 8], turn), None).relative.is_nan());
    }

    #[test]
    fn relative_is_0_where_gradients_balance() {
        let strain = divergence(&field([9, 10, 8], |[x, y, z]| [0.02 * x, 0.01 * y, -0.03 * z]), None);
        assert!(strain.relative < 1e-5 && strain.rms < 1e-6);
        // 4 + 1 + 9 over nine.
        assert!((strain.rms_gradient - 0.01 * (14.0f64 / 9.0).sqrt()).abs() < 1e-7);
    }

    /// A central difference over a stride h replaces k by sin(k h) / h, and the strides differ.
    #[test]
    fn taylor_and_green_have_the_error_of_differences() {
        let text = r#"{"kind": "taylor-green", "wavelength_mm": 12.0, "displacement_mm": 0.1}"#;
        let flow = flowing([9, 10, 8], text);
        let found = divergence(&flow, None);
        let k = std::f64::consts::TAU / 12.0;
        let seen = |h: f64| (k * h).sin() / h;
        let by_hand =
            |[x, y, z]: [f64; 3]| 0.1 * (seen(0.5) - seen(0.25)) * (k * x).cos() * (k * y).cos() * (k * z).cos();
        let inner = (0..flow.len()).filter(|&at| gradient(&flow, at, [1; 3], [1.0; 3]).is_some());
        let squares: Vec<f64> = inner.map(|at| by_hand(flow.place_mm(at)).powi(2)).collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((found.rms - rms).abs() < 1e-6 && rms > 1e-4, "{} against {rms}", found.rms);
    }

    #[test]
    fn an_expansion_has_its_rate() {
        let found = divergence(&field([5, 6, 7], |place| place.map(|x| 0.01 * x)), None);
        assert_eq!((found.count, found.stride, found.stride_mm), (3 * 4 * 5, [1; 3], [0.5, 0.25, 2.0]));
        for number in [found.mean, found.rms, found.median_abs] {
            assert!((number - 0.03).abs() < 1e-8, "{number}");
        }
        assert!((found.rms_gradient - 0.01 / 3f64.sqrt()).abs() < 1e-8 && (found.relative - 3f64.sqrt()).abs() < 1e-6);
    }

    /// Noise gives the divergence predicted from it, and no gradients balance.
    #[test]
    fn noise_gives_its_divergence() {
        for window in [[0; 3], [100, 25, 20]] {
            let mut found = field([44, 40, 36], |_| [0.0; 3]);
            found.layout.window = window;
            disturb(&mut found, [0.002, 0.001, 0.008], 3);
            let found = divergence(&found, Some(0.01));
            assert!((found.relative - 1.0).abs() < 0.02, "{}", found.relative);
            assert!((found.rms_of_noise / found.rms - 1.0).abs() < 0.03, "{} of {}", found.rms_of_noise, found.rms);
            assert!((found.sigma / found.rms - 1.0).abs() < 0.03 && found.mean.abs() < 0.05 * found.rms);
            let curve = found.pdf.unwrap();
            // The density of a normal distribution in its middle, and no value beyond 8 sigma.
            assert!((curve.density[REACH] * found.sigma - 0.399).abs() < 0.02);
            assert_eq!((curve.x.len(), curve.x[REACH], curve.below, curve.above), (81, 0.0, 0.0, 0.0));
            assert!((curve.x[2 * REACH] / found.sigma - 8.0).abs() < 1e-12);
        }
    }

    #[test]
    fn gaps_are_left_out() {
        let mut expansion = field([5, 5, 5], |place| place.map(|x| 0.01 * x));
        // In the middle of 3 x 3 x 3 places: the six around it lose a neighbour, and it does not use its own vector.
        expansion.flag[62] = NO_DATA;
        expansion.u[62] = f32::NAN;
        let found = divergence(&expansion, None);
        assert_eq!((found.count, found.no_data), (21, 1));
        assert!((found.rms - 0.03).abs() < 1e-8);
    }

    #[test]
    fn a_score_of_a_field_that_is_too_small_is_null() {
        let mut small = field([4, 4, 4], |_| [0.0; 3]);
        small.layout.window = [100, 25, 40];
        let found = serde_json::to_value(divergence(&small, None)).unwrap();
        assert_eq!((&found["count"], &found["stride"]), (&0.into(), &serde_json::json!([2, 2, 2])));
        for key in ["mean", "rms", "median_abs", "sigma", "rms_gradient", "relative", "rms_of_noise", "pdf"] {
            assert!(found[key].is_null(), "{key}");
        }
        assert!(found["noise"]["sigma_u_mm"].is_null() && found.get("pixel_mm").is_none());
    }
}
