//! Numbers as text: one by one, and many values in a line.

use std::fmt;

/// A number that somebody set, to six figures.
pub(super) fn figures(value: f64) -> String {
    rounded(value, 6)
}

/// A number that was measured, to four figures.
pub(super) fn short(value: f64) -> String {
    rounded(value, 4)
}

/// A number to `count` figures, without trailing zeros; whole numbers keep all of theirs.
fn rounded(value: f64, count: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".into() } else { value.to_string() };
    }
    let size = value.abs().log10().floor();
    if !(-5.0..9.0).contains(&size) {
        return format!("{value:.*e}", count as usize - 1);
    }
    let text = format!("{value:.*}", (f64::from(count) - 1.0 - size).max(0.0) as usize);
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
    format!("{} %", rounded(100.0 * part as f64 / whole.max(1) as f64, 3))
}

/// Extremes and sums of stored values; those that are not finite are only counted. Prints as one line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Summary {
    pub count: usize,
    pub not_finite: usize,
    pub zero: usize,
    /// NaN without a finite value, as `max` is.
    pub min: f64,
    pub max: f64,
    pub sum: f64,
}

impl Summary {
    pub fn of<'a>(values: impl IntoIterator<Item = &'a f32>) -> Self {
        let mut summary = Self { count: 0, not_finite: 0, zero: 0, min: f64::NAN, max: f64::NAN, sum: 0.0 };
        for &value in values {
            summary.count += 1;
            if !value.is_finite() {
                summary.not_finite += 1;
                continue;
            }
            let value = f64::from(value);
            summary.zero += usize::from(value == 0.0);
            summary.min = summary.min.min(value);
            summary.max = summary.max.max(value);
            summary.sum += value;
        }
        summary
    }

    /// Mean of the finite values. NaN without one.
    pub fn mean(&self) -> f64 {
        self.sum / (self.count - self.not_finite) as f64
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.count == self.not_finite {
            return f.write_str(if self.count == 0 { "no values" } else { "no finite value" });
        }
        let [min, max, mean, sum] = [self.min, self.max, self.mean(), self.sum].map(short);
        write!(f, "min {min}, max {max}, mean {mean}, sum {sum}")?;
        if self.not_finite > 0 { write!(f, ", {} not finite", self.not_finite) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_figures_and_measured_ones_four() {
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
        for (value, text) in
            [(0.0000537023, "0.0000537"), (7956976.2, "7956976"), (-0.0253689, "-0.02537"), (2e-9, "2.000e-9")]
        {
            assert_eq!(short(value), text);
        }
        assert_eq!(percent(13_553, 13_608), "99.6 %");
        assert_eq!(whole(14268800), "14 268 800");
        assert_eq!(whole(7), "7");
    }

    #[test]
    fn values_that_are_not_finite_are_only_counted() {
        let summary = Summary::of(&[0.0, f32::NAN, -2.0, f32::INFINITY, 5.0]);
        assert_eq!((summary.count, summary.not_finite, summary.zero), (5, 2, 1));
        assert_eq!((summary.min, summary.max, summary.mean()), (-2.0, 5.0, 1.0));
        assert!(Summary::of(&[]).mean().is_nan());
    }
}
