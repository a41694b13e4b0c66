//! The vectors of a field and their uncertainties, with every gap filled.

use super::errors::Correlated;
use super::fill::fill;
use super::spread::{box_mean, rms};
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::statistics::median;
use lf_core::{Field, Refusal, VectorGrid};

/// Standard uncertainties of u, v and w, mm, for fields that state none.
pub type TypedSigma = Option<[f64; 3]>;

/// Constant: a stated uncertainty counts as at least this share of the median one. Smaller ones are chance.
const MINIMUM_SHARE: f64 = 0.05;

/// Three components on the whole grid.
#[derive(Debug, Clone)]
pub struct Measured {
    /// u, v, w, mm. Gaps hold a smooth continuation of the measured vectors.
    pub(super) values: [Vec<f64>; 3],
    /// Standard uncertainties, mm: means over a window. A filled vector has the usual difference of a vector from its
    /// neighbours a window away.
    pub(super) sigma: [Vec<f64>; 3],
    /// Whether a vector is measured.
    pub(super) is_known: Vec<bool>,
    /// Residual of the solver that fills gaps, over its right side, if it stopped before its goal: the largest of u, v,
    /// w.
    pub unsolved: Option<f64>,
}

impl Measured {
    /// The measured vectors of a field; replaced and missing ones are filled. Refuses a field with fewer than two
    /// vectors along an axis, without a measured vector, or without uncertainties if none are typed.
    pub fn new(field: &Field, typed: TypedSigma) -> Result<Self, Refusal> {
        check_shape(&field.layout)?;
        let is_known: Vec<bool> = field.flag.iter().map(|flag| *flag == MEASURED).collect();
        Refusal::unless(is_known.contains(&true), || "no measured vector", "wanted vectors with flag 0")?;
        let errors = Correlated::new(&field.layout);
        let stated = [&field.su, &field.sv, &field.sw];
        let component = |c: usize, values: &Vec<f32>| {
            let values: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
            let (values, unsolved) = fill(&field.layout, &values, &is_known);
            let sigma = sigma(stated[c], typed.map(|typed| typed[c]), &is_known)?;
            let sigma = usual(&sigma, &is_known, &field.layout, &errors);
            let of_gaps = distance(field, &values, &is_known, &errors).max(2.0 * median(&mut known(&sigma, &is_known)));
            let sigma = sigma.iter().zip(&is_known).map(|(sigma, known)| if *known { *sigma } else { of_gaps });
            Ok::<_, Refusal>((values, sigma.collect::<Vec<f64>>(), unsolved))
        };
        let (u, su, of_u) = component(0, &field.u)?;
        let (v, sv, of_v) = component(1, &field.v)?;
        let (w, sw, of_w) = component(2, &field.w)?;
        let unsolved = [of_u, of_v, of_w].into_iter().flatten().reduce(f64::max);
        Ok(Self { values: [u, v, w], sigma: [su, sv, sw], is_known, unsolved })
    }

    /// Vectors that are not measured.
    pub fn filled(&self) -> usize {
        self.is_known.iter().filter(|known| !**known).count()
    }

    /// A field of new values and uncertainties. Vectors that were not measured are flagged as replaced.
    pub(super) fn field(&self, of: &Field, values: [&Vec<f64>; 3], sigma: [&Vec<f64>; 3]) -> Field {
        let stored = |values: &Vec<f64>| values.iter().map(|value| *value as f32).collect::<Vec<f32>>();
        let mut field = of.clone();
        [field.u, field.v, field.w] = values.map(stored);
        [field.su, field.sv, field.sw] = sigma.map(stored);
        field.flag = self.is_known.iter().map(|known| if *known { MEASURED } else { REPLACED }).collect();
        field
    }
}

/// Refuses a grid with fewer than two vectors along an axis: it has no slopes along it.
pub(super) fn check_shape(layout: &VectorGrid) -> Result<(), Refusal> {
    let [nx, ny, nz] = layout.shape;
    let found = || format!("{nx} x {ny} x {nz} vectors");
    Refusal::unless(nx.min(ny).min(nz) > 1, found, "wanted at least two vectors along every axis")
}

/// Uncertainties of a component wherever there is data, mm: the stated one, or the median of all if a vector states
/// none, like a replaced one. None if no vector states one.
pub(super) fn stated_mm(field: &Field, c: usize) -> Option<Vec<f64>> {
    let stated = |i: usize| Some(field.uncertainty_mm(i)[c]).filter(|sigma| sigma.is_finite() && *sigma >= 0.0);
    let has_data = |i: &usize| field.flag[*i] != NO_DATA;
    let mut all: Vec<f64> = (0..field.len()).filter(has_data).filter_map(stated).collect();
    let usual = if all.is_empty() { return None } else { median(&mut all) };
    Some((0..field.len()).map(|i| stated(i).unwrap_or(usual)).collect())
}

fn known(values: &[f64], is_known: &[bool]) -> Vec<f64> {
    values.iter().zip(is_known).filter(|(_, known)| **known).map(|(value, _)| *value).collect()
}

/// Uncertainties of one component: as stated, or the typed one where nothing is stated.
fn sigma(stated: &[f32], typed: Option<f64>, is_known: &[bool]) -> Result<Vec<f64>, Refusal> {
    let is_stated = |value: &f32| value.is_finite() && *value >= 0.0;
    let stated_known = stated.iter().zip(is_known).filter(|(value, known)| **known && is_stated(value));
    let mut values: Vec<f64> = stated_known.map(|(value, _)| f64::from(*value)).collect();
    let usual = if values.is_empty() { f64::NAN } else { median(&mut values) };
    let usual = if usual > 0.0 { usual } else { typed.unwrap_or(f64::NAN) };
    let wanted = "wanted su, sv and sw, or --sigma with the uncertainties of u, v and w in mm";
    Refusal::unless(usual > 0.0, || "measured vectors without uncertainties", wanted)?;
    let one = |value: &f32| {
        if is_stated(value) { f64::from(*value).max(MINIMUM_SHARE * usual) } else { typed.unwrap_or(usual) }
    };
    Ok(stated.iter().map(one).collect())
}

/// Uncertainties by the mean variance of the measured vectors over a window. The scatter of about ten particles gives a
/// single uncertainty to a quarter only; as a weight it would favour vectors whose particles agree by chance.
fn usual(sigma: &[f64], is_known: &[bool], layout: &VectorGrid, errors: &Correlated) -> Vec<f64> {
    let reach = errors.width.map(|width| (width / 2).max(1));
    let mean = |value: &dyn Fn(usize) -> f64| {
        let values: Vec<f64> = (0..sigma.len()).map(|i| if is_known[i] { value(i) } else { 0.0 }).collect();
        box_mean(&values, layout.shape, reach)
    };
    let (variance, share) = (mean(&|i| sigma[i] * sigma[i]), mean(&|_| 1.0));
    let one = |i: usize| if is_known[i] { (variance[i] / share[i]).sqrt() } else { sigma[i] };
    (0..sigma.len()).map(one).collect()
}

/// RMS difference of measured values from the mean of their two nearest neighbours that share no data with them.
/// Without such neighbours, their RMS about the mean.
fn distance(field: &Field, values: &[f64], is_known: &[bool], errors: &Correlated) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for i in (0..values.len()).filter(|i| is_known[*i]) {
        for axis in 0..3 {
            let steps = errors.width[axis] as isize;
            let near = [-steps, steps].map(|steps| field.layout.neighbour(i, axis, steps).filter(|n| is_known[*n]));
            if let [Some(before), Some(after)] = near {
                sum += (values[i] - 0.5 * (values[before] + values[after])).powi(2);
                count += 1.0;
            }
        }
    }
    if count > 0.0 {
        return (sum / count).sqrt();
    }
    let all = known(values, is_known);
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    rms(all.iter().map(|value| value - mean))
}
