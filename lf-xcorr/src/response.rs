//! What windows and repeats do to waves and to noise.
//!
//! A window measures the mean of the displacement over itself, noise included. Each repeat takes out of it what the
//! predictor, the smoothed field of the time before, already tells, and puts that back at the centre. With H the response
//! to what the windows measure, S that of the smoothing and M that of the mean of the predictor over a window,
//!
//! Equation: `H <- 1 + S (1 - M) H`, from 1 on, at every wave number of the lattice.
//!
//! So waves of a few windows come back to their full height, and noise grows: by the root of the mean of H^2 over the
//! spectrum of a mean over windows that overlap.

use crate::evidence::WIDE;
use crate::lattice::{Axis, Lattice};
use crate::smooth::{self, smooth};
use std::f64::consts::TAU;

/// What noise of the windows becomes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Noise {
    /// How much more a component scatters for the pass having been repeated.
    pub gain: f64,
    /// What [`unresolved`] makes of the scatter, as a share of it.
    pub taken_for_unresolved: f64,
}

impl Noise {
    /// After a pass was done `times` times, at least once.
    pub fn new(lattice: &Lattice, smoothing: [f64; 3], times: usize) -> Self {
        let (mut power, mut grown, mut taken) = (0.0, 0.0, 0.0);
        each_wave(lattice, smoothing, |[spectrum, smoothed, mean, round, _]| {
            let mut response = 1.0;
            for _ in 1..times {
                response = 1.0 + smoothed * (1.0 - mean) * response;
            }
            let sharp = if times > 1 { 1.0 - smoothed } else { 1.0 };
            let missing = (1.0 - round) * (2.0 - round) * sharp;
            power += spectrum;
            grown += spectrum * response * response;
            taken += spectrum * (response * missing).powi(2);
        });
        Self { gain: (grown / power).sqrt(), taken_for_unresolved: (taken / grown).sqrt() }
    }
}

/// What noise of the windows holds between the light and the wide smoothing of [`crate::evidence`], over what it holds
/// beyond the light one: a ratio of squares.
pub(crate) fn noise_ratio(lattice: &Lattice, smoothing: [f64; 3]) -> f64 {
    let (mut between, mut beyond) = (0.0, 0.0);
    each_wave(lattice, smoothing, |[spectrum, light, _, _, wide]| {
        between += spectrum * (light - wide).powi(2);
        beyond += spectrum * (1.0 - light).powi(2);
    });
    if beyond > 0.0 { between / beyond } else { 0.0 }
}

/// Visits the wave numbers of the lattice with the products of what [`responses`] tells along each axis.
fn each_wave(lattice: &Lattice, smoothing: [f64; 3], mut visit: impl FnMut([f64; 5])) {
    // Constant: wave numbers along an axis; gains are good to a thousandth.
    const WAVES: usize = 24;
    let [xs, ys, zs]: [Vec<[f64; 5]>; 3] = std::array::from_fn(|axis| {
        (0..WAVES).map(|k| responses(&lattice.axes[axis], smoothing[axis], TAU * k as f64 / WAVES as f64)).collect()
    });
    for x in &xs {
        for y in &ys {
            for z in &zs {
                visit(std::array::from_fn(|i| x[i] * y[i] * z[i]));
            }
        }
    }
}

/// An estimate of what of a measured field is missing: the true field less its response. Without holes.
///
/// Equation: of the truth `f` the windows give `R f`, with `R = M / (1 - S (1 - M))` after many times and `M` after one; so
/// `f - R f = (1 - M) (1 - S) / M` times what was measured, or `(1 - M) / M`; 1 / M is taken as 1 + (1 - M).
pub(crate) fn unresolved(
    lattice: &Lattice,
    measured: Vec<[f64; 3]>,
    smoothing: [f64; 3],
    times: usize,
) -> Vec<[f64; 3]> {
    let shape = lattice.shape();
    let mean: [f64; 3] = std::array::from_fn(|a| round_mean(&lattice.axes[a]));
    let less = |field: &[[f64; 3]], width: [f64; 3]| -> Vec<[f64; 3]> {
        let mut smoothed = field.to_vec();
        smooth(shape, &mut smoothed, width);
        field.iter().zip(&smoothed).map(|(f, s)| std::array::from_fn(|a| f[a] - s[a])).collect()
    };
    let mut missing = less(&measured, mean);
    if times > 1 {
        missing = less(&missing, smoothing);
    }
    let again = less(&missing, mean);
    missing.iter().zip(&again).map(|(one, two)| std::array::from_fn(|a| one[a] + two[a])).collect()
}

/// A mean over a window as a smoothing of the same variance, window^2 / 12: its standard deviation, nodes.
fn round_mean(axis: &Axis) -> f64 {
    axis.window as f64 / axis.step as f64 / 12f64.sqrt()
}

/// Along one axis at `wave` radians a node: the spectrum of a mean over overlapping windows, the response of the smoothing,
/// that of the mean over a window of what lies linearly between nodes, that of [`round_mean`], and that of the wide smoothing.
fn responses(axis: &Axis, smoothing: f64, wave: f64) -> [f64; 5] {
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
    // The integral of the triangle of node k over the window, over the window.
    let area = |x: f64| {
        if x <= -1.0 {
            0.0
        } else if x <= 0.0 {
            0.5 * (x + 1.0).powi(2)
        } else if x < 1.0 {
            1.0 - 0.5 * (1.0 - x).powi(2)
        } else {
            1.0
        }
    };
    let half = 0.5 * window / step;
    let mean = sum(half + 1.0, &|k| (area(half - k) - area(-half - k)) / (2.0 * half));
    [spectrum, gaussian(smoothing), mean, gaussian(round_mean(axis)), gaussian(WIDE * smoothing)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Pass;

    fn lattice(shape: [usize; 3], overlap: f64) -> Lattice {
        Lattice::new(shape, &Pass { window: [16; 3], overlap, search: [1; 3] })
    }

    #[test]
    fn once_and_without_neighbours_nothing_grows() {
        assert_eq!(Noise::new(&lattice([64; 3], 0.75), [2.0; 3], 1).gain, 1.0);
        assert!((Noise::new(&lattice([16; 3], 0.75), [2.0; 3], 4).gain - 1.0).abs() < 1e-12);
    }

    #[test]
    fn sharper_predictors_and_more_repeats_give_more_noise() {
        let gain = |smoothing: f64, times: usize| Noise::new(&lattice([64; 3], 0.75), [smoothing; 3], times).gain;
        assert!(gain(2.0, 2) > 1.02 && gain(2.0, 3) > gain(2.0, 2) && gain(1.0, 3) > gain(2.0, 3) + 0.05);
        // It converges.
        assert!((gain(2.0, 9) - gain(2.0, 8)).abs() < 1e-3);
    }

    /// A wave of four windows: a window's mean of it is sinc(1/4) = 0.9003 of its height.
    #[test]
    fn what_is_missing_of_a_wave_is_nearly_found() {
        let lattice = lattice([400, 16, 16], 0.75);
        let wave = |height: f64| -> Vec<[f64; 3]> {
            (0..lattice.count()).map(|k| [height * (TAU * k as f64 / 16.0).sin(), 0.0, 0.0]).collect()
        };
        let measured = 0.9003;
        let found = unresolved(&lattice, wave(measured), [1.4, 0.0, 0.0], 1);
        let wanted = wave(1.0 - measured);
        for k in 20..lattice.count() - 20 {
            assert!((found[k][0] - wanted[k][0]).abs() < 0.01, "{:?} {:?}", found[k], wanted[k]);
        }
        // Repeated, S = exp(-(1.4 x 2 pi / 16)^2 / 2) = 0.8598, and 0.9003 / (1 - S (1 - 0.9003)) = 0.9847 of it is measured.
        let found = unresolved(&lattice, wave(0.9847), [1.4, 0.0, 0.0], 5);
        let wanted = wave(1.0 - 0.9847);
        for k in 20..lattice.count() - 20 {
            assert!((found[k][0] - wanted[k][0]).abs() < 0.002, "{:?} {:?}", found[k], wanted[k]);
        }
    }

    /// By hand: windows side by side and no smoothing. The predictor's mean over a window is 3/4 of its own node and 1/8 of
    /// either neighbour, in one dimension, so H after a second time is 1 + 1/4 (1 - cos), whose mean square is 1.59375.
    #[test]
    fn by_hand_in_one_row() {
        let gain = Noise::new(&lattice([160, 16, 16], 0.0), [0.0; 3], 2).gain;
        assert!((gain - 1.59375f64.sqrt()).abs() < 1e-9, "{gain}");
    }
}
