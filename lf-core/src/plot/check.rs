//! Refuses charts that cannot be drawn.

use super::chart::{Axis, Chart, Mark};
use crate::Refusal;

/// Refuses lists of different lengths, and ranges that are empty or off their axis.
pub(super) fn check(chart: &Chart) -> Result<(), Refusal> {
    for panel in &chart.panels {
        check_axis(&panel.x)?;
        check_axis(&panel.y)?;
        panel.marks.iter().try_for_each(check_mark)?;
    }
    Ok(())
}

fn check_axis(axis: &Axis) -> Result<(), Refusal> {
    match axis.range {
        Some([first, last]) if !(axis.holds(first) && axis.holds(last) && first != last) => {
            let kind = if axis.is_log { "two different numbers above 0" } else { "two different numbers" };
            Err(Refusal::new(format!("axis '{}' from {first} to {last}", axis.name), format!("wanted {kind}")))
        }
        _ => Ok(()),
    }
}

fn check_mark(mark: &Mark) -> Result<(), Refusal> {
    let agree = |found: usize, items: &str, wanted: usize| {
        if found == wanted {
            return Ok(());
        }
        Err(Refusal::new(format!("'{}' has {found} {items}", mark.name()), format!("wanted {wanted}")))
    };
    match mark {
        Mark::Line { points, spread, .. } => {
            agree(spread.as_ref().map_or(points.len(), Vec::len), "spreads", points.len())
        }
        Mark::Points { points, spread, labels, .. } => {
            agree(spread.as_ref().map_or(points.len(), Vec::len), "spreads", points.len())?;
            agree(labels.as_ref().map_or(points.len(), Vec::len), "labels", points.len())
        }
        Mark::Steps { edges, values, .. } => {
            agree(edges.len(), "edges", if values.is_empty() { edges.len() } else { values.len() + 1 })
        }
        Mark::Map { values, cells, x, y, scale, .. } => {
            check_axis(scale)?;
            agree(values.len(), "cells", cells[0] * cells[1])?;
            if [x, y].into_iter().flatten().all(|edge| edge.is_finite()) && x[0] != x[1] && y[0] != y[1] {
                return Ok(());
            }
            Err(Refusal::new(format!("a map over x {x:?} and y {y:?}"), "wanted edges that differ"))
        }
        Mark::Arrows(arrows) => agree(arrows.vectors.len(), "vectors", arrows.points.len()),
        Mark::Reference { .. } | Mark::Region { .. } => Ok(()),
    }
}
