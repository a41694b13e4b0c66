//! The strength of a smoothing, by generalised cross-validation that allows for errors which neighbours share.
//!
//! Equation: the score of a strength is `R / Q^2`. R is the mean square residual of the data, in their uncertainties,
//! and Q the mean square residual of errors alone, drawn with the correlation of overlapping windows and smoothed
//! alike. For independent errors Q^2 is the `(1 - tr S / n)^2` of Craven & Wahba (Numer. Math. 31, 1979) up to its
//! first order; for shared ones the plain trace would take them for flow and not smooth at all (Carmack, Spence &
//! Schucany, J. Nonparam. Stat. 24, 2012).

/// Constant: the least strength tried, the factor from one to the next, and how many at most. A strength s smooths
/// waves of less than `2 pi s^(1/4)` vectors.
const FIRST: f64 = 0.03;
const FACTOR: f64 = 4.0;
const MOST: usize = 14;

/// The strength with the best score, by a parabola through the three about the least one. `score` is asked for rising
/// strengths and may start from what it found before.
pub(super) fn best(mut score: impl FnMut(f64) -> f64) -> f64 {
    let mut scores: Vec<f64> = Vec::new();
    for n in 0..MOST {
        scores.push(score(FIRST * FACTOR.powi(n as i32)));
        // Two rises in turn end the search.
        if let [.., a, b, c] = scores.as_slice()
            && a < b
            && b < c
        {
            break;
        }
    }
    let least = (0..scores.len()).min_by(|a, b| scores[*a].total_cmp(&scores[*b])).unwrap_or(0);
    let offset = match (least.checked_sub(1).map(|n| scores[n]), scores[least], scores.get(least + 1)) {
        (Some(before), middle, Some(after)) => {
            let bend = before - 2.0 * middle + after;
            if bend > 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
        }
        _ => 0.0,
    };
    FIRST * FACTOR.powf(least as f64 + offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_of_a_parabola_in_the_logarithm_is_found() {
        for wanted in [1.0f64, 7.0, 300.0] {
            let found = best(|strength| 1.0 + (strength / wanted).ln().powi(2));
            assert!((found / wanted).ln().abs() < 1e-9, "{found} for {wanted}");
        }
        // No smoothing helps, or any does.
        assert!(best(|strength| strength) < 2.0 * FIRST);
        assert!(best(|strength| 1.0 / strength) > 1e6);
    }
}
