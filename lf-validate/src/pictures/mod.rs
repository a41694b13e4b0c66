//! What each score looks like: the charts behind `--plot`, each with the reference that it is to be compared with.

mod depth;
mod displacement;
mod divergence;
mod elongation;
mod ensemble;
mod quality;

pub use depth::depth;
pub use displacement::displacement;
pub use divergence::divergence;
pub use elongation::elongation;
pub use ensemble::ensemble;
pub use quality::quality;

use lf_core::plot::Axis;

/// Points of a curve; a missing value leaves a gap.
fn curve(x: &[f64], y: &[Option<f64>]) -> Vec<[f64; 2]> {
    x.iter().zip(y).map(|(x, y)| [*x, y.unwrap_or(f64::NAN)]).collect()
}

/// Points of a curve.
fn whole(x: &[f64], y: &[f64]) -> Vec<[f64; 2]> {
    x.iter().zip(y).map(|(x, y)| [*x, *y]).collect()
}

/// Edges of even bins from their middles; none of fewer than two.
fn edges(middles: &[f64]) -> Vec<f64> {
    let [first, second, ..] = middles else { return Vec::new() };
    let half = 0.5 * (second - first);
    [first - half].into_iter().chain(middles.iter().map(|middle| middle + half)).collect()
}

/// From 0 to a little above the greatest value; whatever fits where there is none.
fn from_zero(name: &str, values: &[f64]) -> Axis {
    let most = values.iter().copied().fold(0.0, f64::max);
    let axis = Axis::new(name);
    if most > 0.0 { axis.over([0.0, 1.05 * most]) } else { axis }
}

/// The normal density of a standard deviation about a mean, at places.
fn normal(x: &[f64], mean: f64, sigma: f64) -> Vec<[f64; 2]> {
    let height = 1.0 / (sigma * std::f64::consts::TAU.sqrt());
    x.iter().map(|x| [*x, height * (-0.5 * ((x - mean) / sigma).powi(2)).exp()]).collect()
}

/// Three figures, for notes; a missing number is a dash.
fn figures(value: Option<f64>) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else { return "-".into() };
    // No sign before 0.
    let value = value + 0.0;
    let digits = 2 - if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", digits.clamp(0, 12) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_figures() {
        for (value, wanted) in [(0.0, "0.00"), (1234.5, "1234"), (0.00123456, "0.00123"), (-9.876, "-9.88")] {
            assert_eq!(figures(Some(value)), wanted);
        }
        assert_eq!((figures(None), figures(Some(f64::NAN))), ("-".into(), "-".into()));
    }

    #[test]
    fn edges_lie_between_middles() {
        assert_eq!(edges(&[1.0, 3.0, 5.0]), [0.0, 2.0, 4.0, 6.0]);
        assert!(edges(&[1.0]).is_empty());
    }
}
