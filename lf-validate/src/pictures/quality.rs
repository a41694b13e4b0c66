//! Quality against depth.

use super::series::{curve, whole_curve};
use crate::scores::quality::Quality;
use lf_core::plot::{Axis, Chart, Mark, Panel, Place, Style, three_figures};

/// Q, ghost and missed light, and the sum of the light, for each slice across z.
pub fn quality(score: &Quality) -> Chart {
    let by = &score.by_depth;
    let z = || Axis::new("z, mm");
    let mut q = Panel::new("Quality of each slice", z(), Axis::new("Q").over([0.0, 1.0]));
    q.marks = vec![
        Mark::line("Q of a slice", curve(&by.z_mm, &by.scores.q)),
        Mark::reference("Q of the whole", Place::Horizontal(score.q)),
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
        Mark::Line {
            name: "truth".into(),
            points: whole_curve(&by.z_mm, &by.scores.truth_sum),
            spread: None,
            style: Style::Dashed,
            with_points: false,
        },
    ];
    Chart {
        title: "Quality of a reconstructed volume against the truth".into(),
        notes: vec![format!(
            "Q {}, ghosts {} of the light, missed {}, best scale {}",
            three_figures(Some(score.q)),
            three_figures(score.ghost_share),
            three_figures(score.missed_share),
            three_figures(score.scale)
        )],
        columns: 1,
        panels: vec![q, shares, light],
    }
}
