//! Statistics of many fields of one flow: their mean, and the fluctuations about it.
//!
//! Only measured vectors count. A replaced vector repeats its neighbours and would make the fluctuations too small.
//! Fields are added one after another, and none is kept.

use super::statistics::{Ensemble, vorticity};
use crate::scores::distribution::root_mean;
use crate::scores::units::AXES;
use lf_core::{Field, Refusal, VectorGrid, field::MEASURED};

/// Pairs of components whose products are summed: uu, vv, ww, uv, uw, vw.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

/// Two layouts agree if their places differ by at most this share of the distance between vectors.
const SAME_PLACE: f64 = 1e-3;

/// Sums over the fields added.
#[derive(Debug, Clone)]
pub struct EnsembleSums {
    layout: VectorGrid,
    fields: usize,
    /// Measured vectors at each place.
    count: Vec<u32>,
    /// Their mean, mm.
    mean: [Vec<f64>; 3],
    /// Sums of products of deviations from the mean, mm^2, in the order of [`PAIRS`].
    moments: [Vec<f64>; 6],
    /// Sums of `peak`, of `ratio` and of `count`.
    quality: [Vec<f64>; 3],
}

/// Bytes of a place: the sums, the statistics and the mean made from them, and the file of all.
const PLACE_BYTES: f64 = 100.0 + 150.0 + 100.0;

impl EnsembleSums {
    /// Upper bound of the bytes of sums over fields of a layout, and of their statistics.
    pub fn bytes(layout: &VectorGrid) -> f64 {
        PLACE_BYTES * layout.shape.iter().map(|count| *count as f64).product::<f64>()
    }

    /// Sums of no field.
    pub fn new(layout: &VectorGrid) -> Self {
        let len = layout.shape.iter().product();
        let zeros = |_| vec![0.0; len];
        Self {
            layout: layout.clone(),
            fields: 0,
            count: vec![0; len],
            mean: std::array::from_fn(zeros),
            moments: std::array::from_fn(zeros),
            quality: std::array::from_fn(zeros),
        }
    }

    /// Adds a field. Refuses a layout other than that of the first; the sums then stay as they were.
    pub fn add(&mut self, field: &Field) -> Result<(), Refusal> {
        check_layout(&self.layout, &field.layout)?;
        self.fields += 1;
        for i in (0..field.len()).filter(|i| field.flag[*i] == MEASURED) {
            self.count[i] += 1;
            let count = f64::from(self.count[i]);
            let vector = field.displacement_mm(i);
            // Welford (1962): deviations from the mean before and after this vector.
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

    /// Number of fields added.
    pub(crate) fn fields(&self) -> usize {
        self.fields
    }

    /// The mean so far, mm; NaN where nothing was measured.
    pub(super) fn mean_mm(&self) -> [Vec<f32>; 3] {
        let known = |(mean, count): (&f64, &u32)| if *count > 0 { *mean as f32 } else { f32::NAN };
        self.mean.each_ref().map(|mean| mean.iter().zip(&self.count).map(known).collect())
    }

    /// RMS over the places with two vectors or more of a number that follows from variance and count of a component.
    fn rms(&self, square: impl Fn(f64, f64) -> f64) -> [f64; 3] {
        [0, 1, 2].map(|c| {
            let known = self.moments[c].iter().zip(&self.count).filter(|(_, count)| **count > 1);
            root_mean(known.map(|(moment, count)| square(moment / f64::from(count - 1), f64::from(*count))))
        })
    }

    /// RMS fluctuations so far, over the places with two vectors or more, mm.
    pub(super) fn fluctuation_mm(&self) -> [f64; 3] {
        self.rms(|variance, _| variance)
    }

    /// RMS over these places of the standard uncertainty of the mean so far, mm.
    pub(crate) fn uncertainty_mm(&self) -> [f64; 3] {
        self.rms(|variance, count| variance / count)
    }

    /// The statistics of places with at least `least` measured vectors. Other places have no data.
    pub fn finish(self, least: u32) -> Ensemble {
        let Self { layout, fields, count, mean: means, moments, quality } = self;
        let mut mean = Field::empty(layout);
        let mut rms_mm = std::array::from_fn(|_| vec![f32::NAN; count.len()]);
        let mut products_mm2 = rms_mm.clone();
        for i in (0..count.len()).filter(|i| count[*i] >= least.max(1)) {
            let n = f64::from(count[i]);
            let moment = |pair: usize| moments[pair][i] / (n - 1.0);
            [mean.u[i], mean.v[i], mean.w[i]] = [0, 1, 2].map(|a| means[a][i] as f32);
            (mean.peak[i], mean.ratio[i]) = ((quality[0][i] / n) as f32, (quality[1][i] / n) as f32);
            mean.count[i] = quality[2][i] as f32;
            mean.flag[i] = MEASURED;
            if count[i] > 1 {
                [mean.su[i], mean.sv[i], mean.sw[i]] = [0, 1, 2].map(|a| (moment(a) / n).sqrt() as f32);
                for a in 0..3 {
                    rms_mm[a][i] = moment(a).sqrt() as f32;
                    products_mm2[a][i] = moment(3 + a) as f32;
                }
            }
        }
        let vorticity = vorticity(&mean);
        let count = count.into_iter().map(|count| count as f32).collect();
        Ensemble { fields, count, mean, rms_mm, products_mm2, vorticity }
    }
}

/// Refuses a layout with vectors at other places, or with another time between the volumes.
fn check_layout(first: &VectorGrid, other: &VectorGrid) -> Result<(), Refusal> {
    let refused = |found: String, wanted: String| Err(Refusal::new(found, format!("wanted {wanted} like the first")));
    if first.shape != other.shape {
        let text = |layout: &VectorGrid| layout.shape.map(|n| n.to_string()).join(" x ");
        return refused(format!("{} vectors", text(other)), text(first));
    }
    for (axis, name) in AXES.into_iter().enumerate() {
        let (ours, theirs) = (first.bounds_mm(axis), other.bounds_mm(axis));
        if (0..2).any(|end| (ours[end] - theirs[end]).abs() > SAME_PLACE * first.spacing_mm[axis]) {
            let text = |[low, high]: [f64; 2]| format!("{name} from {low} to {high} mm");
            return refused(text(theirs), text(ours));
        }
    }
    if first.dt_s != other.dt_s {
        let text = |dt_s: Option<f64>| dt_s.map_or("no time".into(), |dt_s| format!("{dt_s} s"));
        return refused(format!("{} between its volumes", text(other.dt_s)), text(first.dt_s));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::field::{NO_DATA, REPLACED};

    fn layout(dt_s: Option<f64>) -> VectorGrid {
        VectorGrid {
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

    /// A field with the same measured vector everywhere.
    fn uniform(vector: [f32; 3]) -> Field {
        let mut field = Field::empty(layout(None));
        let n = field.len();
        [field.u, field.v, field.w] = vector.map(|value| vec![value; n]);
        (field.flag, field.peak, field.count) = (vec![MEASURED; n], vec![0.5; n], vec![10.0; n]);
        field
    }

    fn sums(fields: &[Field]) -> EnsembleSums {
        let mut sums = EnsembleSums::new(&fields[0].layout);
        fields.iter().for_each(|field| sums.add(field).unwrap());
        sums
    }

    #[test]
    fn mean_and_fluctuations_of_three_vectors_by_hand() {
        let mut fields: Vec<Field> = [[1.0, 0.0, 5.0], [2.0, 2.0, 5.0], [6.0, 4.0, 5.0]].map(uniform).to_vec();
        // One vector is replaced, so that two are left at its place. Another place has data once, a third never.
        fields[2].flag[5] = REPLACED;
        fields.iter_mut().skip(1).for_each(|field| field.flag[7] = NO_DATA);
        fields.iter_mut().for_each(|field| field.flag[9] = NO_DATA);
        let found = sums(&fields).finish(1);
        assert_eq!([found.mean.u[0], found.mean.v[0], found.mean.w[0]], [3.0, 2.0, 5.0]);
        // u: deviations -2, -1, 3; v: -2, 0, 2.
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
    fn the_vorticity_of_a_rotation_is_twice_its_rate_up_to_the_edges() {
        // Rates about x, y and z; u = rate x place.
        let rate = [0.01, -0.02, 0.03];
        for dt_s in [None, Some(0.5)] {
            // With three layers a place beside a gap has a neighbour on the other side.
            let mut field = Field::empty(VectorGrid { shape: [4, 3, 3], ..layout(dt_s) });
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
        let refusal = |change: fn(&mut VectorGrid), sums: &mut EnsembleSums| {
            let mut layout = layout(None);
            change(&mut layout);
            sums.add(&Field::empty(layout)).unwrap_err()
        };
        let wanted = Refusal::new("4 x 3 x 3 vectors", "wanted 4 x 3 x 2 like the first");
        assert_eq!(refusal(|layout| layout.shape[2] = 3, &mut sums), wanted);
        assert!(refusal(|layout| layout.origin_mm[1] += 0.1, &mut sums).found.starts_with("y from"));
        assert!(refusal(|layout| layout.dt_s = Some(0.1), &mut sums).found.starts_with("0.1 s between"));
        assert_eq!(sums.fields, 1);
    }
}
