//! Light along the optical axis, z.

use super::series::{from_zero, whole_curve};
use crate::scores::depth::Depth;
use lf_core::plot::{Axis, Chart, Mark, Panel, Place, three_figures};

/// All light summed over y, its profile along z, and the brightest voxel of each slice.
pub fn depth(score: &Depth) -> Chart {
    let light = profile(
        score,
        "Light of each slice, mean of the volumes",
        from_zero("sum of intensities, counts", &score.profile),
        vec![
            Mark::line("", whole_curve(&score.z_mm, &score.profile)),
            Mark::reference("mean slice of the slab", Place::Horizontal(score.mean_slice)),
        ],
    );
    let peak = profile(
        score,
        "Brightest voxel of each slice, mean of the volumes",
        from_zero("intensity, counts", &score.peak),
        vec![Mark::line("", whole_curve(&score.z_mm, &score.peak))],
    );
    let (volumes, plural) = (score.volumes, if score.volumes == 1 { "" } else { "s" });
    let mut notes = vec![format!(
        "{volumes} volume{plural}; mean depth {} mm, standard deviation {} mm",
        three_figures(score.mean_z_mm),
        three_figures(score.std_z_mm)
    )];
    if score.slab_mm.is_some() {
        notes.push(format!(
            "outside the slab {} of the light; brightest slice there {} of the mean slice inside",
            three_figures(score.outside_share),
            three_figures(score.outside_peak)
        ));
    }
    Chart { title: "Light along the optical axis".into(), notes, columns: 1, panels: vec![section(score), light, peak] }
}

/// The outer edges of the first and the last slice, mm.
fn edges_mm(middles_mm: &[f64], spacing_mm: f64) -> [f64; 2] {
    let [first, last] = [middles_mm.first(), middles_mm.last()].map(|middle| middle.copied().unwrap_or(0.0));
    [first - 0.5 * spacing_mm, last + 0.5 * spacing_mm]
}

fn z_axis(score: &Depth) -> Axis {
    Axis::new("z, mm").over(edges_mm(&score.z_mm, score.spacing_mm[1]))
}

/// The light summed over y as a map over z and x.
fn section(score: &Depth) -> Panel {
    let cells = [score.z_mm.len(), score.x_mm.len()];
    let transposed = |n: usize| score.section[n / cells[0] + cells[1] * (n % cells[0])];
    let mut panel = Panel::new("Seen from above: light summed over y", z_axis(score), Axis::new("x, mm"));
    panel.marks = vec![Mark::Map {
        values: (0..cells[0] * cells[1]).map(transposed).collect(),
        cells,
        x: edges_mm(&score.z_mm, score.spacing_mm[1]),
        y: edges_mm(&score.x_mm, score.spacing_mm[0]),
        scale: Axis::new("light, counts"),
    }];
    panel
}

/// A value of each slice against z, over the lit slab if it is known.
fn profile(score: &Depth, title: &str, y: Axis, marks: Vec<Mark>) -> Panel {
    let slab = score.slab_mm.map(|x| Mark::Region { name: "lit slab".into(), x });
    Panel { marks: slab.into_iter().chain(marks).collect(), ..Panel::new(title, z_axis(score), y) }
}
