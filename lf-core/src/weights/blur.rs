//! How a cell's edge looks through a voxel that is not a point: a step, a ramp, or an error function.

use std::sync::LazyLock;

/// Lateral distribution of a voxel's light about its centre, as seen on the array.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Blur {
    /// All at the centre.
    None,
    /// Even over `[-half, half]`, mm.
    Box { half: f64 },
    /// Gaussian of standard deviation `sigma`, mm.
    Gauss { sigma: f64 },
}

/// A Gaussian ends after this many standard deviations; the light left out is 6e-5.
const REACH_SIGMA: f64 = 4.0;
/// Steps of the table of the normal distribution.
const STEPS_PER_SIGMA: f64 = 128.0;

/// `(z Phi(z) + phi(z), Phi(z))` for z from -REACH_SIGMA in steps of 1 / STEPS_PER_SIGMA. Phi is the truncated normal
/// distribution. Linear interpolation is off by at most 3e-6 sigma.
static NORMAL: LazyLock<Vec<[f64; 2]>> = LazyLock::new(|| {
    let count = (2.0 * REACH_SIGMA * STEPS_PER_SIGMA) as usize + 2;
    let h = 1.0 / STEPS_PER_SIGMA;
    let mut area = 0.0;
    let mut cumulative: Vec<f64> = vec![0.0];
    // Integrate the density by Simpson's rule between nodes; the error is 1e-12.
    let density = |z: f64| (-0.5 * z * z).exp();
    for n in 0..count {
        let z = -REACH_SIGMA + n as f64 / STEPS_PER_SIGMA;
        area += h / 6.0 * (density(z) + 4.0 * density(z + 0.5 * h) + density(z + h));
        cumulative.push(area);
    }
    let total = cumulative[count - 2];
    let mut ramp = 0.0;
    (0..count)
        .map(|n| {
            let node = [ramp, cumulative[n] / total];
            ramp += 0.5 * (cumulative[n] + cumulative[n + 1]) / total / STEPS_PER_SIGMA;
            node
        })
        .collect()
});

impl Blur {
    /// Half width beyond which there is no light, mm.
    pub(crate) fn reach(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Box { half } => half,
            Self::Gauss { sigma } => REACH_SIGMA * sigma,
        }
    }

    /// The blur by an additional, independent displacement that is even over `width`. If the sum has another shape, its
    /// variance is kept. Used for slanted edges of cells, whose width is a fraction of a pixel.
    pub(crate) fn widened(self, width: f64) -> Self {
        let variance = width * width / 12.0;
        match self {
            _ if width == 0.0 => self,
            Self::None => Self::Box { half: 0.5 * width },
            Self::Box { half } => Self::Box { half: (half * half + 3.0 * variance).sqrt() },
            Self::Gauss { sigma } => Self::Gauss { sigma: (sigma * sigma + variance).sqrt() },
        }
    }

    /// Share of the light below `t`.
    #[inline]
    pub(crate) fn cdf(self, t: f64) -> f64 {
        match self {
            Self::None if t < 0.0 => 0.0,
            Self::None => 1.0,
            Self::Box { half } => (0.5 + 0.5 * t / half).clamp(0.0, 1.0),
            Self::Gauss { sigma } => interpolate(t / sigma, 1, 1.0),
        }
    }

    /// Integral of [`Blur::cdf`] up to `t`: 0 far below the centre, `t` far above it.
    #[inline]
    pub(crate) fn ramp(self, t: f64) -> f64 {
        match self {
            Self::None => t.max(0.0),
            Self::Box { half } if t <= -half => 0.0,
            Self::Box { half } if t >= half => t,
            Self::Box { half } => (t + half) * (t + half) / (4.0 * half),
            Self::Gauss { sigma } if t / sigma >= REACH_SIGMA => t,
            Self::Gauss { sigma } => sigma * interpolate(t / sigma, 0, t / sigma),
        }
    }
}

/// Entry `which` of the table at z; `above` beyond its upper end.
#[inline]
fn interpolate(z: f64, which: usize, above: f64) -> f64 {
    if z <= -REACH_SIGMA {
        return 0.0;
    }
    if z >= REACH_SIGMA {
        return above;
    }
    let place = (z + REACH_SIGMA) * STEPS_PER_SIGMA;
    let n = place as usize;
    let part = place - n as f64;
    let table = &*NORMAL;
    table[n][which] + part * (table[n + 1][which] - table[n][which])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_are_the_integrals_of_their_cdf() {
        for blur in [Blur::None, Blur::Box { half: 0.3 }, Blur::Gauss { sigma: 0.2 }] {
            let (mut sum, h) = (0.0, 1e-4);
            for n in -20_000..20_000 {
                let t = n as f64 * h;
                if n % 1000 == 0 {
                    assert!((blur.ramp(t) - sum).abs() < 2e-5, "{blur:?} at {t}: {} against {sum}", blur.ramp(t));
                }
                sum += h * blur.cdf(t + 0.5 * h);
            }
        }
    }

    #[test]
    fn gaussian_is_the_normal_distribution() {
        let blur = Blur::Gauss { sigma: 1.0 };
        // Phi(1) from tables; the truncation at 4 sigma changes it by 3e-5 at most.
        assert!((blur.cdf(1.0) - 0.841_344_7).abs() < 4e-5);
        assert!((blur.cdf(0.0) - 0.5).abs() < 1e-12);
        assert!((blur.ramp(0.0) - 0.398_942_3).abs() < 2e-4);
        assert!((blur.ramp(4.5) - 4.5).abs() < 1e-12);
        assert!((blur.ramp(4.0 - 1e-9) - 4.0).abs() < 1e-5);
    }
}
