//! The expected brightness profile of a spot of light.

use lf_core::normal::integrals;

/// Widths below this are raised to it, px: a narrower spot would not show its position between pixels.
const LEAST_PX: f64 = 0.05;
/// Half width of the window of pixels: half the spot, this many standard deviations of the blur, and this many px.
const REACH_SIGMA: f64 = 2.0;
const REACH_PX: f64 = 1.2;
/// Amplitude of the sampling error, px: 0.0006 to 0.0024 px on wide discs without noise. A spot of zero width would
/// have `NARROW_PX` more, which falls with the spot's contrast at the spatial frequency of the pixels.
const SAMPLING_PX: f64 = 0.0015;
const NARROW_PX: f64 = 0.017;

/// How a spot should look: a flat square, blurred by the size of the light source, by a Gaussian and by the pixels.
#[derive(Clone, Copy)]
pub(crate) struct SpotProfile {
    /// Width of the flat square, px.
    pub width_px: f64,
    /// Standard deviation of the source along an axis, px, taken as a square's; a disc differs little.
    pub disc_px: f64,
    /// Standard deviation of all other blur along an axis, without the pixels, px.
    pub sigma_px: f64,
}

impl SpotProfile {
    /// The profile with every width large enough for a fit.
    pub fn usable(self) -> Self {
        Self {
            width_px: self.width_px.max(LEAST_PX),
            disc_px: self.disc_px.max(LEAST_PX),
            sigma_px: self.sigma_px.max(LEAST_PX),
        }
    }

    /// Standard deviation of the whole spot along an axis, pixels included, px.
    pub fn deviation_px(self) -> f64 {
        ((self.width_px * self.width_px + 1.0) / 12.0 + self.disc_px.powi(2) + self.sigma_px.powi(2)).sqrt()
    }

    /// Share of the light along one axis on the pixel whose middle is `u` px from the spot's, and its derivative.
    pub fn share(self, u: f64) -> (f64, f64) {
        let (w, d, s) = (self.width_px, 12f64.sqrt() * self.disc_px, self.sigma_px);
        let (mut value, mut slope) = (0.0, 0.0);
        // Three boxes convolved with a Gaussian: differences of the Gaussian's third integral over the three widths.
        for n in 0..8 {
            let side = |bit: u32| if n >> bit & 1 == 0 { 0.5 } else { -0.5 };
            let sign = 8.0 * side(0) * side(1) * side(2);
            let z = (u + side(0) + side(1) * w + side(2) * d) / s;
            let [distribution, ramp] = integrals(z);
            value += sign * s * s * 0.5 * (distribution + z * ramp);
            slope += sign * s * ramp;
        }
        (value / (w * d), slope / (w * d))
    }

    /// Sampling error of a fitted position, px: the profile is only nearly right, and a narrow spot shows more of that.
    pub fn sampling_px(self) -> f64 {
        let variance = self.width_px.powi(2) / 12.0 + self.disc_px.powi(2) + self.sigma_px.powi(2);
        SAMPLING_PX + NARROW_PX * (-2.0 * std::f64::consts::PI.powi(2) * variance).exp()
    }

    /// Half width of the window of pixels that are read, px.
    pub fn reach_px(self) -> f64 {
        0.5 * self.width_px + REACH_SIGMA * self.disc_px.hypot(self.sigma_px) + REACH_PX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_one_and_have_their_slope() {
        let shape = SpotProfile { width_px: 2.3, disc_px: 0.4, sigma_px: 0.3 };
        for phase in [0.0, 0.3, 0.77] {
            let sum: f64 = (-8..9).map(|n| shape.share(f64::from(n) + phase).0).sum();
            assert!((sum - 1.0).abs() < 1e-6);
            let slope = (shape.share(phase + 1e-4).0 - shape.share(phase - 1e-4).0) / 2e-4;
            assert!((slope - shape.share(phase).1).abs() < 1e-4);
        }
    }
}
