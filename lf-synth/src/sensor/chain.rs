//! One pixel: from expected to recorded counts.
//!
//! The linear camera of EMVA Standard 1288, release 4.0 Linear (2021), chapter on sensitivity, linearity and noise. A
//! pixel gathers a Poisson number of electrons of mean mu_e, adds a normal number of variance sigma_d^2 and an offset.
//! It reads mu_y = mu_y.dark + K mu_e with sigma_y^2 = K^2 sigma_d^2 + sigma_q^2 + K (mu_y - mu_y.dark). K is the gain
//! in counts per electron, and sigma_q^2 = 1/12 comes from rounding. Gain and offset are the same for all pixels, and
//! there is no dark current; only dead and hot pixels differ.

use rand::RngExt;
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64Mcg;

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
    /// The sum of both.
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            clipped: self.clipped + other.clipped,
            below_zero: self.below_zero + other.below_zero,
            dead: self.dead + other.dead,
            hot: self.hot + other.hot,
        }
    }
}

/// The chain, with a value for every step.
pub(super) struct Chain {
    pub(super) gain: f64,
    pub(super) photon_noise: bool,
    pub(super) full_well: f64,
    pub(super) read_noise: Option<f64>,
    pub(super) dark: f64,
    pub(super) full_scale: Option<f64>,
    /// Each pixel draws a number from 0 to 1. It is dead if the number is below `dead_to`, else hot if below `hot_to`.
    pub(super) dead_to: f64,
    pub(super) hot_to: f64,
    pub(super) hot: f64,
}

impl Chain {
    /// The counts that a pixel records.
    pub(super) fn pixel(
        &self,
        counts: f64,
        noise: &mut Pcg64Mcg,
        fixed: &mut Pcg64Mcg,
        recorded: &mut Recorded,
    ) -> f32 {
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
