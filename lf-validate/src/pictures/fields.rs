//! Pictures of the scores of fields: errors against the truth, divergence and noise, many fields.

use super::series::{edges, normal_density};
use crate::scores::units::{AXES, COMPONENTS};
use crate::scores::{displacement::Displacement, divergence::Divergence, ensemble::Ensemble};
use lf_core::field::NO_DATA;
use lf_plot::{Arrows, Axis, Chart, Mark, Panel, Place, Slice, three_figures, usual};

/// The density of the errors of each component, beside the normal density with the uncertainty that the vectors state.
pub fn displacement(score: &Displacement) -> Chart {
    let unit = score.pdf.as_ref().map_or("vox", |pdf| pdf.unit);
    let unit_mm = score.pixel_mm.map_or(score.voxel_mm, |pixel| [pixel; 3]);
    let word = if unit == "px" { "px" } else { "voxels" };
    let panel = |axis: usize| {
        let name = COMPONENTS[axis];
        let (x, y) = (format!("error of {name} (measured - true), {word}"), format!("density, 1 / {word}"));
        let mut panel = Panel::new(format!("Component {name}"), Axis::new(x), Axis::new(y));
        let Some(pdf) = &score.pdf else { return panel };
        let histogram = &pdf.curves[axis];
        let (x, density) = middle(&histogram.x, &histogram.density);
        panel.marks =
            vec![Mark::steps("error", edges(x), density.to_vec()), Mark::reference("no error", Place::Vertical(0.0))];
        let stated = score.uncertainty.rms_stated_mm[axis] / unit_mm[axis];
        if stated > 0.0 {
            let curve = normal_density(x, score.all.spread_mm[axis].bias / unit_mm[axis], stated);
            panel.marks.push(Mark::reference("normal, with the stated uncertainty", Place::Curve(curve)));
        }
        panel
    };
    let components = |value: fn(&Displacement, usize) -> f64| {
        [0, 1, 2].map(|axis| three_figures(Some(value(score, axis) / unit_mm[axis]))).join(", ")
    };
    let percent = |shares: [f64; 3]| shares.map(|share| format!("{:.0}", 100.0 * share)).join(", ");
    let truth = match score.truth {
        "tracks" => "particle tracks",
        "flow" => "the scene's flow",
        _ => "a true field",
    };
    Chart {
        title: format!("Displacement errors against {truth}"),
        notes: vec![
            format!(
                "{} vectors scored, {} outliers, {} without data",
                score.all.vectors, score.all.outliers, score.no_data
            ),
            format!(
                "u, v, w: RMS {} {word}; bias {} {word}",
                components(|score, axis| score.all.spread_mm[axis].rms),
                components(|score, axis| score.all.spread_mm[axis].bias)
            ),
            format!(
                "within one stated uncertainty {} %, within two {} % (normal: 68, 95)",
                percent(score.uncertainty.within_1),
                percent(score.uncertainty.within_2)
            ),
        ],
        columns: 1,
        panels: vec![panel(0), panel(1), panel(2)],
    }
}

/// The bins about zero, as far as any holds a thousandth of the highest, with as many on either side.
fn middle<'a>(x: &'a [f64], density: &'a [f64]) -> (&'a [f64], &'a [f64]) {
    let least = 1e-3 * density.iter().copied().fold(0.0, f64::max);
    let centre = x.len() / 2;
    let filled = (0..x.len()).filter(|bin| density[*bin] > least);
    let far = filled.map(|bin| bin.abs_diff(centre)).max();
    let reach = far.map_or(centre, |far| (far + 2).max(5)).min(centre);
    (&x[centre - reach..=centre + reach], &density[centre - reach..=centre + reach])
}

/// The density of the divergence, beside the density that the noise of the vectors alone would give.
pub fn divergence(score: &Divergence) -> Chart {
    let x = Axis::new("divergence (change of volume over volume, between the two volumes)");
    let mut panel = Panel::new("", x, Axis::new("density"));
    if let Some(histogram) = &score.pdf {
        panel.marks = vec![
            Mark::steps("measured", edges(&histogram.x), histogram.density.clone()),
            Mark::reference("a flow that keeps its volume", Place::Vertical(0.0)),
        ];
        if score.rms_of_noise > 0.0 {
            let curve = normal_density(&histogram.x, 0.0, score.rms_of_noise);
            panel.marks.push(Mark::reference("what the noise alone would give", Place::Curve(curve)));
        }
    }
    let unit = if score.pixel_mm.is_some() { "px" } else { "voxels" };
    let unit_mm = score.pixel_mm.map_or(score.voxel_mm, |pixel| [pixel; 3]);
    let noise =
        [0, 1, 2].map(|component| three_figures(Some(score.noise.sigma_mm(component) / unit_mm[component]))).join(", ");
    Chart {
        title: "Divergence of a measured field".into(),
        notes: vec![
            format!(
                "{} places; RMS {}, of all gradients {}, of noise alone {}",
                score.count,
                three_figures(Some(score.rms)),
                three_figures(Some(score.rms_gradient)),
                three_figures(Some(score.rms_of_noise))
            ),
            format!("noise of u, v, w by third differences: {noise} {unit}"),
        ],
        columns: 1,
        panels: vec![panel],
    }
}

/// Largest number of arrows along the longer side of a panel.
const MOST_ARROWS: usize = 24;

/// Layer `layer` across axis `through`: the mean in the layer with arrows, the mean across it, the RMS fluctuation of
/// each component, and the vorticity across the layer. One field has no fluctuations.
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
    let is_one = found.fields < 2;
    for (component, rms) in COMPONENTS.iter().zip(&found.rms_mm).filter(|_| !is_one) {
        let values = slice.nodes().map(|node| scaled(rms, factor, node)).collect();
        panels.push(from_zero(format!("RMS fluctuation of {component}"), format!("{component}', {unit}"), values));
    }
    let title = format!("Vorticity about {}", AXES[through]);
    panels.push(signed(title, format!("vorticity, {}", found.vorticity_unit()), &found.vorticity[through], 1.0));

    let note = format!(
        "{} field{}; slice at {} = {} mm; colours end where 98 % of the values do",
        found.fields,
        if is_one { "" } else { "s" },
        AXES[through],
        three_figures(Some(slice.place_mm()))
    );
    let title = if is_one { format!("Mean {name}") } else { format!("Mean {name} and fluctuations") };
    Chart { title, notes: vec![note], columns: 3, panels }
}

#[cfg(test)]
mod tests {
    use super::middle;

    #[test]
    fn the_middle_holds_every_visible_bin() {
        let x: Vec<f64> = (-20..=20).map(f64::from).collect();
        let mut density = vec![0.0; 41];
        (density[20], density[28], density[2]) = (1.0, 0.01, 0.0005);
        let (shown, _) = middle(&x, &density);
        assert_eq!((shown[0], shown[shown.len() - 1]), (-10.0, 10.0));
    }
}
