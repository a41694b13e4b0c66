//! Numbers for eyes.

/// The number 1, 2 or 5 times a power of ten that is nearest to `value` from below.
pub(super) fn round_below(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    // A hair of room for 0.2 = 2 x 0.1 in binary.
    [5.0, 2.0, 1.0].map(|digit| digit * power).into_iter().find(|round| *round <= value * (1.0 + 1e-9)).unwrap_or(power)
}

/// A place on an axis of length `span`, to a thousandth of it, without tails like 0.30000000000000004.
pub(super) fn short(value: f64, span: f64) -> String {
    plain(value, 3 - magnitude(span))
}

/// Three significant figures.
pub(super) fn figures(value: f64) -> String {
    plain(value, 2 - magnitude(value))
}

/// Power of ten of a number's first figure; 0 for zero.
fn magnitude(value: f64) -> i32 {
    if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 }
}

/// So many digits behind the point, less the zeros at their end.
fn plain(value: f64, digits: i32) -> String {
    let digits = digits.clamp(0, 12) as usize;
    let mut text = format!("{value:.digits$}");
    if digits > 0 {
        text.truncate(text.trim_end_matches('0').trim_end_matches('.').len());
    }
    if text == "-0" { "0".into() } else { text }
}

/// The `q`-th part of the values, 0 to 1, by nearest rank; 0 of none.
pub(super) fn quantile(mut values: Vec<f64>, q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (q * values.len() as f64).ceil() as usize;
    values.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers() {
        for (value, round) in [(0.0234, 0.02), (0.99, 0.5), (1.0, 1.0), (73.0, 50.0), (0.2, 0.2)] {
            assert!((round_below(value) - round).abs() < 1e-12 * round);
        }
    }

    #[test]
    fn numbers_as_text() {
        for (value, span, text) in
            [(0.1 + 0.2, 4.6, "0.3"), (-1e-9, 1.0, "0"), (0.00125, 0.01, "0.00125"), (40.0, 1e5, "40")]
        {
            assert_eq!(short(value, span), text);
        }
        for (value, text) in [(0.0, "0"), (0.051234, "0.0512"), (-2.5, "-2.5"), (1234.5, "1234"), (100.0, "100")] {
            assert_eq!(figures(value), text);
        }
    }

    #[test]
    fn one_wild_value_of_a_hundred_is_above_the_98th_percentile() {
        let mut values: Vec<f64> = (0..100).map(|i| i as f64 / 100.0).collect();
        values[3] = 1e9;
        assert_eq!(quantile(values, 0.98), 0.98);
        assert_eq!((quantile(vec![7.0], 0.98), quantile(Vec::new(), 0.98)), (7.0, 0.0));
    }
}
