//! Divergence and noise of a field without truth.

use super::series::{edges, normal_density};
use crate::scores::divergence::Divergence;
use lf_core::plot::{Axis, Chart, Mark, Panel, Place, three_figures};

/// The density of the divergence, beside the density that the noise of the vectors alone would give.
pub fn divergence(score: &Divergence) -> Chart {
    let x = Axis::new("divergence (change of volume over volume, between the two volumes)");
    let mut panel = Panel::new("", x, Axis::new("density"));
    if let Some(histogram) = &score.pdf {
        panel.marks = vec![
            Mark::Steps { name: "measured".into(), edges: edges(&histogram.x), values: histogram.density.clone() },
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
