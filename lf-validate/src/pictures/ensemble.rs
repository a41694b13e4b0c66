//! A slice of many fields' statistics.

use super::figures;
use crate::scores::ensemble::Ensemble;
use crate::scores::units::{AXES, COMPONENTS};
use lf_core::plot::{Axis, Chart, Mark, Panel};
use lf_core::statistics::quantile;

/// Most arrows along an axis; of more, every second, third, ... is drawn.
const MOST_ARROWS: usize = 24;
/// Colours and arrows reach as far as this share of the values: a few wild ones do not make the rest pale.
const USUAL: f64 = 0.98;
/// Length of a usual arrow, distances between arrows.
const ARROW_STEPS: f64 = 0.9;

/// One layer of the vectors, across an axis.
struct Slice<'a> {
    found: &'a Ensemble,
    /// The axis through it, and those in it, to the right and upright.
    through: usize,
    across: [usize; 2],
    layer: usize,
    /// From mm to what is drawn.
    factor: f64,
}

/// Layer `layer` across axis `through`: mean with arrows, mean through it, RMS of each component, vorticity through it.
pub fn ensemble(found: &Ensemble, through: usize, layer: usize) -> Chart {
    let layout = &found.mean.layout;
    let (factor, unit) = layout.dt_s.map_or((1.0, "mm"), |dt_s| (1.0 / dt_s, "mm/s"));
    let across = [[1, 2], [0, 2], [0, 1]][through];
    let slice = Slice { found, through, across, layer, factor };
    let [right, upright, normal] = [across[0], across[1], through].map(|axis| COMPONENTS[axis]);
    let name = if layout.dt_s.is_some() { "velocity" } else { "displacement" };
    let mean = [&found.mean.u, &found.mean.v, &found.mean.w];
    let length = |i: usize| slice.mean(across[0], i).hypot(slice.mean(across[1], i));
    let mut first = slice.panel(
        format!("Mean ({right}, {upright}): length in colour"),
        from_zero(format!("length, {unit}"), slice.values(length)),
    );
    let arrows = slice.arrows();
    let magnified =
        arrows.as_ref().map(|(_, times)| format!("arrows {} times their displacement", figures(Some(*times))));
    first.marks.extend(arrows.map(|(mark, _)| mark));
    let mut panels = vec![first];
    let scaled = |values: &'_ [f32], i: usize| f64::from(values[i]) * factor;
    let signed = |name: String, values: Vec<f64>| {
        let most = usual(&values);
        let axis = Axis::new(name);
        let axis = if most > 0.0 { axis.over([-most, most]) } else { axis };
        (axis, values)
    };
    panels.push(slice.panel(
        format!("Mean {normal}, through the slice"),
        signed(format!("{normal}, {unit}"), slice.values(|i| scaled(mean[through], i))),
    ));
    for (component, rms) in COMPONENTS.iter().zip(&found.rms_mm) {
        panels.push(slice.panel(
            format!("RMS fluctuation of {component}"),
            from_zero(format!("{component}', {unit}"), slice.values(|i| scaled(rms, i))),
        ));
    }
    panels.push(slice.panel(
        format!("Vorticity about {}", AXES[through]),
        signed(
            format!("vorticity, {}", found.vorticity_unit()),
            slice.values(|i| f64::from(found.vorticity[through][i])),
        ),
    ));
    let steps = layout.origin_mm[through] / layout.spacing_mm[through] + layer as f64;
    // The middle of a symmetric field is 0, whatever rounding leaves of it.
    let place_mm = (1e6 * steps).round() * 1e-6 * layout.spacing_mm[through] + 0.0;
    let mut notes = vec![format!(
        "{} fields; slice at {} = {} mm; colours end where 98 % of the values do",
        found.fields,
        AXES[through],
        figures(Some(place_mm))
    )];
    notes.extend(magnified);
    Chart { title: format!("Mean {name} and fluctuations"), notes, columns: 3, panels }
}

impl Slice<'_> {
    fn shape(&self) -> [usize; 2] {
        self.across.map(|axis| self.found.mean.layout.shape[axis])
    }

    fn node(&self, [i, j]: [usize; 2]) -> usize {
        let [nx, ny, _] = self.found.mean.layout.shape;
        let mut place = [0; 3];
        (place[self.through], place[self.across[0]], place[self.across[1]]) = (self.layer, i, j);
        place[0] + nx * (place[1] + ny * place[2])
    }

    /// A mean component in the unit drawn; NaN without data.
    fn mean(&self, axis: usize, i: usize) -> f64 {
        let mean = &self.found.mean;
        let value = [&mean.u, &mean.v, &mean.w][axis][i];
        if mean.flag[i] == lf_core::field::NO_DATA { f64::NAN } else { f64::from(value) * self.factor }
    }

    /// Values of the slice, the axis to the right fastest; NaN without data.
    fn values(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let [nx, ny] = self.shape();
        let value = |node: usize| if self.mean(0, node).is_nan() { f64::NAN } else { of(node) };
        (0..nx * ny).map(|n| value(self.node([n % nx, n / nx]))).collect()
    }

    /// A map of values; image rows run down, and so does y.
    fn panel(&self, title: String, (scale, values): (Axis, Vec<f64>)) -> Panel {
        let bounds = self.across.map(|axis| self.found.mean.layout.bounds_mm(axis));
        let name = |which: usize| Axis::new(format!("{}, mm", AXES[self.across[which]])).over(bounds[which]);
        let upright = if self.across[1] == 1 { name(1).over([bounds[1][1], bounds[1][0]]) } else { name(1) };
        let mut panel = Panel::new(title, name(0), upright);
        panel.is_to_scale = true;
        panel.marks = vec![Mark::Map { values, cells: self.shape(), x: bounds[0], y: bounds[1], scale }];
        panel
    }

    /// Arrows of the mean in the slice, and how many times longer than the displacement they are; none without any.
    fn arrows(&self) -> Option<(Mark, f64)> {
        let shape = self.shape();
        let layout = &self.found.mean.layout;
        let stride = shape.map(|count| count.div_ceil(MOST_ARROWS));
        let along = |a: usize| ((shape[a] - 1) % stride[a] / 2..shape[a]).step_by(stride[a]);
        let places: Vec<[usize; 2]> = along(1).flat_map(|j| along(0).map(move |i| [i, j])).collect();
        // Displacements, whatever is drawn: arrows have the length of the axes.
        let vector = |place: &[usize; 2]| self.across.map(|axis| self.mean(axis, self.node(*place)) / self.factor);
        let vectors: Vec<[f64; 2]> = places.iter().map(vector).collect();
        let mut lengths: Vec<f64> =
            vectors.iter().map(|[x, y]| x.hypot(*y)).filter(|length| length.is_finite()).collect();
        let usual = quantile(&mut lengths, USUAL);
        let step = (0..2).map(|a| stride[a] as f64 * layout.spacing_mm[self.across[a]]).fold(f64::INFINITY, f64::min);
        let times = ARROW_STEPS * step / usual;
        times.is_finite().then(|| {
            let place = |[i, j]: &[usize; 2]| {
                [(0, *i), (1, *j)].map(|(a, n)| {
                    let axis = self.across[a];
                    layout.origin_mm[axis] + n as f64 * layout.spacing_mm[axis]
                })
            };
            let points = places.iter().map(place).collect();
            (Mark::Arrows { points, vectors: vectors.iter().map(|v| v.map(|mm| times * mm)).collect() }, times)
        })
    }
}

/// The size that [`USUAL`] of the values do not exceed; 0 where there are none.
fn usual(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).filter(|size| size.is_finite()).collect();
    if sizes.is_empty() { 0.0 } else { quantile(&mut sizes, USUAL) }
}

fn from_zero(name: String, values: Vec<f64>) -> (Axis, Vec<f64>) {
    let most = usual(&values);
    let axis = Axis::new(name);
    (if most > 0.0 { axis.over([0.0, most]) } else { axis }, values)
}
