//! The statistics of many fields, the numbers printed about them and the arrays written for ParaView.

use crate::scores::distribution::root_mean;
use lf_core::Field;
use lf_core::field::{Array, NO_DATA};
use serde::Serialize;

/// Statistics of a number of fields. Lists have one number a place, in the order of a field's components, and NaN where
/// it does not exist.
#[derive(Debug, Clone, PartialEq)]
pub struct Ensemble {
    /// Number of fields.
    pub fields: usize,
    /// Measured vectors at each place.
    pub(crate) count: Vec<f32>,
    /// Mean displacement. Its uncertainty is that of the mean, from the scatter of the fields, and NaN for a single
    /// vector. `peak` and `ratio` are means; `count`, the particle images, is a sum over the fields. Places with too
    /// few vectors have no data.
    pub mean: Field,
    /// Root mean square of the fluctuations of u, v and w, with n - 1.
    pub(crate) rms_mm: [Vec<f32>; 3],
    /// Mean products of the fluctuations uv, uw and vw, with n - 1: the Reynolds stresses without density and sign.
    pub(crate) products_mm2: [Vec<f32>; 3],
    /// Vorticity of the mean, without unit, or in 1/s if the time between the volumes is known. Central differences of
    /// neighbours, one-sided beside a gap.
    pub(crate) vorticity: [Vec<f32>; 3],
}

/// The numbers that `lf-validate ensemble` prints. The four of each component are RMS over the places.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnsembleSummary {
    pub(super) fields: usize,
    pub(super) places: usize,
    pub(super) no_data: usize,
    /// Share of measured vectors among all vectors of all fields.
    pub(super) measured_share: f64,
    displacement_mm: [f64; 3],
    /// Includes the noise of the measurement.
    fluctuation_mm: [f64; 3],
    /// Standard uncertainty of the mean.
    uncertainty_mm: [f64; 3],
    vorticity: [f64; 3],
    vorticity_unit: &'static str,
}

impl Ensemble {
    /// The numbers that are printed.
    pub fn summary(&self) -> EnsembleSummary {
        let mean = &self.mean;
        let measured: f64 = self.count.iter().map(|count| f64::from(*count)).sum();
        EnsembleSummary {
            fields: self.fields,
            places: mean.len(),
            no_data: mean.flag.iter().filter(|flag| **flag == NO_DATA).count(),
            measured_share: measured / (mean.len() * self.fields) as f64,
            displacement_mm: self.displacement_mm(),
            fluctuation_mm: self.rms(self.rms_mm.each_ref()),
            uncertainty_mm: self.uncertainty_mm(),
            vorticity: self.rms(self.vorticity.each_ref()),
            vorticity_unit: self.vorticity_unit(),
        }
    }

    /// RMS of the mean displacement over the places, mm.
    pub(super) fn displacement_mm(&self) -> [f64; 3] {
        self.rms([&self.mean.u, &self.mean.v, &self.mean.w])
    }

    /// RMS of the mean's uncertainty over the places, mm.
    pub(super) fn uncertainty_mm(&self) -> [f64; 3] {
        self.rms([&self.mean.su, &self.mean.sv, &self.mean.sw])
    }

    /// Root mean square of the finite values at places with data.
    fn rms(&self, components: [&Vec<f32>; 3]) -> [f64; 3] {
        components.map(|values| {
            let with_data = values.iter().zip(&self.mean.flag).filter(|(_, flag)| **flag != NO_DATA);
            root_mean(with_data.filter(|(value, _)| value.is_finite()).map(|(value, _)| f64::from(*value).powi(2)))
        })
    }

    pub(crate) fn vorticity_unit(&self) -> &'static str {
        if self.mean.layout.dt_s.is_some() { "1/s" } else { "1" }
    }

    /// The arrays of a `.vti`. With the time between the volumes known they include velocities.
    pub fn to_arrays(&self) -> Vec<Array> {
        let mean = &self.mean;
        let vectors = |name, values: &[Vec<f32>; 3]| Array::vectors(name, values.each_ref().map(Vec::as_slice));
        let mut arrays = vec![
            Array::vectors("mean_mm", [&mean.u, &mean.v, &mean.w]),
            vectors("rms_mm", &self.rms_mm),
            vectors("products_uv_uw_vw_mm2", &self.products_mm2),
            Array::vectors("uncertainty_of_mean_mm", [&mean.su, &mean.sv, &mean.sw]),
            Array::scalars("fields", &self.count),
            Array::scalars("flag", &mean.flag),
            Array::scalars("peak", &mean.peak),
        ];
        let Some(dt_s) = mean.layout.dt_s else {
            arrays.push(vectors("vorticity", &self.vorticity));
            return arrays;
        };
        let per_second = |values: &[f32]| values.iter().map(|mm| (f64::from(*mm) / dt_s) as f32).collect::<Vec<f32>>();
        let [u, v, w] = [&mean.u, &mean.v, &mean.w].map(|values| per_second(values));
        arrays.insert(0, Array::vectors("mean_mm_s", [&u, &v, &w]));
        arrays.insert(1, vectors("rms_mm_s", &self.rms_mm.each_ref().map(|values| per_second(values))));
        arrays.push(vectors("vorticity_1_s", &self.vorticity));
        arrays
    }
}

/// Curl of the displacement, divided by the time between the volumes if it is known.
pub(super) fn vorticity(field: &Field) -> [Vec<f32>; 3] {
    let time = field.layout.dt_s.unwrap_or(1.0);
    let components = [&field.u, &field.v, &field.w];
    std::array::from_fn(|axis| {
        let [one, other] = [(axis + 1) % 3, (axis + 2) % 3];
        let curl = |i: usize| slope(field, components[other], one, i) - slope(field, components[one], other, i);
        (0..field.len()).map(|i| (curl(i) / time) as f32).collect()
    })
}

/// Derivative of a component along an axis. NaN without data there or in a neighbour.
fn slope(field: &Field, values: &[f32], axis: usize, i: usize) -> f64 {
    let found = field.layout.difference(i, axis, |n| field.flag[n] != NO_DATA);
    found.map_or(f64::NAN, |found| (f64::from(values[found.high]) - f64::from(values[found.low])) / found.distance_mm)
}
