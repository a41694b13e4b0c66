//! Fits floor + gain x profile(x - place) to pixels: Gauss-Newton steps of the place, floor and gain linearly.

use glam::DVec2;
use nalgebra::{Matrix4, Vector4};

/// Smallest number of pixels that determines the four unknowns with some to spare.
const FEWEST_PIXELS: f64 = 6.0;
/// A fit follows a pixel's noise in part. This is the largest share that counts: the noise that is left is divided by
/// one minus the share, which must not come near 0.
const MOST_FOLLOWED: f64 = 0.95;

/// Sums over pixels for one step.
#[derive(Default)]
pub(crate) struct PlaceSums {
    normal: Matrix4<f64>,
    right: Vector4<f64>,
    count: f64,
    sum: f64,
    squares: f64,
}

/// Derivatives of a pixel by the floor, the gain and the place times the gain.
fn derivatives(value: f64, slope: DVec2) -> [f64; 4] {
    [1.0, value, -slope.x, -slope.y]
}

impl PlaceSums {
    /// Adds a pixel, where the profile has this value and slope.
    #[inline]
    pub fn add(&mut self, value: f64, slope: DVec2, pixel: f64) {
        let line = derivatives(value, slope);
        for a in 0..4 {
            for b in 0..=a {
                self.normal[(a, b)] += line[a] * line[b];
            }
            self.right[a] += line[a] * pixel;
        }
        self.count += 1.0;
        self.sum += pixel;
        self.squares += pixel * pixel;
    }
}

/// Limits of the steps, px.
pub(crate) struct StepLimits {
    pub steps: usize,
    /// After a long step the linearisation is poor: its direction is kept and its length limited to this.
    pub longest_px: f64,
    /// A smaller step is the last.
    pub small_px: f64,
    /// Distance from the start at which the fit fails.
    pub farthest_px: f64,
}

pub(crate) struct PlaceFit {
    pub place_px: DVec2,
    pub floor: f64,
    pub gain: f64,
    /// Standard deviation of a coordinate of the place, px, for noise of one count in each pixel.
    pub spread_px: f64,
    /// Standard deviation of the pixels about the fit, counts.
    pub scatter: f64,
    /// Share of the pixels' variance that the fit explains.
    pub explained: f64,
    inverse: Matrix4<f64>,
}

impl PlaceFit {
    /// The variance that a pixel's noise gives a coordinate of the place, px^2. The noise is taken from the pixel's own
    /// departure from the fit, so the sum over all pixels is right where some are noisier than others. `spread_px` and
    /// `scatter` assume that all are alike.
    pub fn own_variance_px2(&self, value: f64, slope: DVec2, pixel: f64) -> f64 {
        let line = Vector4::from(derivatives(value, slope));
        let effect = self.inverse * line;
        // The fit moves with the pixel by this share, so the departure shows only the rest of its noise.
        let followed = line.dot(&effect).min(MOST_FOLLOWED);
        let left = pixel - self.floor - self.gain * value;
        0.5 * (effect[2].powi(2) + effect[3].powi(2)) / self.gain.powi(2) * left * left / (1.0 - followed)
    }
}

/// Fits from a place. `sums_at` gives the sums over the pixels with the profile at a place. None if there are too few
/// pixels or no light, or if the place moves too far.
pub(crate) fn fit_place(
    from_px: DVec2,
    limits: &StepLimits,
    mut sums_at: impl FnMut(DVec2) -> PlaceSums,
) -> Option<PlaceFit> {
    let mut place = from_px;
    for number in 1..=limits.steps {
        let PlaceSums { mut normal, right, count, sum, squares } = sums_at(place);
        if count < FEWEST_PIXELS {
            return None;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let factors = normal.cholesky()?;
        let solution = factors.solve(&right);
        let gain = solution[1];
        if gain.is_nan() || gain <= 0.0 {
            return None;
        }
        let step = (DVec2::new(solution[2], solution[3]) / gain).clamp_length_max(limits.longest_px);
        place += step;
        if !place.is_finite() || place.distance(from_px) > limits.farthest_px {
            return None;
        }
        if step.length() < limits.small_px || number == limits.steps {
            let (inverse, left) = (factors.inverse(), squares - solution.dot(&right));
            let variance = squares - sum * sum / count;
            return Some(PlaceFit {
                place_px: place,
                floor: solution[0],
                gain,
                spread_px: f64::sqrt(0.5 * (inverse[(2, 2)] + inverse[(3, 3)])) / gain,
                scatter: (left.max(0.0) / (count - 4.0)).sqrt(),
                explained: if variance > 0.0 { 1.0 - left / variance } else { 0.0 },
                inverse,
            });
        }
    }
    None
}
