//! Diameters of particles.

use super::series::curve;
use crate::scores::elongation::{BIN_VOX, BINS, Elongation, IDEAL_VOX};
use lf_core::plot::{Axis, Chart, Mark, Panel, Place, three_figures};

/// Histograms of the diameters along x, y and z, and their medians against depth.
pub fn elongation(score: &Elongation) -> Chart {
    let unit = score.pixel_mm.map_or([1.0; 3], |pixel| score.voxel_mm.map(|voxel| voxel / pixel));
    let name = if score.pixel_mm.is_some() { "px" } else { "voxels" };
    let histogram = &score.histogram;
    let shares = [("x", &histogram.x), ("y", &histogram.y), ("z", &histogram.z)];
    let mut panels: Vec<Panel> = shares
        .into_iter()
        .zip(unit)
        .map(|((axis, values), unit)| {
            let (x, y) = (Axis::new(format!("diameter along {axis}, {name}")), Axis::new("share of the particles"));
            let mut panel = Panel::new(format!("Along {axis}"), x, y);
            panel.marks = vec![
                Mark::Steps {
                    name: String::new(),
                    edges: (0..=BINS).map(|edge| edge as f64 * BIN_VOX * unit).collect(),
                    values: values.clone(),
                },
                Mark::reference("ideal particle, 3 voxels", Place::Vertical(IDEAL_VOX * unit)),
            ];
            panel
        })
        .collect();
    let by = &score.by_depth;
    let mut depth = Panel::new("Against depth, medians", Axis::new("z, mm"), Axis::new("diameter, voxels"));
    depth.marks = [("x", &by.x_vox), ("y", &by.y_vox), ("z", &by.z_vox)]
        .into_iter()
        .map(|(axis, medians)| Mark::line(axis, curve(&by.z_mm, medians)))
        .collect();
    depth.marks.push(Mark::reference("ideal particle, 3 voxels", Place::Horizontal(IDEAL_VOX)));
    panels.push(depth);
    let counts = score.counts;
    let medians = score
        .diameter
        .px
        .as_ref()
        .unwrap_or(&score.diameter.vox)
        .median
        .map(|median| three_figures(Some(median)))
        .join(", ");
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
