//! A picture of a field: one layer of it, across any axis.
//!
//! Colours show a scalar, those about 0 from blue to red. The arrows show the components in the layer, centred on the
//! places where they were measured; the key gives their scale. All layers share both scales: the colours end at the
//! next round number above 98 % of the vectors. Replaced vectors are hollow. If the time between the volumes is known,
//! velocities are drawn, mm/s.

use super::chart::{Arrows, Axis, Chart, Mark};
use super::drawing::Drawing;
use super::page::draw;
use super::slice::{Slice, usual};
use super::text::short;
use lf_core::Refusal;
use lf_core::field::{AXES, COMPONENTS, Cut, Field, MEASURED, NO_DATA, REPLACED};
use std::str::FromStr;

/// Largest number of arrows along the longer side of the layer.
const MOST_ARROWS: usize = 47;
/// Smallest usual length of an arrow, as a share of the end of the colours: noise about zero must not look like a
/// flow.
const LEAST_USUAL: f64 = 0.2;
/// A layer with fewer measured vectors than this share of the fullest layer's is not chosen.
const FULL: f64 = 0.8;
/// A layer with this share of the best layer's signal over noise is as good.
const GOOD: f64 = 0.8;

/// The scalar behind the colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// A component: 0, 1, 2 for u, v, w.
    Component(usize),
    /// Length of the vector.
    Speed,
    /// Component of the curl across the layer, by differences of neighbours.
    Vorticity,
    /// Standard uncertainty of the vector: the root of the sum of the squares of its components'.
    Uncertainty,
}

impl FromStr for Scalar {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "speed" => Ok(Self::Speed),
            "vorticity" => Ok(Self::Vorticity),
            "uncertainty" => Ok(Self::Uncertainty),
            _ => match COMPONENTS.iter().position(|name| *name == text) {
                Some(component) => Ok(Self::Component(component)),
                None => Err("wanted u, v, w, speed, vorticity or uncertainty".into()),
            },
        }
    }
}

/// The plane, the scalar and the range of a picture of a field.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FieldPicture {
    /// The plane. Without a place, the layer is chosen: see [`layer`].
    pub cut: Cut,
    /// The scalar; None is the component across the plane.
    pub scalar: Option<Scalar>,
    /// Ends of the colours, in the unit drawn; None is the range of the field.
    pub range: Option<[f64; 2]>,
}

/// The layer that a cut draws: the nearest to its place, or without a place the one with the strongest signal: the
/// largest RMS of its vectors over the RMS of their uncertainties. Only layers with nearly as many measured
/// vectors as the fullest compete, and among nearly equal ones the nearest to the middle wins. It is seldom the focal
/// plane, where w is least certain. Refuses a place outside the field.
pub fn layer(field: &Field, cut: Cut) -> Result<usize, Refusal> {
    if cut.place_mm.is_some() {
        return cut.layer(&field.layout);
    }
    let layers: Vec<(usize, f64)> =
        (0..field.layout.shape[cut.axis]).map(|layer| signal_over_noise(field, cut.axis, layer)).collect();
    let fullest = layers.iter().map(|(count, _)| *count).max().unwrap_or(0);
    let is_full = |count: usize| count as f64 >= FULL * fullest as f64;
    let full = |&layer: &usize| fullest > 0 && is_full(layers[layer].0);
    let most = (0..layers.len()).filter(full).map(|layer| layers[layer].1).fold(0.0, f64::max);
    // Take the one nearest to the middle among nearly equal layers: noise must not send the choice to an end.
    let middle = layers.len() / 2;
    let good = (0..layers.len()).filter(full).filter(|layer| layers[*layer].1 >= GOOD * most);
    let best = good.min_by_key(|layer| layer.abs_diff(middle));
    Ok(best.unwrap_or(middle))
}

/// Number of measured vectors of a layer, and the ratio of their squares to those of their uncertainties. Without
/// uncertainties it is the sum of the squares.
fn signal_over_noise(field: &Field, through: usize, layer: usize) -> (usize, f64) {
    let slice = Slice { grid: &field.layout, through, layer };
    let (mut count, mut signal, mut noise) = (0, 0.0, 0.0);
    for node in slice.nodes().filter(|node| field.flag[*node] == MEASURED) {
        count += 1;
        signal += field.displacement_mm(node).length_squared();
        let stated = field.uncertainty_mm(node).length_squared();
        noise += if stated.is_finite() { stated } else { 0.0 };
    }
    (count, if noise > 0.0 { signal / noise } else { signal })
}

/// Draws a layer of `field`. Refuses a place outside the field; panics if the axis is above 2.
pub fn field(field: &Field, picture: &FieldPicture) -> Result<Drawing, Refusal> {
    draw(&field_chart(field, picture)?)
}

/// Lays out a layer of `field` as a chart. Refuses a place outside the field; panics if the axis is above 2.
fn field_chart(field: &Field, picture: &FieldPicture) -> Result<Chart, Refusal> {
    let (grid, through) = (&field.layout, picture.cut.axis);
    let slice = Slice { grid, through, layer: layer(field, picture.cut)? };
    let across = slice.across();
    let (quantity, unit) = if grid.dt_s.is_some() { ("Velocity", "mm/s") } else { ("Displacement", "mm") };
    let values = FieldValues { field, factor: grid.dt_s.map_or(1.0, f64::recip) };
    let in_layer = |node: usize| across.map(|axis| values.component(axis, node));

    // A field without a measured vector takes the scales of the replaced ones.
    let scales = if field.flag.contains(&MEASURED) { MEASURED } else { REPLACED };
    let nodes = || (0..field.len()).filter(|&node| field.flag[node] == scales);
    let largest =
        |node: usize| [0, 1, 2].map(|axis| values.component(axis, node).abs()).into_iter().fold(0.0, f64::max);
    let limit = usual(nodes().map(largest));
    let length = usual(nodes().map(|node| in_layer(node)[0].hypot(in_layer(node)[1]))).max(LEAST_USUAL * limit);

    let scalar = picture.scalar.unwrap_or(Scalar::Component(through));
    let name = format!("{}, {}", values.name(scalar, through), values.unit(scalar));
    let scale = match picture.range {
        Some(range) => Axis::new(name).over(range),
        None => values.scale(scalar, through, name, nodes(), limit),
    };
    let shown = slice.nodes().map(|node| values.scalar(scalar, through, node)).collect();
    let mut panel = slice.panel("", scale, shown);
    let arrows = |flag: f32| {
        let vector = |node: usize| if field.flag[node] == flag { in_layer(node) } else { [f64::NAN; 2] };
        Arrows { usual: length, unit: unit.into(), ..slice.arrows(MOST_ARROWS, vector) }
    };
    panel.marks.push(Mark::Arrows(arrows(MEASURED)));
    if slice.nodes().any(|node| field.flag[node] == REPLACED) {
        let arrows = Arrows { name: "replaced".into(), is_hollow: true, ..arrows(REPLACED) };
        panel.marks.push(Mark::Arrows(arrows));
    }
    let counts =
        [MEASURED, REPLACED, NO_DATA].map(|flag| slice.nodes().filter(|&node| field.flag[node] == flag).count());
    let [low, high] = grid.bounds_mm(through);
    let (axis, place) = (AXES[through], short(slice.place_mm(), high - low));
    let title = format!("{quantity} at {axis} = {place} mm (layer {} of {})", slice.layer + 1, grid.shape[through]);
    let colour = values.meaning(scalar, through);
    Ok(Chart { title, notes: notes(&slice, &colour, counts), columns: 1, panels: vec![panel] })
}

/// A field in the unit that is drawn.
struct FieldValues<'a> {
    field: &'a Field,
    /// Factor from displacements.
    factor: f64,
}

impl FieldValues<'_> {
    fn component(&self, axis: usize, node: usize) -> f64 {
        f64::from([&self.field.u, &self.field.v, &self.field.w][axis][node]) * self.factor
    }

    /// A scalar at a vector; NaN without data.
    fn scalar(&self, scalar: Scalar, through: usize, node: usize) -> f64 {
        if self.field.flag[node] == NO_DATA {
            return f64::NAN;
        }
        match scalar {
            Scalar::Component(axis) => self.component(axis, node),
            Scalar::Speed => self.field.displacement_mm(node).length() * self.factor,
            Scalar::Uncertainty => self.field.uncertainty_mm(node).length() * self.factor,
            Scalar::Vorticity => {
                let [a, b] = [(through + 1) % 3, (through + 2) % 3];
                self.slope(b, a, node) - self.slope(a, b, node)
            }
        }
    }

    /// Slope of a component along an axis; NaN without a neighbour that has data.
    fn slope(&self, component: usize, axis: usize, node: usize) -> f64 {
        let found = self.field.layout.difference(node, axis, |node| self.field.flag[node] != NO_DATA);
        found.map_or(f64::NAN, |found| {
            (self.component(component, found.high) - self.component(component, found.low)) / found.distance_mm
        })
    }

    fn name(&self, scalar: Scalar, through: usize) -> String {
        match scalar {
            Scalar::Component(axis) => COMPONENTS[axis].into(),
            Scalar::Speed => if self.field.layout.dt_s.is_some() { "speed" } else { "length" }.into(),
            Scalar::Vorticity => format!("vorticity about {}", AXES[through]),
            Scalar::Uncertainty => "standard uncertainty".into(),
        }
    }

    fn unit(&self, scalar: Scalar) -> &'static str {
        match (scalar, self.field.layout.dt_s.is_some()) {
            (Scalar::Vorticity, true) => "1/s",
            (Scalar::Vorticity, false) => "1",
            (_, true) => "mm/s",
            (_, false) => "mm",
        }
    }

    /// The meaning of the colours, for the notes.
    fn meaning(&self, scalar: Scalar, through: usize) -> String {
        match scalar {
            Scalar::Component(axis) if axis == through => format!("{}, through the plane", COMPONENTS[axis]),
            Scalar::Component(axis) => format!("{}, in the plane", COMPONENTS[axis]),
            _ => self.name(scalar, through),
        }
    }

    /// The scale of the colours. All components share one; their usual size is `limit`.
    fn scale(
        &self,
        scalar: Scalar,
        through: usize,
        name: String,
        nodes: impl Iterator<Item = usize>,
        limit: f64,
    ) -> Axis {
        let most = || usual(nodes.map(|node| self.scalar(scalar, through, node)));
        match scalar {
            Scalar::Component(_) => Axis::symmetric(name, round_above(limit)),
            Scalar::Vorticity => Axis::symmetric(name, round_above(most())),
            Scalar::Speed | Scalar::Uncertainty => Axis::from_zero(name, round_above(most())),
        }
    }
}

/// The next round number: 1, 1.5, 2, 2.5, 3, 4, 5, 6 or 8 times a power of ten. 0 stays.
fn round_above(value: f64) -> f64 {
    const ROUND: [f64; 10] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    if !(value.is_finite() && value > 0.0) {
        return 0.0;
    }
    let power = 10f64.powi(value.log10().floor() as i32);
    ROUND.iter().map(|digits| digits * power).find(|round| *round >= value * (1.0 - 1e-6)).unwrap_or(value)
}

/// The lines under the title. `counts` are the vectors that are measured, replaced and without data.
fn notes(slice: &Slice, colour: &str, [measured, replaced, no_data]: [usize; 3]) -> Vec<String> {
    let [right, upright] = slice.across().map(|axis| COMPONENTS[axis]);
    let mut notes = vec![
        format!("colour: {colour}; arrows: {right} and {upright}, in the plane"),
        format!("this layer: {measured} measured, {replaced} replaced, {no_data} no data"),
    ];
    let stride = slice.arrow_stride(MOST_ARROWS);
    if stride != [1, 1] {
        notes.push(format!("one arrow for {} x {} vectors", stride[0], stride[1]));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use lf_core::field::VectorGrid;

    /// A solid turn about z of 0.1 rad in layers of growing w.
    fn turn() -> Field {
        let layout = VectorGrid { shape: [5, 4, 5], spacing_mm: [0.5, 0.25, 1.0], ..VectorGrid::default() };
        let mut field = Field::empty(layout);
        field.flag.fill(MEASURED);
        for n in 0..field.len() {
            let [x, y, z] = field.place_mm(n);
            (field.u[n], field.v[n], field.w[n]) = ((-0.1 * y) as f32, (0.1 * x) as f32, z as f32);
        }
        field
    }

    fn texts(field: &Field, picture: FieldPicture) -> Chart {
        field_chart(field, &picture).unwrap()
    }

    #[test]
    fn a_turn_has_twice_its_angle_as_vorticity_everywhere() {
        let field = turn();
        let values = FieldValues { field: &field, factor: 1.0 };
        assert!((0..field.len()).all(|n| (values.scalar(Scalar::Vorticity, 2, n) - 0.2).abs() < 1e-6));
        let chart = texts(&field, FieldPicture { scalar: Some(Scalar::Vorticity), ..FieldPicture::default() });
        let Mark::Map { scale, .. } = &chart.panels[0].marks[0] else { panic!("the first mark is the map") };
        assert_eq!((scale.name.as_str(), scale.range), ("vorticity about z, 1", Some([-0.2, 0.2])));
    }

    #[test]
    fn the_layer_is_the_one_that_shows_most_for_its_uncertainty() {
        let mut field = turn();
        let chosen = |field: &Field| layer(field, Cut::default()).unwrap();
        assert_eq!(chosen(&field), 4, "the largest motion");
        field.su.fill(0.01);
        field.sv.fill(0.01);
        for n in 0..field.len() {
            field.sw[n] = if n / 20 == 4 { 1e3 } else { 0.01 };
        }
        assert_eq!(chosen(&field), 3, "and not the one that is least certain");
        field.flag[60..70].fill(NO_DATA);
        assert_eq!(chosen(&field), 2, "nor one with half its vectors");
        field.flag.fill(NO_DATA);
        assert_eq!(chosen(&field), 2, "the middle, if there is nothing to see");
        assert_eq!(layer(&field, Cut { axis: 2, place_mm: Some(0.9) }).unwrap(), 1);
    }

    #[test]
    fn a_typed_range_is_kept_and_a_found_one_is_round() {
        let field = turn();
        let range = |picture: FieldPicture| {
            let chart = texts(&field, picture);
            let Mark::Map { scale, .. } = &chart.panels[0].marks[0] else { panic!("the first mark is the map") };
            scale.range.unwrap()
        };
        assert_eq!(range(FieldPicture { range: Some([-0.3, 0.7]), ..FieldPicture::default() }), [-0.3, 0.7]);
        assert_eq!(range(FieldPicture::default()), [-4.0, 4.0]);
        assert_eq!([0.0, 0.021, 0.2, 7.0, 1e-7].map(round_above), [0.0, 0.025, 0.2, 8.0, 1e-7]);
    }

    #[test]
    fn scalars_as_text() {
        assert_eq!("v".parse(), Ok(Scalar::Component(1)));
        assert_eq!("speed".parse(), Ok(Scalar::Speed));
        assert!("curl".parse::<Scalar>().unwrap_err().contains("vorticity"));
    }
}
