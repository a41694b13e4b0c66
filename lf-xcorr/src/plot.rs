//! A picture of a field: one layer of it, across any axis.
//!
//! Colours show the component across the layer, blue to red about 0. All components and all layers share one scale, so that
//! a component without displacement is pale; it ends where 98 % of the vectors do. Arrows show the components in the layer,
//! centred on the places where they were measured; the key gives their scale. Replaced vectors are hollow. If the time
//! between the volumes is known, velocities are drawn, mm/s.

use lf_core::field::{Cut, MEASURED, NO_DATA, REPLACED};
use lf_core::plot::{Arrows, Axis, Chart, Mark, Slice, draw, short, usual};
use lf_core::{Field, Refusal};

const AXES: [&str; 3] = ["x", "y", "z"];
const COMPONENTS: [&str; 3] = ["u", "v", "w"];
/// Largest number of arrows along the longer side of the layer.
const MOST_ARROWS: usize = 47;
/// Least usual length of an arrow, as a share of the end of the colours: noise about zero must not look like a flow.
const LEAST_USUAL: f64 = 0.2;

/// The layer of `field` nearest to `cut` as an SVG. Refuses a place outside the field; panics if the axis is above 2.
pub fn slice(field: &Field, cut: Cut) -> Result<String, Refusal> {
    draw(&chart(field, cut)?)
}

fn chart(field: &Field, cut: Cut) -> Result<Chart, Refusal> {
    let grid = &field.layout;
    let slice = Slice { grid, through: cut.axis, layer: cut.layer(grid)? };
    let across = slice.across();
    let (quantity, unit) = if grid.dt_s.is_some() { ("Velocity", "mm/s") } else { ("Displacement", "mm") };
    let value =
        |axis: usize, node: usize| f64::from([&field.u, &field.v, &field.w][axis][node]) / grid.dt_s.unwrap_or(1.0);
    let in_layer = |node: usize| across.map(|axis| value(axis, node));

    // Both scales are those of the whole field, so that its layers can be compared. A field without a measured vector takes
    // the replaced ones.
    let scales = if field.flag.contains(&MEASURED) { MEASURED } else { REPLACED };
    let nodes = || (0..field.len()).filter(|&node| field.flag[node] == scales);
    let largest = |node: usize| [0, 1, 2].map(|axis| value(axis, node).abs()).into_iter().fold(0.0, f64::max);
    let limit = usual(nodes().map(largest));
    let length = usual(nodes().map(|node| in_layer(node)[0].hypot(in_layer(node)[1]))).max(LEAST_USUAL * limit);

    let arrows = |flag: f32| {
        let vector = |node: usize| if field.flag[node] == flag { in_layer(node) } else { [f64::NAN; 2] };
        Arrows { usual: length, unit: unit.into(), ..slice.arrows(MOST_ARROWS, vector) }
    };
    let has_data = |node: usize| field.flag[node] != NO_DATA;
    let values = slice.nodes().map(|node| if has_data(node) { value(cut.axis, node) } else { f64::NAN }).collect();
    let mut panel = slice.panel("", Axis::symmetric(format!("{}, {unit}", COMPONENTS[cut.axis]), limit), values);
    panel.marks.push(Mark::Arrows(arrows(MEASURED)));
    if slice.nodes().any(|node| field.flag[node] == REPLACED) {
        let arrows = Arrows { name: "replaced".into(), is_hollow: true, ..arrows(REPLACED) };
        panel.marks.push(Mark::Arrows(arrows));
    }

    let counts =
        [MEASURED, REPLACED, NO_DATA].map(|flag| slice.nodes().filter(|&node| field.flag[node] == flag).count());
    let [low, high] = grid.bounds_mm(cut.axis);
    let (axis, place) = (AXES[cut.axis], short(slice.place_mm(), high - low));
    let title = format!("{quantity} at {axis} = {place} mm (layer {} of {})", slice.layer + 1, grid.shape[cut.axis]);
    Ok(Chart { title, notes: notes(&slice, counts), columns: 1, panels: vec![panel] })
}

/// The lines under the title. `counts` are the vectors that are measured, replaced and without data.
fn notes(slice: &Slice, [measured, replaced, no_data]: [usize; 3]) -> Vec<String> {
    let [right, upright] = slice.across().map(|axis| COMPONENTS[axis]);
    let through = COMPONENTS[slice.through];
    let mut notes = vec![
        format!("colour: {through}, through the plane; arrows: {right} and {upright}, in the plane"),
        format!("this layer: {measured} measured, {replaced} replaced, {no_data} no data"),
    ];
    let stride = slice.arrow_stride(MOST_ARROWS);
    if stride != [1, 1] {
        notes.push(format!("one arrow for {} x {} vectors", stride[0], stride[1]));
    }
    notes
}
