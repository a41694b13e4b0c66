//! The strength of a smoothing: the one with the least expected error.
//!
//! Equation: `R + 2 P` estimates the mean square error of the smooth field, up to a constant (Mallows, Technometrics,
//! 1973). R is the mean square residual of the data and P the mean product of drawn errors before and after the
//! smoothing, both in the stated uncertainties. For independent errors P is the trace of the smoother over the number
//! of data.
//!
//! Departure: generalised cross-validation, which divides R by `(1 - P)^2`, does not need the size of the errors, but
//! it works only if P is small. Windows that overlap share their errors, so nearly all of an error passes a smoother
//! that keeps the flow, and P is near 1. There cross-validation would smooth the flow away.

/// Constant: the weakest strength tried, the factor from one to the next, and the number of them. A strength s smooths
/// waves shorter than `2 pi s^(1/4)` vectors: the last, 123, waves of 21 vectors, about five windows.
const FIRST: f64 = 0.03;
const FACTOR: f64 = 4.0;
const TRIALS: usize = 7;

/// The strength with the lowest score, by a parabola through the three scores around it. `score` is called with rising
/// strengths and may start from its last solution.
pub(super) fn best(mut score: impl FnMut(f64) -> f64) -> f64 {
    let mut scores: Vec<f64> = Vec::new();
    for n in 0..TRIALS {
        scores.push(score(FIRST * FACTOR.powi(n as i32)));
        // Stop after two rises in a row.
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
        for wanted in [0.5f64, 2.0, 30.0] {
            let found = best(|strength| 1.0 + (strength / wanted).ln().powi(2));
            assert!((found / wanted).ln().abs() < 1e-9, "{found} for {wanted}");
        }
        // No smoothing helps, and any smoothing helps.
        assert!(best(|strength| strength) < 2.0 * FIRST);
        assert!((best(|strength| 1.0 / strength) / 122.88 - 1.0).abs() < 1e-9);
    }
}
