//! The response of windows and repeats to waves and to noise.
//!
//! A window measures the mean of the displacement over itself, noise included. Each repeat subtracts the mean over the
//! window of the predictor, which is the smoothed field of the repeat before, and adds the predictor at the window's
//! centre. Let H be the response to the windows' measurements, S the response of the smoothing, and M the response of
//! the predictor's mean over a window.
//!
//! Equation: `H <- 1 + S (1 - M) H`, starting from 1, at every wave number of the window grid. Waves of a few windows
//! therefore return to their full height, and noise grows: by the root of the mean of H^2, weighted with the spectrum
//! of a mean over overlapping windows.

use super::evidence::WIDE;
use super::smooth::{self, smooth};
use crate::correlate::{WindowAxis, WindowGrid};
use glam::DVec3;
use std::f64::consts::TAU;

/// The effect of repeats on the noise of the windows.
pub(crate) struct Noise {
    /// Factor by which the scatter of a component grows.
    pub gain: f64,
    /// Fraction of the scatter that [`unresolved`] counts as unresolved flow.
    pub taken_for_unresolved: f64,
}

impl Noise {
    /// After a pass was done `times` times, at least once. `smoothing` is the predictor's, in nodes.
    pub fn new(windows: &WindowGrid, smoothing: DVec3, times: usize) -> Self {
        let (mut power, mut grown, mut taken) = (0.0, 0.0, 0.0);
        each_wave(windows, smoothing, |[spectrum, narrow, mean, smooth_mean, _]| {
            let mut response = 1.0;
            for _ in 1..times {
                response = 1.0 + narrow * (1.0 - mean) * response;
            }
            let missing = (1.0 - smooth_mean) * (2.0 - smooth_mean);
            power += spectrum;
            grown += spectrum * response * response;
            taken += spectrum * (response * missing).powi(2);
        });
        Self { gain: (grown / power).sqrt(), taken_for_unresolved: (taken / grown).sqrt() }
    }
}

/// Power of noise between the narrow and the wide smoothing of [`super::evidence`], over that beyond the narrow one.
pub(crate) fn noise_ratio(windows: &WindowGrid, smoothing: DVec3) -> f64 {
    let (mut between, mut beyond) = (0.0, 0.0);
    each_wave(windows, smoothing, |[spectrum, narrow, _, _, wide]| {
        between += spectrum * (narrow - wide).powi(2);
        beyond += spectrum * (1.0 - narrow).powi(2);
    });
    if beyond > 0.0 { between / beyond } else { 0.0 }
}

/// Visits the wave numbers of the window grid with the products of [`responses`] along the three axes.
fn each_wave(windows: &WindowGrid, smoothing: DVec3, mut visit: impl FnMut([f64; 5])) {
    // Constant: wave numbers along an axis; gains are good to a thousandth.
    const WAVES: usize = 24;
    let [xs, ys, zs]: [Vec<[f64; 5]>; 3] = std::array::from_fn(|axis| {
        (0..WAVES).map(|k| responses(&windows.axes[axis], smoothing[axis], TAU * k as f64 / WAVES as f64)).collect()
    });
    for (x, y) in xs.iter().flat_map(|x| ys.iter().map(move |y| (x, y))) {
        zs.iter().for_each(|z| visit(std::array::from_fn(|i| x[i] * y[i] * z[i])));
    }
}

/// Estimate of the part of a field that windows do not measure in plain volumes: the true field minus its means over
/// windows. The field has no holes.
///
/// Equation: the windows give `M f` of the truth `f`. The missing part is `(1 - M) / M` times the measured field; 1 / M
/// is taken as 1 + (1 - M).
pub(crate) fn unresolved(windows: &WindowGrid, measured: &[DVec3]) -> Vec<DVec3> {
    let mean = DVec3::from_array(windows.axes.each_ref().map(smooth_mean));
    let less_smoothed = |field: &[DVec3]| -> Vec<DVec3> {
        let smoothed = smooth(windows.shape(), field, mean);
        field.iter().zip(&smoothed).map(|(field, smoothed)| *field - *smoothed).collect()
    };
    let missing = less_smoothed(measured);
    let again = less_smoothed(&missing);
    missing.iter().zip(&again).map(|(once, twice)| *once + *twice).collect()
}

/// Standard deviation, nodes, of the Gaussian with the variance of a mean over a window: window^2 / 12.
fn smooth_mean(axis: &WindowAxis) -> f64 {
    axis.window as f64 / axis.step as f64 / 12f64.sqrt()
}

/// Along one axis at `wave` radians a node: the spectrum of a mean over overlapping windows, and the responses of the
/// narrow smoothing, of the mean over a window of a field that is linear between nodes, of [`smooth_mean`], and of the
/// wide smoothing.
fn responses(axis: &WindowAxis, smoothing: f64, wave: f64) -> [f64; 5] {
    if axis.count() == 1 {
        return [1.0; 5];
    }
    let (window, step) = (axis.window as f64, axis.step as f64);
    let sum = |reach: f64, weight: &dyn Fn(f64) -> f64| -> f64 {
        let reach = reach.ceil() as i64;
        (-reach..=reach).map(|k| weight(k as f64) * (wave * k as f64).cos()).sum()
    };
    let spectrum = sum(window / step, &|k| (1.0 - (k * step / window).abs()).max(0.0)).max(0.0);
    let gaussian = |sigma: f64| {
        let weight = |k: f64| (-0.5 * (k / sigma.max(1e-3)).powi(2)).exp();
        let reach = smooth::REACH * sigma;
        sum(reach, &weight) / (-(reach.ceil() as i64)..=reach.ceil() as i64).map(|k| weight(k as f64)).sum::<f64>()
    };
    let half = 0.5 * window / step;
    let mean = sum(half + 1.0, &|k| (triangle_area(half - k) - triangle_area(-half - k)) / (2.0 * half));
    [spectrum, gaussian(smoothing), mean, gaussian(smooth_mean(axis)), gaussian(WIDE * smoothing)]
}

/// The area left of `x` of a triangle from -1 to 1 with height 1 at 0: the weight of a node in linear interpolation.
fn triangle_area(x: f64) -> f64 {
    match x {
        x if x <= -1.0 => 0.0,
        x if x <= 0.0 => 0.5 * (x + 1.0).powi(2),
        x if x < 1.0 => 1.0 - 0.5 * (1.0 - x).powi(2),
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn windows(shape: [usize; 3], step: usize) -> WindowGrid {
        WindowGrid::new(shape, [16; 3], [step; 3])
    }

    #[test]
    fn noise_does_not_grow_without_repeats_or_without_neighbours() {
        assert_eq!(Noise::new(&windows([64; 3], 4), DVec3::splat(2.0), 1).gain, 1.0);
        assert!((Noise::new(&windows([16; 3], 4), DVec3::splat(2.0), 4).gain - 1.0).abs() < 1e-12);
    }

    #[test]
    fn sharper_predictors_and_more_repeats_give_more_noise() {
        let gain = |smoothing: f64, times: usize| Noise::new(&windows([64; 3], 4), DVec3::splat(smoothing), times).gain;
        assert!(gain(2.0, 2) > 1.02 && gain(2.0, 3) > gain(2.0, 2) && gain(1.0, 3) > gain(2.0, 3) + 0.05);
        // It converges.
        assert!((gain(2.0, 9) - gain(2.0, 8)).abs() < 1e-3);
    }

    /// A wave of four windows: a window's mean of it is sinc(1/4) = 0.9003 of its height.
    #[test]
    fn the_missing_part_of_a_wave_is_nearly_found() {
        let windows = windows([400, 16, 16], 4);
        let wave = |height: f64| -> Vec<DVec3> {
            (0..windows.count()).map(|k| height * (TAU * k as f64 / 16.0).sin() * DVec3::X).collect()
        };
        let (found, wanted) = (unresolved(&windows, &wave(0.9003)), wave(1.0 - 0.9003));
        for k in 20..windows.count() - 20 {
            assert!((found[k][0] - wanted[k][0]).abs() < 0.01, "{:?} {:?}", found[k], wanted[k]);
        }
    }

    /// By hand: windows side by side, no smoothing, one dimension. The predictor's mean over a window is 3/4 of its own
    /// node and 1/8 of each neighbour, so H after the second time is 1 + 1/4 (1 - cos), whose mean square is 1.59375.
    #[test]
    fn by_hand_in_one_row() {
        let gain = Noise::new(&windows([160, 16, 16], 16), DVec3::ZERO, 2).gain;
        assert!((gain - 1.59375f64.sqrt()).abs() < 1e-9, "{gain}");
    }
}
