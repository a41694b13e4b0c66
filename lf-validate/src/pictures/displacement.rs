//! Errors of a field of displacements.

use super::series::{edges, normal_density};
use crate::{scores::displacement::Displacement, scores::units::COMPONENTS};
use lf_core::plot::{Axis, Chart, Mark, Panel, Place, three_figures};

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
        panel.marks = vec![
            Mark::Steps { name: "error".into(), edges: edges(x), values: density.to_vec() },
            Mark::reference("no error", Place::Vertical(0.0)),
        ];
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
