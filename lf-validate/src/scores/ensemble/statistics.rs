//! The statistics of many fields, the numbers printed about them and the arrays written for ParaView.

use lf_core::Field;
use lf_core::field::{Array, NO_DATA};
use serde::Serialize;

/// Statistics of a number of fields. Lists have one number a place, in the order of a field's components, and NaN where
/// it does not exist.
#[derive(Debug, Clone, PartialEq)]
pub struct Ensemble {
    /// Fields added.
    pub fields: usize,
    /// Measured vectors at each place.
    pub count: Vec<f32>,
    /// Mean displacement. Its uncertainty is that of the mean, from the scatter of the fields, and NaN for a single
    /// vector. `peak` and `ratio` are means; `count`, the particle images, is a sum over the fields. Places with too
    /// few vectors have no data.
    pub mean: Field,
    /// Root mean square of the fluctuations of u, v and w, mm, with n - 1.
    pub rms_mm: [Vec<f32>; 3],
    /// Mean products of the fluctuations uv, uw and vw, mm^2, with n - 1: the Reynolds stresses without density and
    /// sign.
    pub products_mm2: [Vec<f32>; 3],
    /// Vorticity of the mean: curl of the displacement between the two volumes. It has no unit, or 1/s if the time
    /// between them is known. Central differences of neighbours, one-sided beside a gap.
    pub vorticity: [Vec<f32>; 3],
}

/// The numbers that `lf-validate ensemble` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnsembleSummary {
    /// Fields added.
    pub fields: usize,
    /// Vectors of the field.
    pub places: usize,
    /// Places with fewer measured vectors than asked for.
    pub no_data: usize,
    /// Share of measured vectors among all vectors of all fields.
    pub measured_share: f64,
    /// RMS of the mean displacement over the places, mm.
    pub displacement_mm: [f64; 3],
    /// RMS of the fluctuations over the places, mm. They include the noise of the measurement.
    pub fluctuation_mm: [f64; 3],
    /// RMS of the standard uncertainty of the mean over the places, mm.
    pub uncertainty_mm: [f64; 3],
    /// RMS of the vorticity's components over the places, in `vorticity_unit`.
    pub vorticity: [f64; 3],
    /// `1/s`, or `1` if the time between the volumes is not known.
    pub vorticity_unit: &'static str,
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
            displacement_mm: [&mean.u, &mean.v, &mean.w].map(|values| root_mean_square(values, &mean.flag)),
            fluctuation_mm: self.rms_mm.each_ref().map(|values| root_mean_square(values, &mean.flag)),
            uncertainty_mm: [&mean.su, &mean.sv, &mean.sw].map(|values| root_mean_square(values, &mean.flag)),
            vorticity: self.vorticity.each_ref().map(|values| root_mean_square(values, &mean.flag)),
            vorticity_unit: self.vorticity_unit(),
        }
    }

    /// Unit of the vorticity.
    pub fn vorticity_unit(&self) -> &'static str {
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

/// Root mean square of the finite values at places with data.
fn root_mean_square(values: &[f32], flag: &[f32]) -> f64 {
    let known = values.iter().zip(flag).filter(|(value, flag)| **flag != NO_DATA && value.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, n), (value, _)| (sum + f64::from(*value).powi(2), n + 1.0));
    (sum / count).sqrt()
}
