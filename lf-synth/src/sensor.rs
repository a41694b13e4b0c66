//! The sensor: from expected to recorded counts.
//!
//! The linear camera of EMVA Standard 1288, release 4.0 Linear (2021), chapter on sensitivity, linearity and noise. A
//! pixel gathers a Poisson number of electrons of mean mu_e, adds a normal number of variance sigma_d^2 and an offset.
//! It reads mu_y = mu_y.dark + K mu_e with sigma_y^2 = K^2 sigma_d^2 + sigma_q^2 + K (mu_y - mu_y.dark). K is the gain
//! in counts per electron, and sigma_q^2 = 1/12 comes from rounding. Gain and offset are the same for all pixels, and
//! there is no dark current; only dead and hot pixels differ.

use crate::key_checks::{positive, within, wrong};
use crate::random::stream;
use lf_core::Refusal;
use ndarray::{Array2, ArrayViewMut1};
use rand::RngExt;
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The signal chain of a sensor, in this order: background, photon noise, full well, read noise, gain, offset, bits;
/// then the dead and hot pixels. A step without its key is left out and draws no random number.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorNoise {
    /// Path, from the scene's folder, of an image of the sensor's size: counts of light that are added to every frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<PathBuf>,
    /// Counts for each electron; 1 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_counts_per_electron: Option<f64>,
    /// Whether the number of electrons is drawn from the Poisson distribution about the expected number.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub photon_noise: bool,
    /// Largest number of electrons that a pixel holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub full_well_electrons: Option<f64>,
    /// Standard deviation of the read noise, electrons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub read_noise_electrons: Option<f64>,
    /// Counts that a pixel without light reads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dark_counts: Option<f64>,
    /// Bits of a count: whole counts from 0 to 2^bits - 1. If absent, counts are neither rounded nor clipped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bits: Option<u32>,
    /// Share of the pixels that always read `dark_counts`, without noise; 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dead_share: Option<f64>,
    /// Share of the pixels that always read `hot_counts`, without noise; 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hot_share: Option<f64>,
    /// Counts that a hot pixel reads. If absent, the largest count that full well and bits allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hot_counts: Option<f64>,
}

/// Keep the random streams of noise and of dead and hot pixels apart from each other and from those of rays.
const NOISE: u64 = 0x6e6f_6973;
const FIXED: u64 = 0x6669_7865;

impl SensorNoise {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        positive("sensor_noise.gain_counts_per_electron", self.gain_counts_per_electron.unwrap_or(1.0))?;
        positive("sensor_noise.full_well_electrons", self.full_well_electrons.unwrap_or(1.0))?;
        for (key, value) in [
            ("read_noise_electrons", self.read_noise_electrons),
            ("dark_counts", self.dark_counts),
            ("hot_counts", self.hot_counts),
        ] {
            if let Some(value) = value.filter(|value| !(0.0..1e12).contains(value)) {
                return Err(wrong(format!("sensor_noise.{key} is {value}, not a number of 0 or more")));
            }
        }
        within("sensor_noise.bits", f64::from(self.bits.unwrap_or(1)), 1.0..=16.0)?;
        within("sensor_noise.dead_share", self.dead_share.unwrap_or(0.0), 0.0..=1.0)?;
        within("sensor_noise.hot_share", self.hot_share.unwrap_or(0.0), 0.0..=1.0)?;
        let share = self.dead_share.unwrap_or(0.0) + self.hot_share.unwrap_or(0.0);
        if share > 1.0 + 1e-12 {
            return Err(wrong(format!("sensor_noise.dead_share and sensor_noise.hot_share sum to {share}, above 1")));
        }
        if self.hot_share.is_some_and(|share| share > 0.0) && self.hot().is_none() {
            return Err(wrong("sensor_noise.hot_share has no 'hot_counts', nor 'bits' or 'full_well_electrons'"));
        }
        Ok(())
    }

    /// Turns the expected counts in `image`, shape (height, width), into recorded counts, in place. Without keys and
    /// background the image stays as it is. The random numbers of noise depend on seed, frame and row, those of dead
    /// and hot pixels on seed and row, so that the bytes are the same for any number of threads. Panics if `background`
    /// has another shape.
    pub fn record(
        &self,
        image: &mut Array2<f32>,
        background: Option<&Array2<f32>>,
        seed: u64,
        frame: usize,
    ) -> Recorded {
        if let Some(background) = background {
            assert_eq!(background.dim(), image.dim(), "shapes of background and image");
        } else if (Self { background: None, ..self.clone() }) == Self::default() {
            return Recorded::default();
        }
        let chain = Chain {
            gain: self.gain_counts_per_electron.unwrap_or(1.0),
            photon_noise: self.photon_noise,
            full_well: self.full_well_electrons.unwrap_or(f64::INFINITY),
            read_noise: self.read_noise_electrons,
            dark: self.dark_counts.unwrap_or(0.0),
            full_scale: self.full_scale(),
            dead_to: self.dead_share.unwrap_or(0.0),
            hot_to: self.dead_share.unwrap_or(0.0) + self.hot_share.unwrap_or(0.0),
            hot: self.hot().unwrap_or(0.0),
        };
        let rows: Vec<ArrayViewMut1<f32>> = image.rows_mut().into_iter().collect();
        rows.into_par_iter()
            .enumerate()
            .map(|(y, mut row)| {
                let mut noise = stream(seed ^ NOISE, (frame as u64) << 32 | y as u64);
                let mut fixed = stream(seed ^ FIXED, y as u64);
                let mut recorded = Recorded::default();
                for (x, pixel) in row.iter_mut().enumerate() {
                    let light = background.map_or(0.0, |background| f64::from(background[[y, x]]));
                    *pixel = chain.pixel(f64::from(*pixel) + light, &mut noise, &mut fixed, &mut recorded);
                }
                recorded
            })
            .reduce(Recorded::default, Recorded::plus)
    }

    /// Largest count that the bits hold.
    fn full_scale(&self) -> Option<f64> {
        self.bits.map(|bits| (1u64 << bits) as f64 - 1.0)
    }

    /// Counts of a hot pixel before the bits.
    fn hot(&self) -> Option<f64> {
        let gain = self.gain_counts_per_electron.unwrap_or(1.0);
        let full = self.full_well_electrons.map(|electrons| gain * electrons + self.dark_counts.unwrap_or(0.0));
        self.hot_counts.or(full).or(self.full_scale())
    }
}

/// Pixels of an image that did not simply record their light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Pixels cut to the full well or to the largest count, without the hot pixels.
    pub clipped: u64,
    /// Pixels cut to 0 counts.
    pub below_zero: u64,
    /// Dead pixels.
    pub dead: u64,
    /// Hot pixels.
    pub hot: u64,
}

impl Recorded {
    fn plus(self, other: Self) -> Self {
        Self {
            clipped: self.clipped + other.clipped,
            below_zero: self.below_zero + other.below_zero,
            dead: self.dead + other.dead,
            hot: self.hot + other.hot,
        }
    }
}

/// The keys, with a value for every step.
struct Chain {
    gain: f64,
    photon_noise: bool,
    full_well: f64,
    read_noise: Option<f64>,
    dark: f64,
    full_scale: Option<f64>,
    /// Each pixel draws a number from 0 to 1. It is dead if the number is below `dead_to`, else hot if below `hot_to`.
    dead_to: f64,
    hot_to: f64,
    hot: f64,
}

impl Chain {
    /// The counts that a pixel records.
    fn pixel(&self, counts: f64, noise: &mut Pcg64Mcg, fixed: &mut Pcg64Mcg, recorded: &mut Recorded) -> f32 {
        if self.hot_to > 0.0 {
            let place: f64 = fixed.random();
            if place < self.dead_to {
                recorded.dead += 1;
                return self.digital(self.dark).0 as f32;
            }
            if place < self.hot_to {
                recorded.hot += 1;
                return self.digital(self.hot).0 as f32;
            }
        }
        let mut electrons = counts / self.gain;
        if self.photon_noise {
            electrons = photons(electrons, noise);
        }
        let overflows = electrons > self.full_well;
        if overflows {
            electrons = self.full_well;
        }
        if let Some(deviation) = self.read_noise {
            let normal: f64 = StandardNormal.sample(noise);
            electrons += deviation * normal;
        }
        let (counts, cut) = self.digital(self.gain * electrons + self.dark);
        recorded.clipped += u64::from(overflows || cut > 0);
        recorded.below_zero += u64::from(cut < 0);
        counts as f32
    }

    /// Counts as the bits hold them; and 1 if they were above the range, -1 if below, else 0.
    fn digital(&self, counts: f64) -> (f64, i8) {
        let Some(full_scale) = self.full_scale else { return (counts, 0) };
        let whole = counts.round();
        if whole > full_scale {
            (full_scale, 1)
        } else if whole < 0.0 {
            (0.0, -1)
        } else {
            // Adding 0 turns -0 into 0.
            (whole + 0.0, 0)
        }
    }
}

/// A Poisson number. 0 if the mean is not above 0; the mean itself if it is beyond the sampler's limit of 1.8e19, where
/// an f32 cannot hold the noise.
fn photons(mean: f64, random: &mut Pcg64Mcg) -> f64 {
    match Poisson::new(mean) {
        Ok(poisson) => poisson.sample(random),
        Err(_) if mean <= 0.0 => 0.0,
        Err(_) => mean,
    }
}

#[cfg(test)]
mod tests;
