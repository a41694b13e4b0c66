//! A sensor with finer pixels: a blurred sensor's light is that of a finer one with less blur, smoothed by the rest.

use crate::normal::distribution;

/// A rest up to this width has seven weights, which have a Gaussian's moments up to the sixth. A wider one is one.
const SEVEN_WEIGHTS: f64 = 0.8;
/// Reach of a wider one, in its standard deviations.
const REST_REACH: f64 = 3.5;
/// Standard deviation of the finer sensor's blur, in its own pixels. With less, light would fall between them.
const FINE_BLUR: f64 = 0.45;
/// Smallest and largest number of finer pixels a pixel, a side.
const LEAST_PARTS: usize = 2;
const MOST_PARTS: usize = 8;

/// A Gaussian that smooths samples has at least this standard deviation, px.
const LEAST_SMOOTHED: f64 = 0.1;

/// A finer sensor.
#[derive(Debug, Clone)]
pub(super) struct FineSensor {
    /// Finer pixels a pixel, a side.
    pub(super) parts: usize,
    /// Variance of its blur and of its pixels, finer pixels^2.
    pub(super) variance: f64,
    /// Pixels that the rest moves light.
    pub(super) reach: usize,
    /// Shares of a pixel in the finer ones from `reach * parts` before its first one on, and their derivatives by the
    /// blur, 1/px.
    pub(super) weights: [Vec<f32>; 2],
}

impl FineSensor {
    /// The sensor's own pixels, as a picture has them with all blur. `variance` is that of their light in the stop,
    /// px^2.
    pub(super) fn whole(variance: f64) -> Self {
        Self { parts: 1, variance, reach: 0, weights: [vec![1.0], vec![]] }
    }

    /// Samples of light, which a pixel and a Gaussian smooth.
    pub(super) fn of_samples(parts: usize, sigma_px: f64) -> Self {
        let sigma = sigma_px.max(LEAST_SMOOTHED);
        let reach = (REST_REACH * sigma).ceil() as usize;
        let weight = |n: usize| {
            let off = (n as f64 + 0.5) / parts as f64 - reach as f64 - 0.5;
            let share = distribution((off + 0.5) / sigma) - distribution((off - 0.5) / sigma);
            (share / parts as f64) as f32
        };
        let weights = [(0..(2 * reach + 1) * parts).map(weight).collect(), vec![]];
        Self { parts, variance: sigma * sigma, reach, weights }
    }

    pub(super) fn new(sigma_px: f64) -> Self {
        let mut parts = LEAST_PARTS;
        while parts < MOST_PARTS && sigma_px * (parts as f64) < FINE_BLUR {
            parts += 1;
        }
        let whole = sigma_px * parts as f64;
        let sigma = whole.min(FINE_BLUR);
        let (rest, by_square) = rest(whole * whole - sigma * sigma);
        // A pixel takes the rests of its finer pixels.
        let reach = (rest.len() / 2).div_ceil(parts);
        let sum = |rest: &[f64]| -> Vec<f32> {
            let centre = (rest.len() / 2) as i64;
            let side = (reach * parts) as i64;
            let at = |n: i64| usize::try_from(n + centre).ok().and_then(|n| rest.get(n)).copied().unwrap_or(0.0);
            (-side..side + parts as i64)
                .map(|n| (0..parts as i64).map(|part| at(n - part)).sum::<f64>() as f32)
                .collect()
        };
        let by_blur: Vec<f64> = by_square.iter().map(|by| 2.0 * whole * parts as f64 * by).collect();
        Self { parts, variance: sigma * sigma + 1.0 / 12.0, reach, weights: [sum(&rest), sum(&by_blur)] }
    }
}

/// Weights of a Gaussian of this variance, and their derivatives by it. They carry the higher cumulants of the finer
/// pixel, which counts as a Gaussian.
fn rest(variance: f64) -> (Vec<f64>, Vec<f64>) {
    let [fourth, sixth] = [-1.0 / 120.0, 1.0 / 252.0];
    if variance <= SEVEN_WEIGHTS * SEVEN_WEIGHTS {
        let square = variance * variance;
        let moments = [variance, 3.0 * square + fourth, 15.0 * (square * variance + variance * fourth) + sixth];
        let by = [1.0, 6.0 * variance, 45.0 * square + 15.0 * fourth];
        return (seven(moments, 1.0), seven(by, 0.0));
    }
    let side = (REST_REACH * variance.sqrt()).ceil() as i64;
    let bell = |k: i64| (-0.5 * (k * k) as f64 / variance).exp();
    let total: f64 = (-side..=side).map(bell).sum();
    let by = |k: i64| bell(k) / total * ((k * k) as f64 / variance - 1.0) / (2.0 * variance);
    let pixel = seven([0.0, fourth, sixth], 1.0);
    let level = |k: i64| (-3..=3).map(|n| pixel[(n + 3) as usize] * bell(k - n)).sum::<f64>() / total;
    ((-side..=side).map(level).collect(), (-side..=side).map(by).collect())
}

/// Seven weights with this sum and these moments: the second, the fourth and the sixth.
fn seven([second, fourth, sixth]: [f64; 3], sum: f64) -> Vec<f64> {
    let a = (3.0 / 4.0) * second - (13.0 / 48.0) * fourth + (1.0 / 48.0) * sixth;
    let b = -(3.0 / 40.0) * second + (1.0 / 12.0) * fourth - (1.0 / 120.0) * sixth;
    let c = (1.0 / 180.0) * second - (1.0 / 144.0) * fourth + (1.0 / 720.0) * sixth;
    vec![c, b, a, sum - 2.0 * (a + b + c), a, b, c]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares spread by the rest and by the middles of the finer pixels, and change with the blur as said.
    #[test]
    fn weights_spread_light_by_the_rest() {
        for sigma_px in [0.1, 0.3, 0.45, 0.9, 1.6] {
            let sensor = FineSensor::new(sigma_px);
            let parts = sensor.parts as f64;
            let moment = |weights: &[f32], power: i32| -> f64 {
                let at = |n: usize| (n as f64 + 0.5) / parts - sensor.reach as f64 - 0.5;
                weights.iter().enumerate().map(|(n, weight)| f64::from(*weight) * at(n).powi(power)).sum()
            };
            let own = (sensor.variance - 1.0 / 12.0) / (parts * parts);
            let wanted = sigma_px * sigma_px - own + (1.0 - 1.0 / (parts * parts)) / 12.0;
            let [weights, by_blur] = &sensor.weights;
            assert!((moment(weights, 0) - parts).abs() < 1e-3 * parts, "{sigma_px}");
            assert!(moment(weights, 1).abs() < 1e-4);
            assert!((moment(weights, 2) / parts - wanted).abs() < 0.01 * wanted, "{sigma_px}: {wanted}");
            let more = FineSensor::new(1.01 * sigma_px);
            let slope = (moment(&more.weights[0], 2) - moment(weights, 2)) / (0.01 * sigma_px);
            let said = moment(by_blur, 2);
            assert!((slope - said).abs() < 0.03 * said || more.parts != sensor.parts, "{sigma_px}: {slope} for {said}");
        }
    }
}
