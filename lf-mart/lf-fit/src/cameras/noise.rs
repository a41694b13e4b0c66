//! The noise of a pixel: `variance = gain * expected counts + read variance`.

use lf_core::statistics::{ranked, upper_median};
use lf_core::{Camera, Refusal};
use ndarray::ArrayView2;

/// Noise of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Counts of an electron, or of a ray.
    pub gain: f64,
    /// Variance of a pixel without light, counts^2.
    pub read_variance: f64,
}

/// Counts change the variance by less than this share: it counts as constant.
const LEAST_GAIN: f64 = 1e-6;
/// Bins of equal numbers of pixels, by expected counts, in which the noise is found.
const BINS: usize = 24;
/// Median of the square of a normal variable, over its variance.
const MEDIAN_OF_SQUARE: f64 = 0.454_936;
/// Rounds of the weighted fit of a line.
const LINE_ROUNDS: usize = 6;
/// Noise is found from at least this number of pixels, and from at most this number.
const LEAST_PIXELS: usize = 2000;
pub(crate) const MOST_PIXELS: usize = 2_000_000;
/// Gain and read noise before any is found, as a share of a usual pixel, which is this share of the peak brightness.
const FIRST_NOISE: f64 = 0.02;
const USUAL: f64 = 0.1;
/// Quantile of the lit pixels that is taken as the peak brightness.
const BRIGHTEST: f64 = 0.999;
/// Noise below this share of the brightest expected pixel cannot be distinguished from the model's own errors.
const LEAST_SHARE: f64 = 1e-4;

/// Pixels of one vector step.
pub(crate) const LANES: usize = 16;

/// Counts of some pixels: seen, expected without a change, and with it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lanes {
    pub(crate) seen: [f64; LANES],
    pub(crate) others: [f64; LANES],
    pub(crate) expected: [f64; LANES],
}

/// The natural logarithm of a positive, normal number, to 1e-14: `2 artanh((m - 1) / (m + 1))` of the mantissa. The
/// standard library takes one number at a time.
#[inline(always)]
fn logarithm(x: f64) -> f64 {
    // The exponent of x over the root of a half, so that the mantissa is within that root of 1.
    const HALF_ROOT: u64 = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    const ONE: u64 = 1f64.to_bits();
    // Whole numbers below 2^52 are the last bits of those above it.
    const WHOLE: f64 = (1u64 << 52) as f64;
    let bits = x.to_bits().wrapping_add(ONE - HALF_ROOT);
    let exponent = f64::from_bits((bits >> 52) | WHOLE.to_bits()) - WHOLE - 1023.0;
    let m = f64::from_bits((bits & ((1 << 52) - 1)).wrapping_add(HALF_ROOT));
    let s = (m - 1.0) / (m + 1.0);
    let t = s * s;
    let series = 1.0 / 17.0;
    let series = 1.0 / 15.0 + t * series;
    let series = 1.0 / 13.0 + t * series;
    let series = 1.0 / 11.0 + t * series;
    let series = 1.0 / 9.0 + t * series;
    let series = 1.0 / 7.0 + t * series;
    let series = 1.0 / 5.0 + t * series;
    let series = 1.0 / 3.0 + t * series;
    exponent * std::f64::consts::LN_2 + 2.0 * (s + s * t * series)
}

impl Noise {
    /// Variance of a pixel of `expected` counts.
    #[inline(always)]
    pub fn variance(&self, expected: f32) -> f32 {
        (self.gain as f32) * expected.max(0.0) + self.read_variance as f32
    }

    /// -2 log likelihood of pixels with `expected` counts, minus that with `others` counts.
    ///
    /// Equation: the quasi-likelihood (Wedderburn 1974) with the slope `-2 (seen - expected) / variance`, a shifted
    /// Poisson distribution. A normal distribution of this variance would weigh light where none is expected too much:
    /// particles would be split and moved to cover it.
    #[inline(always)]
    pub(crate) fn deviance(&self, lanes: &Lanes) -> f64 {
        let (gain, read) = (self.gain, self.read_variance);
        let mut sums = [0.0; LANES];
        for (k, sum) in sums.iter_mut().enumerate() {
            let (seen, others, expected) = (lanes.seen[k], lanes.others[k], lanes.expected[k]);
            let (v0, v1) = (gain * others.max(0.0) + read, gain * expected.max(0.0) + read);
            let even = ((seen - expected).powi(2) - (seen - others).powi(2)) / read;
            let uneven = 2.0 / gain * ((v1 - v0) / gain - (seen + read / gain) * logarithm(v1 / v0));
            let is_even = gain * (others.abs() + expected.abs() + seen.abs()) < LEAST_GAIN * read;
            *sum = if is_even { even } else { uneven };
        }
        let mut sum = 0.0;
        for part in sums {
            sum += part;
        }
        sum
    }

    /// Noise for the first fits, about as large as the errors of the model then. Refuses an image without light.
    pub(crate) fn first(image: ArrayView2<f32>, known: KnownNoise) -> Result<Self, Refusal> {
        let rows = image.rows().into_iter().step_by(image.len().div_ceil(MOST_PIXELS));
        let mut bright: Vec<f32> = rows.flatten().copied().filter(|value| *value > 0.0).collect();
        let at = ((bright.len() as f64 * BRIGHTEST) as usize).min(bright.len().saturating_sub(1));
        let refusal = || Refusal::new("no pixel has light", "wanted an image of particles");
        let peak = ranked(&mut bright, at).map(f64::from).ok_or_else(refusal)?;
        let read = lf_core::image::noise(image).max(FIRST_NOISE * USUAL * peak);
        Ok(Self {
            gain: known.gain.unwrap_or(FIRST_NOISE * peak * USUAL),
            read_variance: known.read_variance.unwrap_or(read * read),
        })
    }

    /// The noise that explains the differences between image and expected counts. Each pair holds the expected counts
    /// of a lit pixel and the difference. None if too few pixels are lit. A known gain or read noise stays.
    ///
    /// In bins by expected counts, the median of the squares is taken, which missing and wrong particles move little. A
    /// line is fitted through the bins.
    pub(crate) fn found(pairs: &mut [(f32, f32)], known: KnownNoise) -> Option<Self> {
        if pairs.len() < LEAST_PIXELS {
            return None;
        }
        pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let peak = f64::from(pairs[pairs.len() - 1].0);
        let floor = (LEAST_SHARE * peak).powi(2).max(f64::MIN_POSITIVE);
        let bins: Vec<[f64; 2]> = pairs.chunks(pairs.len().div_ceil(BINS)).map(|bin| level(bin, floor)).collect();
        // Fit the line by relative errors, weighted again by the line found before.
        let mut noise = Self { gain: 0.0, read_variance: bins[0][1] };
        for round in 0..LINE_ROUNDS {
            let weight = |bin: &[f64; 2]| {
                let variance = if round == 0 { bin[1] } else { noise.gain * bin[0] + noise.read_variance };
                variance.max(floor).powi(-2)
            };
            let sum = |term: &dyn Fn(&[f64; 2]) -> f64| bins.iter().map(|bin| weight(bin) * term(bin)).sum::<f64>();
            let (w, x, y) = (sum(&|_| 1.0), sum(&|bin| bin[0]), sum(&|bin| bin[1]));
            let (xx, xy) = (sum(&|bin| bin[0] * bin[0]), sum(&|bin| bin[0] * bin[1]));
            let spread = w * xx - x * x;
            let mut gain = if spread > 1e-9 * w * xx { (w * xy - x * y) / spread } else { 0.0 };
            let mut read_variance = (y - gain * x) / w;
            if read_variance < 0.0 {
                (gain, read_variance) = (xy / xx.max(f64::MIN_POSITIVE), 0.0);
            }
            if gain < 0.0 {
                (gain, read_variance) = (0.0, y / w);
            }
            if let Some(held) = known.gain {
                (gain, read_variance) = (held, ((y - held * x) / w).max(0.0));
            }
            if let Some(held) = known.read_variance {
                read_variance = held;
                gain = known.gain.unwrap_or(((xy - held * x) / xx.max(f64::MIN_POSITIVE)).max(0.0));
            }
            let read_variance = known.read_variance.filter(|held| *held > 0.0).unwrap_or(read_variance.max(floor));
            noise = Self { gain, read_variance };
        }
        Some(noise)
    }
}

/// Parts of the noise that are known in advance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KnownNoise {
    /// Counts of an electron.
    pub gain: Option<f64>,
    /// Variance of a pixel without light, counts^2.
    pub read_variance: Option<f64>,
}

impl KnownNoise {
    /// These parts, and those of the camera's own noise that they lack.
    pub(crate) fn of(&self, camera: &Camera) -> Self {
        let own = camera.sensor_noise;
        Self {
            gain: self.gain.or(own.map(|noise| noise.gain_counts)),
            read_variance: self.read_variance.or(own.map(|noise| noise.read_noise_counts.powi(2))),
        }
    }
}

/// Mean of the expected counts and robust mean of the squared differences.
fn level(bin: &[(f32, f32)], floor: f64) -> [f64; 2] {
    let mean = bin.iter().map(|(expected, _)| f64::from(*expected)).sum::<f64>() / bin.len() as f64;
    let mut squares: Vec<f32> = bin.iter().map(|(_, off)| off * off).collect();
    let median = upper_median(&mut squares).map_or(0.0, f64::from);
    [mean, (median / MEDIAN_OF_SQUARE).max(floor)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn the_logarithm_is_that_of_the_library() {
        for n in 1..4000 {
            let x = 1.004f64.powi(n - 2000) * 1.37;
            assert!((logarithm(x) - x.ln()).abs() < 1e-13 * x.ln().abs().max(0.1), "{x}: {}", logarithm(x) - x.ln());
        }
        assert_eq!(logarithm(1.0), 0.0);
    }

    /// One pixel.
    fn deviance(noise: &Noise, seen: f64, others: f64, expected: f64) -> f64 {
        let mut lanes = Lanes::default();
        (lanes.seen[3], lanes.others[3], lanes.expected[3]) = (seen, others, expected);
        noise.deviance(&lanes)
    }

    #[test]
    fn the_deviance_slopes_by_the_weighed_difference_and_makes_little_of_missing_light() {
        for (gain, read_variance) in [(0.45, 0.13), (0.0, 4.0), (3.0, 100.0), (1e-9, 1.0)] {
            let noise = Noise { gain, read_variance };
            for (seen, expected) in [(600.0, 0.5), (3.0, 40.0), (-2.0, 5.0)] {
                let slope = deviance(&noise, seen, expected - 0.0625, expected + 0.0625) / 0.125;
                let wanted = -2.0 * (seen - expected) / f64::from(noise.variance(expected as f32));
                assert!((slope / wanted - 1.0).abs() < 0.02, "{noise:?} {seen} {expected}: {slope} for {wanted}");
            }
        }
        let noise = Noise { gain: 0.45, read_variance: 0.13 };
        assert!(deviance(&noise, 600.0, 600.0, 0.0) < 0.01 * 600f64.powi(2) / 0.13);
    }

    #[test]
    fn gain_and_read_noise_come_back_in_spite_of_outliers() {
        let mut random = Pcg64Mcg::new(3);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let mut pairs: Vec<(f32, f32)> = (0..200_000)
            .map(|n| {
                let expected = 400.0 * (f64::from(n) / 200_000.0).powi(2);
                let off = (0.8 * expected + 9.0).sqrt() * normal() + if n % 20 == 0 { 60.0 } else { 0.0 };
                (expected as f32, off as f32)
            })
            .collect();
        let noise = Noise::found(&mut pairs, KnownNoise::default()).unwrap();
        assert!((noise.gain / 0.8 - 1.0).abs() < 0.2 && (noise.read_variance / 9.0 - 1.0).abs() < 0.2, "{noise:?}");
        let known = Noise::found(&mut pairs, KnownNoise { gain: Some(0.8), read_variance: None }).unwrap();
        assert!(known.gain == 0.8 && (known.read_variance / 9.0 - 1.0).abs() < 0.5, "{known:?}");
        assert!(Noise::found(&mut pairs[..100], KnownNoise::default()).is_none());
    }
}
