//! Scores as the points, edges and axes of a chart.

use lf_core::plot::Axis;

/// Points of a curve. A missing value is a gap.
pub(super) fn curve(x: &[f64], y: &[Option<f64>]) -> Vec<[f64; 2]> {
    x.iter().zip(y).map(|(x, y)| [*x, y.unwrap_or(f64::NAN)]).collect()
}

/// Points of a curve without missing values.
pub(super) fn whole_curve(x: &[f64], y: &[f64]) -> Vec<[f64; 2]> {
    x.iter().zip(y).map(|(x, y)| [*x, *y]).collect()
}

/// Edges of bins of equal width from their middles. Empty for fewer than two bins.
pub(super) fn edges(middles: &[f64]) -> Vec<f64> {
    let [first, second, ..] = middles else { return Vec::new() };
    let half = 0.5 * (second - first);
    [first - half].into_iter().chain(middles.iter().map(|middle| middle + half)).collect()
}

/// An axis from 0 to slightly above the largest value.
pub(super) fn from_zero(name: &str, values: &[f64]) -> Axis {
    Axis::from_zero(name, 1.05 * values.iter().copied().fold(0.0, f64::max))
}

/// The normal density of mean `mean` and standard deviation `sigma` at `x`.
pub(super) fn normal_density(x: &[f64], mean: f64, sigma: f64) -> Vec<[f64; 2]> {
    let height = 1.0 / (sigma * std::f64::consts::TAU.sqrt());
    x.iter().map(|x| [*x, height * (-0.5 * ((x - mean) / sigma).powi(2)).exp()]).collect()
}

#[cfg(test)]
mod tests {
    use super::edges;

    #[test]
    fn edges_lie_between_middles() {
        assert_eq!(edges(&[1.0, 3.0, 5.0]), [0.0, 2.0, 4.0, 6.0]);
        assert!(edges(&[1.0]).is_empty());
    }
}
