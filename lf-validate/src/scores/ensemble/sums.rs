//! Statistics of many fields of one flow: mean, fluctuations about it, vorticity of the mean.
//!
//! Only measured vectors count: a replaced one says what its neighbours say, and would make the fluctuations too small.
//! Fields are taken in one after another and none is kept.

use lf_core::field::{Array, Field, Layout, MEASURED, NO_DATA};
use serde::Serialize;

/// What was found and what was wanted.
pub type Refusal = (String, String);

/// Pairs of components whose products are summed: uu, vv, ww, uv, uw, vw.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

/// Two layouts are one where their places differ by less than this share of the distance between vectors.
const SAME_PLACE: f64 = 1e-3;

/// Sums over the fields taken in so far.
#[derive(Debug, Clone)]
pub struct Sums {
    layout: Layout,
    fields: usize,
    /// Measured vectors of each place.
    count: Vec<u32>,
    /// Their mean, mm.
    mean: [Vec<f64>; 3],
    /// Sums of products of departures from the mean, mm^2, in the order of [`PAIRS`].
    moments: [Vec<f64>; 6],
    /// Sums of `peak`, of `ratio` and of `count`.
    quality: [Vec<f64>; 3],
}

/// Statistics of a number of fields. Lists have one number a place, in the order of a field's components, NaN where there is
/// none.
#[derive(Debug, Clone, PartialEq)]
pub struct Ensemble {
    /// Fields taken in.
    pub fields: usize,
    /// Measured vectors of each place.
    pub count: Vec<f32>,
    /// Mean displacement. Its uncertainty is that of the mean, from the scatter of the fields, NaN of a single vector; peak
    /// and ratio are means, and the number of particle images is that of all fields. Places with too few vectors are without
    /// data.
    pub mean: Field,
    /// Root mean square of the fluctuations of u, v and w, mm, by n - 1.
    pub rms_mm: [Vec<f32>; 3],
    /// Mean products of the fluctuations uv, uw and vw, mm^2, by n - 1: the Reynolds stresses without density and sign.
    pub products_mm2: [Vec<f32>; 3],
    /// Vorticity of the mean, curl of the displacement between the two volumes: without unit, or 1/s where the time
    /// between them is known. By central differences of neighbours, one-sided beside a gap.
    pub vorticity: [Vec<f32>; 3],
}

/// One number for each of what lf-validate prints of an ensemble.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Fields taken in.
    pub fields: usize,
    /// Vectors of the field.
    pub places: usize,
    /// Places with fewer measured vectors than asked for.
    pub no_data: usize,
    /// Share of measured vectors among all of all fields.
    pub measured_share: f64,
    /// RMS of the mean displacement over the places, mm.
    pub displacement_mm: [f64; 3],
    /// RMS of the fluctuations over the places, mm; noise of the measurement is a part of them.
    pub fluctuation_mm: [f64; 3],
    /// RMS of the standard uncertainty of the mean, mm.
    pub uncertainty_mm: [f64; 3],
    /// RMS of the vorticity's components over the places, in `vorticity_unit`.
    pub vorticity: [f64; 3],
    /// `1/s`, or `1` where the time between the volumes is not known.
    pub vorticity_unit: &'static str,
}

impl Sums {
    /// Sums of nothing, for fields of a layout.
    pub fn new(layout: &Layout) -> Self {
        let len = layout.shape.iter().product();
        let zeros = || vec![0.0; len];
        Self {
            layout: layout.clone(),
            fields: 0,
            count: vec![0; len],
            mean: std::array::from_fn(|_| zeros()),
            moments: std::array::from_fn(|_| zeros()),
            quality: std::array::from_fn(|_| zeros()),
        }
    }

    /// Takes in a field.
    ///
    /// # Errors
    /// Another layout than the first: what was found and what was wanted. Nothing is taken in then.
    pub fn add(&mut self, field: &Field) -> Result<(), Refusal> {
        same(&self.layout, &field.layout)?;
        self.fields += 1;
        for i in (0..field.len()).filter(|i| field.flag[*i] == MEASURED) {
            self.count[i] += 1;
            let count = f64::from(self.count[i]);
            let vector = [field.u[i], field.v[i], field.w[i]].map(f64::from);
            // Welford (1962): departures from the mean before and after this vector.
            let before: [f64; 3] = std::array::from_fn(|a| vector[a] - self.mean[a][i]);
            for (mean, before) in self.mean.iter_mut().zip(before) {
                mean[i] += before / count;
            }
            for (moments, [a, b]) in self.moments.iter_mut().zip(PAIRS) {
                moments[i] += before[a] * (vector[b] - self.mean[b][i]);
            }
            for (sum, value) in self.quality.iter_mut().zip([field.peak[i], field.ratio[i], field.count[i]]) {
                sum[i] += f64::from(value);
            }
        }
        Ok(())
    }

    /// The statistics, of places with at least `least` measured vectors.
    pub fn finish(self, least: u32) -> Ensemble {
        let Self { layout, fields, count, mean: means, moments, quality } = self;
        let mut mean = Field::empty(layout);
        let mut rms_mm = std::array::from_fn(|_| vec![f32::NAN; count.len()]);
        let mut products_mm2 = rms_mm.clone();
        for i in (0..count.len()).filter(|i| count[*i] >= least.max(1)) {
            let n = f64::from(count[i]);
            let of = |pair: usize| moments[pair][i] / (n - 1.0);
            [mean.u[i], mean.v[i], mean.w[i]] = [0, 1, 2].map(|a| means[a][i] as f32);
            (mean.peak[i], mean.ratio[i]) = ((quality[0][i] / n) as f32, (quality[1][i] / n) as f32);
            mean.count[i] = quality[2][i] as f32;
            mean.flag[i] = MEASURED;
            if count[i] > 1 {
                [mean.su[i], mean.sv[i], mean.sw[i]] = [0, 1, 2].map(|a| (of(a) / n).sqrt() as f32);
                for a in 0..3 {
                    rms_mm[a][i] = of(a).sqrt() as f32;
                    products_mm2[a][i] = of(3 + a) as f32;
                }
            }
        }
        let vorticity = vorticity(&mean);
        let count = count.into_iter().map(|count| count as f32).collect();
        Ensemble { fields, count, mean, rms_mm, products_mm2, vorticity }
    }
}

impl Ensemble {
    /// The numbers that stand for it.
    pub fn summary(&self) -> Summary {
        let mean = &self.mean;
        let measured: f64 = self.count.iter().map(|count| f64::from(*count)).sum();
        Summary {
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

    /// What a `.vti` holds of it; velocities too where the time between the volumes is known.
    pub fn to_arrays(&self) -> Vec<Array> {
        let mean = &self.mean;
        let vectors = |name, of: &[Vec<f32>; 3]| Array::vectors(name, of.each_ref().map(Vec::as_slice));
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

/// Refuses a layout whose vectors stand elsewhere, or that has another time between its volumes.
fn same(first: &Layout, other: &Layout) -> Result<(), Refusal> {
    if first.shape != other.shape {
        let text = |layout: &Layout| layout.shape.map(|n| n.to_string()).join(" x ");
        return Err((format!("{} vectors", text(other)), format!("wanted {} like the first", text(first))));
    }
    for axis in 0..3 {
        let (ours, theirs) = (first.bounds_mm(axis), other.bounds_mm(axis));
        if (0..2).any(|end| (ours[end] - theirs[end]).abs() > SAME_PLACE * first.spacing_mm[axis]) {
            let letter = ["x", "y", "z"][axis];
            let text = |[low, high]: [f64; 2]| format!("{letter} from {low} to {high} mm");
            return Err((text(theirs), format!("wanted {} like the first", text(ours))));
        }
    }
    if first.dt_s != other.dt_s {
        let text = |dt_s: Option<f64>| dt_s.map_or("no time".into(), |dt_s| format!("{dt_s} s"));
        let found = format!("{} between its volumes", text(other.dt_s));
        return Err((found, format!("wanted {} like the first", text(first.dt_s))));
    }
    Ok(())
}

/// Curl of the displacement, over the time between the volumes where it is known.
fn vorticity(field: &Field) -> [Vec<f32>; 3] {
    let time = field.layout.dt_s.unwrap_or(1.0);
    let components = [&field.u, &field.v, &field.w];
    std::array::from_fn(|axis| {
        let [one, other] = [(axis + 1) % 3, (axis + 2) % 3];
        let curl = |i: usize| slope(field, components[other], one, i) - slope(field, components[one], other, i);
        (0..field.len()).map(|i| (curl(i) / time) as f32).collect()
    })
}

/// Derivative of a component along an axis at a place with data, from its two neighbours, or from one and itself; NaN where
/// it has neither.
fn slope(field: &Field, values: &[f32], axis: usize, i: usize) -> f64 {
    let [nx, ny, _] = field.layout.shape;
    let stride = [1, nx, nx * ny][axis];
    let at = i / stride % field.layout.shape[axis];
    let holds = |n: usize| field.flag[n] != NO_DATA;
    if !holds(i) {
        return f64::NAN;
    }
    let low = if at > 0 && holds(i - stride) { i - stride } else { i };
    let high = if at + 1 < field.layout.shape[axis] && holds(i + stride) { i + stride } else { i };
    let steps = ((high - low) / stride) as f64;
    // No neighbour: 0 / 0.
    (f64::from(values[high]) - f64::from(values[low])) / (steps * field.layout.spacing_mm[axis])
}

fn root_mean_square(values: &[f32], flag: &[f32]) -> f64 {
    let known = values.iter().zip(flag).filter(|(value, flag)| **flag != NO_DATA && value.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, n), (value, _)| (sum + f64::from(*value).powi(2), n + 1.0));
    (sum / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::field::REPLACED;

    fn layout(dt_s: Option<f64>) -> Layout {
        Layout {
            shape: [4, 3, 2],
            spacing_mm: [0.5, 1.0, 2.0],
            origin_mm: [-1.0, 7.0, 0.0],
            voxel_mm: [0.1; 3],
            window: [8; 3],
            overlap: 0.5,
            dt_s,
            history: Vec::new(),
        }
    }

    /// A field of one vector everywhere, measured.
    fn uniform(vector: [f32; 3]) -> Field {
        let mut field = Field::empty(layout(None));
        let n = field.len();
        [field.u, field.v, field.w] = vector.map(|value| vec![value; n]);
        (field.flag, field.peak, field.count) = (vec![MEASURED; n], vec![0.5; n], vec![10.0; n]);
        field
    }

    fn sums(fields: &[Field]) -> Sums {
        let mut sums = Sums::new(&fields[0].layout);
        fields.iter().for_each(|field| sums.add(field).unwrap());
        sums
    }

    #[test]
    fn mean_and_fluctuations_of_three_vectors_by_hand() {
        let mut fields: Vec<Field> = [[1.0, 0.0, 5.0], [2.0, 2.0, 5.0], [6.0, 4.0, 5.0]].map(uniform).to_vec();
        // One vector is replaced: two are left at that place. Another place has data once, a third never.
        fields[2].flag[5] = REPLACED;
        fields.iter_mut().skip(1).for_each(|field| field.flag[7] = NO_DATA);
        fields.iter_mut().for_each(|field| field.flag[9] = NO_DATA);
        let found = sums(&fields).finish(1);
        assert_eq!([found.mean.u[0], found.mean.v[0], found.mean.w[0]], [3.0, 2.0, 5.0]);
        // u: departures -2, -1, 3; v: -2, 0, 2.
        assert_eq!([0, 1, 2].map(|a| found.rms_mm[a][0]), [7f32.sqrt(), 2.0, 0.0]);
        assert_eq!(found.products_mm2[0][0], 5.0);
        assert!((found.mean.su[0] - (7f32 / 3.0).sqrt()).abs() < 1e-6);
        assert_eq!((found.mean.count[0], found.mean.peak[0], found.count[0]), (30.0, 0.5, 3.0));
        assert_eq!((found.mean.u[5], found.count[5]), (1.5, 2.0));
        assert!(found.mean.u[7] == 1.0 && found.mean.su[7].is_nan() && found.rms_mm[0][7].is_nan());
        assert_eq!((found.mean.flag[7], found.mean.flag[9]), (MEASURED, NO_DATA));
        let summary = found.summary();
        assert_eq!((summary.no_data, summary.places, summary.fields), (1, 24, 3));
        assert!((summary.measured_share - 66.0 / 72.0).abs() < 1e-12);
        assert_eq!(sums(&fields).finish(2).mean.flag[7], NO_DATA);
    }

    #[test]
    fn a_turn_has_twice_its_rate_as_vorticity_to_the_edges() {
        // Rates about x, y and z; u = rate x place.
        let rate = [0.01, -0.02, 0.03];
        for dt_s in [None, Some(0.5)] {
            // Three layers: beside a gap there is still a neighbour on the other side.
            let mut field = Field::empty(Layout { shape: [4, 3, 3], ..layout(dt_s) });
            for i in 0..field.len() {
                let [x, y, z] = field.place_mm(i);
                let turned = [rate[1] * z - rate[2] * y, rate[2] * x - rate[0] * z, rate[0] * y - rate[1] * x];
                [field.u[i], field.v[i], field.w[i]] = turned.map(|mm| mm as f32);
                field.flag[i] = MEASURED;
            }
            field.flag[0] = NO_DATA;
            let found = sums(&[field]).finish(1);
            for axis in 0..3 {
                assert!(found.vorticity[axis][0].is_nan());
                for value in &found.vorticity[axis][1..] {
                    let wanted = 2.0 * rate[axis] / dt_s.unwrap_or(1.0);
                    assert!((f64::from(*value) - wanted).abs() < 1e-6, "axis {axis}: {value}, wanted {wanted}");
                }
            }
            let names: Vec<_> = found.to_arrays().iter().map(|array| array.name).collect();
            assert_eq!(names.contains(&"vorticity_1_s"), dt_s.is_some());
        }
    }

    #[test]
    fn fields_of_other_places_are_refused() {
        let mut sums = sums(&[uniform([0.0; 3])]);
        let refusal = |change: fn(&mut Layout), sums: &mut Sums| {
            let mut layout = layout(None);
            change(&mut layout);
            sums.add(&Field::empty(layout)).unwrap_err()
        };
        let (found, wanted) = refusal(|layout| layout.shape[2] = 3, &mut sums);
        assert_eq!((found.as_str(), wanted.as_str()), ("4 x 3 x 3 vectors", "wanted 4 x 3 x 2 like the first"));
        assert!(refusal(|layout| layout.origin_mm[1] += 0.1, &mut sums).0.starts_with("y from"));
        assert!(refusal(|layout| layout.dt_s = Some(0.1), &mut sums).0.starts_with("0.1 s between"));
        assert_eq!(sums.fields, 1);
    }
}
