//! Fits that outliers do not move: Tukey's weights, and fits repeated without outliers.

use super::polynomial::TiePoint;
use glam::DVec2;
use lf_core::statistics::upper_median;

/// Residuals beyond this many standard deviations, estimated from the median, are outliers (Tukey's biweight).
pub(crate) const OUTLIER: f64 = 4.5;
/// Median distance of a two-dimensional normal scatter, in standard deviations of one coordinate: sqrt(2 ln 2).
const MEDIAN_DISTANCE: f64 = 1.177_410_022_515_474_7;
/// Smaller residuals are rounding and never outliers, px.
const LEAST_OUTLIER_PX: f64 = 1e-4;

/// Tukey's weight of a residual given in standard deviations: 1 at zero, 0 for an outlier.
pub(crate) fn tukey_weight(residual: f64) -> f64 {
    let part = residual / OUTLIER;
    if part >= 1.0 { 0.0 } else { (1.0 - part * part).powi(2) }
}

/// Standard deviation of one coordinate from the median of the distances, at least 1e-9; 1 if there are no distances.
pub(crate) fn deviation(mut distances: Vec<f64>) -> f64 {
    upper_median(&mut distances).map_or(1.0, |median| (median / MEDIAN_DISTANCE).max(1e-9))
}

/// Repeats a fit without its outliers until the set of kept points stays the same. Returns the fit and which points it
/// kept. The distance of each point is divided by its own spread; the unit of the spreads does not matter.
pub(crate) fn without_outliers<F>(
    ties: &[TiePoint],
    spreads: &[f64],
    fit: impl Fn(&[TiePoint]) -> Option<F>,
    at: impl Fn(&F, DVec2) -> DVec2 + Sync,
) -> Option<(F, Vec<bool>)> {
    let mut kept = vec![true; ties.len()];
    let mut found = fit(ties)?;
    for _ in 0..20 {
        let off = |tie: &TiePoint| at(&found, tie.0).distance(tie.1);
        let distances: Vec<f64> = ties.iter().zip(spreads).map(|(tie, spread)| off(tie) / spread).collect();
        let limit = OUTLIER * upper_median(&mut distances.clone())? / MEDIAN_DISTANCE;
        let is_near = |(distance, spread): (&f64, &f64)| *distance <= limit.max(LEAST_OUTLIER_PX / spread);
        let next: Vec<bool> = distances.iter().zip(spreads).map(is_near).collect();
        if next == kept {
            break;
        }
        kept = next;
        found = fit(&chosen(ties, &kept))?;
    }
    Some((found, kept))
}

pub(crate) fn chosen<T: Copy>(items: &[T], kept: &[bool]) -> Vec<T> {
    items.iter().zip(kept).filter(|(_, kept)| **kept).map(|(item, _)| *item).collect()
}
