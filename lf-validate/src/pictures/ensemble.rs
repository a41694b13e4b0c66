//! One layer of the mean and the fluctuations of many fields.

use crate::scores::ensemble::Ensemble;
use crate::scores::units::{AXES, COMPONENTS};
use lf_core::field::NO_DATA;
use lf_core::plot::{Arrows, Axis, Chart, Mark, Slice, three_figures, usual};

/// Largest number of arrows along the longer side of a panel.
const MOST_ARROWS: usize = 24;

/// Layer `layer` across axis `through`: the mean in the layer with arrows, the mean across it, the RMS fluctuation of each
/// component, and the vorticity across the layer.
pub fn ensemble(found: &Ensemble, through: usize, layer: usize) -> Chart {
    let grid = &found.mean.layout;
    let (factor, unit) = grid.dt_s.map_or((1.0, "mm"), |dt_s| (1.0 / dt_s, "mm/s"));
    let slice = Slice { grid, through, layer };
    let across = slice.across();
    let [right, upright, normal] = [across[0], across[1], through].map(|axis| COMPONENTS[axis]);
    let name = if grid.dt_s.is_some() { "velocity" } else { "displacement" };
    let mean = [&found.mean.u, &found.mean.v, &found.mean.w];

    // Values of the layer in the unit drawn; NaN without data.
    let scaled = |values: &[f32], factor: f64, node: usize| {
        if found.mean.flag[node] == NO_DATA { f64::NAN } else { f64::from(values[node]) * factor }
    };
    let in_layer = |node: usize| across.map(|axis| scaled(mean[axis], factor, node));
    let from_zero = |title: String, name: String, values: Vec<f64>| {
        slice.panel(title, Axis::from_zero(name, usual(values.iter().copied())), values)
    };
    let signed = |title: String, name: String, values: &[f32], factor: f64| {
        let values: Vec<f64> = slice.nodes().map(|node| scaled(values, factor, node)).collect();
        slice.panel(title, Axis::symmetric(name, usual(values.iter().copied())), values)
    };

    let lengths = slice.nodes().map(|node| in_layer(node)[0].hypot(in_layer(node)[1])).collect();
    let title = format!("Mean ({right}, {upright}): length in colour");
    let mut first = from_zero(title, format!("length, {unit}"), lengths);
    first.marks.push(Mark::Arrows(Arrows { unit: unit.into(), ..slice.arrows(MOST_ARROWS, in_layer) }));
    let title = format!("Mean {normal}, through the slice");
    let mut panels = vec![first, signed(title, format!("{normal}, {unit}"), mean[through], factor)];
    for (component, rms) in COMPONENTS.iter().zip(&found.rms_mm) {
        let values = slice.nodes().map(|node| scaled(rms, factor, node)).collect();
        panels.push(from_zero(format!("RMS fluctuation of {component}"), format!("{component}', {unit}"), values));
    }
    let title = format!("Vorticity about {}", AXES[through]);
    panels.push(signed(title, format!("vorticity, {}", found.vorticity_unit()), &found.vorticity[through], 1.0));

    let note = format!(
        "{} fields; slice at {} = {} mm; colours end where 98 % of the values do",
        found.fields,
        AXES[through],
        three_figures(Some(slice.place_mm()))
    );
    Chart { title: format!("Mean {name} and fluctuations"), notes: vec![note], columns: 3, panels }
}
