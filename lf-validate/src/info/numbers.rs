//! Numbers as text.

/// A number to six figures, without trailing zeros.
pub(super) fn figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { value.to_string() };
    }
    let size = value.abs().log10().floor();
    if !(-5.0..9.0).contains(&size) {
        return format!("{value:.5e}");
    }
    let text = format!("{value:.*}", (5.0 - size).max(0.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Numbers to six figures with `x` between them.
pub(super) fn product(values: &[f64]) -> String {
    values.iter().map(|&value| figures(value)).collect::<Vec<_>>().join(" x ")
}

/// A whole number with spaces between thousands.
pub(super) fn whole(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (n, digit) in digits.chars().enumerate() {
        if n > 0 && (digits.len() - n).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// `part` of `whole`, per cent.
pub(super) fn percent(part: usize, whole: usize) -> String {
    format!("{} %", figures(100.0 * part as f64 / whole.max(1) as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_figures() {
        for (value, text) in [
            (0.0, "0"),
            (0.0055, "0.0055"),
            (1.0 / 3.0, "0.333333"),
            (-400.0, "-400"),
            (1234567.8, "1234568"),
            (1.5e-9, "1.50000e-9"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(figures(value), text);
        }
        assert_eq!(whole(14268800), "14 268 800");
        assert_eq!(whole(7), "7");
    }
}
