//! Scores as the points, edges and axes of a chart.

use lf_plot::Axis;

/// Points of a curve: a few for each pixel across a picture. If there are more, the highest and the lowest of each run
/// are drawn, which look the same. A volume may have a million slices.
const MOST_POINTS: usize = 4000;

/// Points of a curve. A missing value is a gap.
pub(super) fn curve(x: &[f64], y: &[Option<f64>]) -> Vec<[f64; 2]> {
    points(x, y, |y| y.unwrap_or(f64::NAN))
}

/// Points of a curve without missing values.
pub(super) fn whole_curve(x: &[f64], y: &[f64]) -> Vec<[f64; 2]> {
    points(x, y, |y| *y)
}

fn points<T>(x: &[f64], y: &[T], value: impl Fn(&T) -> f64 + Copy) -> Vec<[f64; 2]> {
    let run = if x.len() <= MOST_POINTS { 1 } else { x.len().div_ceil(MOST_POINTS / 2) };
    let runs = x.chunks(run).zip(y.chunks(run));
    runs.flat_map(|(x, y)| {
        let values = || x.iter().zip(y).map(|(x, y)| [*x, value(y)]).filter(|[_, y]| !y.is_nan());
        let by_height = |a: &[f64; 2], b: &[f64; 2]| a[1].total_cmp(&b[1]);
        match (values().min_by(by_height), values().max_by(by_height)) {
            (Some(low), Some(high)) if low[0] < high[0] => vec![low, high],
            (Some(low), Some(high)) if low[0] > high[0] => vec![high, low],
            (Some(one), _) => vec![one],
            _ => vec![[x[0], f64::NAN]],
        }
    })
    .collect()
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
    use super::{MOST_POINTS, curve, edges, whole_curve};

    #[test]
    fn few_points_are_drawn_as_they_are() {
        assert_eq!(whole_curve(&[3.0, 1.0], &[4.0, 4.0]), [[3.0, 4.0], [1.0, 4.0]]);
        let gap = curve(&[0.0, 1.0, 2.0], &[Some(5.0), None, Some(7.0)]);
        assert!(gap[1][1].is_nan() && gap[0] == [0.0, 5.0] && gap[2] == [2.0, 7.0]);
    }

    /// Scar: every other slice of a deep volume is dark, and each of its curves took half a gigabyte.
    #[test]
    fn many_points_keep_their_highest_and_lowest_and_their_gaps() {
        let x: Vec<f64> = (0..100_000).map(f64::from).collect();
        let wave = |x: &f64| (0.0003 * x).sin() + if *x == 61_803.0 { 9.0 } else { 0.0 };
        let is_dark = |x: f64| x % 2.0 == 1.0 || (30_000.0..40_000.0).contains(&x);
        let y: Vec<Option<f64>> = x.iter().map(|x| (!is_dark(*x) || *x > 61_000.0).then(|| wave(x))).collect();
        let drawn = curve(&x, &y);
        assert!(drawn.len() <= MOST_POINTS && drawn.windows(2).all(|two| two[0][0] < two[1][0]));
        assert!(drawn.iter().any(|point| point[0] == 61_803.0 && point[1] > 8.0));
        let gaps = drawn.iter().filter(|point| point[1].is_nan()).count();
        assert!((190..=205).contains(&gaps), "{gaps}");
    }

    #[test]
    fn edges_lie_between_middles() {
        assert_eq!(edges(&[1.0, 3.0, 5.0]), [0.0, 2.0, 4.0, 6.0]);
        assert!(edges(&[1.0]).is_empty());
    }
}
