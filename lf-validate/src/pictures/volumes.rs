//! Pictures of the scores of volumes: quality, light along the optical axis, diameters of particles.

use super::series::{curve, from_zero, whole_curve};
use crate::scores::elongation::{BIN_VOX, BINS, Elongation, IDEAL_VOX};
use crate::scores::{depth::Depth, quality::Quality};
use lf_plot::{Axis, Chart, Mark, Panel, Place, three_figures};

/// Q, ghost and missed light, and the sum of the light, for each slice across z.
pub fn quality(score: &Quality) -> Chart {
    let by = &score.by_depth;
    let z = || Axis::new("z, mm");
    let mut q = Panel::new("Quality of each slice", z(), Axis::new("Q").over([0.0, 1.0]));
    q.marks = vec![
        Mark::line("Q of a slice", curve(&by.z_mm, &by.scores.q)),
        Mark::reference("Q of the whole", Place::Horizontal(score.whole.q)),
    ];
    let mut shares =
        Panel::new("Light where there was none, and light lost", z(), Axis::new("share of the slice's light"));
    shares.marks = vec![
        Mark::line("ghosts", curve(&by.z_mm, &by.scores.ghost_share)),
        Mark::line("missed", curve(&by.z_mm, &by.scores.missed_share)),
        Mark::reference("none", Place::Horizontal(0.0)),
    ];
    let mut light = Panel::new("Light of each slice", z(), Axis::new("sum of intensities, counts"));
    light.marks = vec![
        Mark::line("volume", whole_curve(&by.z_mm, &by.scores.volume_sum)),
        Mark::dashed("truth", whole_curve(&by.z_mm, &by.scores.truth_sum)),
    ];
    Chart {
        title: "Quality of a reconstructed volume against the truth".into(),
        notes: vec![format!(
            "Q {}, ghosts {} of the light, missed {}, best scale {}",
            three_figures(Some(score.whole.q)),
            three_figures(score.whole.ghost_share),
            three_figures(score.whole.missed_share),
            three_figures(score.whole.scale)
        )],
        columns: 1,
        panels: vec![q, shares, light],
    }
}

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

/// Histograms of the diameters along x, y and z, and their medians against depth.
pub fn elongation(score: &Elongation) -> Chart {
    let unit = score.pixel_mm.map_or([1.0; 3], |pixel| score.voxel_mm.map(|voxel| voxel / pixel));
    let name = if score.pixel_mm.is_some() { "px" } else { "voxels" };
    let histogram = &score.histogram;
    let shares = [("x", &histogram.x), ("y", &histogram.y), ("z", &histogram.z)].into_iter().zip(unit);
    let mut panels: Vec<Panel> = shares
        .map(|((axis, values), unit)| {
            let (x, y) = (Axis::new(format!("diameter along {axis}, {name}")), Axis::new("share of the particles"));
            let mut panel = Panel::new(format!("Along {axis}"), x, y);
            panel.marks = vec![
                Mark::steps("", (0..=BINS).map(|edge| edge as f64 * BIN_VOX * unit).collect(), values.clone()),
                Mark::reference("ideal particle, 3 voxels", Place::Vertical(IDEAL_VOX * unit)),
            ];
            panel
        })
        .collect();
    let by = &score.by_depth;
    let mut depth = Panel::new("Against depth, medians", Axis::new("z, mm"), Axis::new("diameter, voxels"));
    let medians = [("x", &by.x_vox), ("y", &by.y_vox), ("z", &by.z_vox)];
    depth.marks = medians.map(|(axis, medians)| Mark::line(axis, curve(&by.z_mm, medians))).to_vec();
    depth.marks.push(Mark::reference("ideal particle, 3 voxels", Place::Horizontal(IDEAL_VOX)));
    panels.push(depth);
    let counts = score.counts;
    let medians = score.diameter.medians().map(|median| three_figures(Some(median))).join(", ");
    Chart {
        title: "Diameters of reconstructed particles (4 sigma: where a particle falls to exp(-2) of its peak)".into(),
        notes: vec![
            format!("medians along x, y, z: {medians} {name}"),
            format!(
                "of {} particles {} measured, {} missed, {} merged with a neighbour, {} cut by the end of the volume",
                counts.particles, counts.measured, counts.missed, counts.merged, counts.cut
            ),
        ],
        columns: 2,
        panels,
    }
}
