//! Light along z.

use super::{figures, from_zero, whole};
use crate::scores::depth::Depth;
use lf_core::plot::{Axis, Chart, Mark, Panel, Place};

/// The section x, z of all light, its profile along z, and the brightest voxels.
pub fn depth(score: &Depth) -> Chart {
    let half_mm = 0.5 * score.spacing_mm[1];
    let (first, last) = (score.z_mm.first().copied().unwrap_or(0.0), score.z_mm.last().copied().unwrap_or(0.0));
    let z_range = [first - half_mm, last + half_mm];
    let z = || Axis::new("z, mm").over(z_range);
    let cells = [score.z_mm.len(), score.x_mm.len()];
    let [low, high] = [score.x_mm.first(), score.x_mm.last()].map(|x| x.copied().unwrap_or(0.0));
    let half_mm = 0.5 * score.spacing_mm[0];
    let mut section = Panel::new("Seen from above: light summed over y", z(), Axis::new("x, mm"));
    let transposed = |n: usize| score.section[n / cells[0] + cells[1] * (n % cells[0])];
    section.marks = vec![Mark::Map {
        values: (0..cells[0] * cells[1]).map(transposed).collect(),
        cells,
        x: z_range,
        y: [low - half_mm, high + half_mm],
        scale: Axis::new("light, counts"),
    }];
    let slab = |panel: &mut Panel| {
        if let Some(slab_mm) = score.slab_mm {
            panel.marks.insert(0, Mark::Region { name: "lit slab".into(), x: slab_mm });
        }
    };
    let mut profile = Panel::new(
        "Light of each slice, mean of the volumes",
        z(),
        from_zero("sum of intensities, counts", &score.profile),
    );
    profile.marks = vec![
        Mark::line("", whole(&score.z_mm, &score.profile)),
        Mark::reference("mean slice of the slab", Place::Horizontal(score.mean_slice)),
    ];
    slab(&mut profile);
    let mut peak = Panel::new(
        "Brightest voxel of each slice, mean of the volumes",
        z(),
        from_zero("intensity, counts", &score.peak),
    );
    peak.marks = vec![Mark::line("", whole(&score.z_mm, &score.peak))];
    slab(&mut peak);
    let (volumes, plural) = (score.volumes, if score.volumes == 1 { "" } else { "s" });
    let mut notes = vec![format!(
        "{volumes} volume{plural}; mean depth {} mm, standard deviation {} mm",
        figures(score.mean_z_mm),
        figures(score.std_z_mm)
    )];
    if score.slab_mm.is_some() {
        notes.push(format!(
            "outside the slab {} of the light; brightest slice there {} of the mean slice inside",
            figures(score.outside_share),
            figures(score.outside_peak)
        ));
    }
    Chart { title: "Light along the optical axis".into(), notes, columns: 1, panels: vec![section, profile, peak] }
}
