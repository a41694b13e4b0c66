//! The ends of an axis, and where a value lies between them.

/// The two ends of an axis; the first may be the greater one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub first: f64,
    pub last: f64,
    pub is_log: bool,
}

impl Range {
    /// A value's share of the axis: 0 at the first end, 1 at the last. NaN for a value that has no place on the axis.
    pub fn share(&self, value: f64) -> f64 {
        let along = |value: f64| if self.is_log { value.ln() } else { value };
        let share = (along(value) - along(self.first)) / (along(self.last) - along(self.first));
        // The logarithm of 0 is infinite. Ten lengths of the axis away is far enough for a clipped line.
        if share.is_finite() { share.clamp(-10.0, 11.0) } else { f64::NAN }
    }

    /// The value at a share.
    pub fn value(&self, share: f64) -> f64 {
        if self.is_log {
            (self.first.ln() + share * (self.last.ln() - self.first.ln())).exp()
        } else {
            self.first + share * (self.last - self.first)
        }
    }

    /// The smaller end.
    pub fn low(&self) -> f64 {
        self.first.min(self.last)
    }

    /// The greater end.
    pub fn high(&self) -> f64 {
        self.first.max(self.last)
    }

    /// Whether a value lies on the axis, up to rounding.
    pub fn contains(&self, value: f64) -> bool {
        let tolerance = 1e-9;
        (-tolerance..=1.0 + tolerance).contains(&self.share(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_values_are_inverse() {
        for range in [Range { first: -2.0, last: 6.0, is_log: false }, Range { first: 100.0, last: 0.1, is_log: true }]
        {
            assert!((range.share(range.value(0.3)) - 0.3).abs() < 1e-12);
            assert!(range.share(f64::NAN).is_nan());
        }
        assert!(Range { first: 0.1, last: 1.0, is_log: true }.share(-1.0).is_nan());
    }
}
