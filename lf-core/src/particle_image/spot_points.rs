//! Points that stand for a particle where waves of its parts differ by more than a shift.

/// Points along an axis that stand for a particle: few where no edge of the cell cuts its light, more where one does.
/// `turn` is by how much a standard deviation turns the finest fringes that a pixel shows.
fn point_count(is_cut: bool, turn: f64) -> usize {
    match is_cut {
        _ if turn < 1.4 => 2,
        true if turn > 4.0 => 7,
        true if turn > 2.2 => 5,
        _ => 3,
    }
}

/// Points of a particle along an axis: even steps, with shares of its light by a Gaussian.
#[derive(Debug, Clone, Copy)]
pub(super) struct Points {
    count: usize,
    step_mm: f64,
    /// Standard deviations in a step.
    step: f64,
    whole: f64,
}

impl Points {
    /// One point in the middle.
    pub(super) const ONE: Self = Self { count: 1, step_mm: 0.0, step: 1.0, whole: 1.0 };

    /// Points for a particle of this standard deviation, mm on the array.
    pub(super) fn of_spot(sigma_mm: f64, is_cut: bool, turn: f64) -> Self {
        Self::new(point_count(is_cut, turn), sigma_mm)
    }

    /// Points with the mean and the variance of a particle.
    fn new(count: usize, sigma_mm: f64) -> Self {
        let step = 3.0 / (count as f64).sqrt();
        let points = Self { count, step_mm: 0.0, step, whole: 1.0 };
        let whole: f64 = points.all().map(|(_, share)| share).sum();
        let steps2 = points.offsets().zip(points.all()).map(|(n, (_, share))| n * n * share / whole).sum::<f64>();
        Self { step_mm: sigma_mm / steps2.sqrt(), whole, ..points }
    }

    /// Steps from the middle.
    fn offsets(&self) -> impl Iterator<Item = f64> {
        let middle = 0.5 * (self.count - 1) as f64;
        (0..self.count).map(move |n| n as f64 - middle)
    }

    /// Places, mm on the array, and shares.
    pub(super) fn all(&self) -> impl Iterator<Item = (f64, f64)> {
        let Self { step_mm, step, whole, .. } = *self;
        self.offsets().map(move |n| (n * step_mm, (-0.5 * (n * step).powi(2)).exp() / whole))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_moments_of_a_gaussian() {
        for (count, within) in [(3, 0.1), (5, 0.02), (7, 0.004)] {
            let points = Points::new(count, 2.0);
            let moment = |power: i32| points.all().map(|(x, share)| share * (x / 2.0).powi(power)).sum::<f64>();
            assert!((moment(0) - 1.0).abs() < 1e-12 && moment(1).abs() < 1e-12 && (moment(2) - 1.0).abs() < 1e-12);
            assert!((moment(4) / 3.0 - 1.0).abs() < within, "{count}: {}", moment(4));
        }
        assert_eq!(Points::ONE.all().collect::<Vec<_>>(), [(0.0, 1.0)]);
    }
}
