//! The ticks of an axis.

use super::range::Range;
use super::text::{Numbers, TEXT_PX, magnitude, scaled, width};

/// Smallest distance between the texts of two ticks, px.
const GAP_PX: f64 = 12.0;

/// Length of a tick, and distance of its text from the axis, px.
pub(super) const TICK: i32 = 5;
pub(super) const TICK_TEXT: i32 = 9;

/// Value and text.
pub(super) type Tick = (f64, String);

/// Ticks at round values: as many as fit on `length_px` without touching. Their texts stand beside each other on the
/// horizontal axis, 0, and above each other on the vertical one, 1.
pub(super) fn ticks(range: &Range, length_px: i32, axis: usize) -> Vec<Tick> {
    let decades = (range.high() / range.low()).log10();
    if range.is_log && decades >= 0.7 {
        let sets = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0][..], &[1.0][..]];
        let dense = sets.iter().map(|digits| decimal(range, digits, 1));
        let sparse = (2..40).map(|stride| decimal(range, &[1.0], stride));
        let fitting = dense.chain(sparse).find(|ticks| fit(ticks, range, length_px, axis));
        // Two ticks on a short logarithmic axis do not show how it is divided; linear ticks do.
        let fewest = if decades < 1.5 { 3 } else { 2 };
        if let Some(ticks) = fitting.filter(|ticks| ticks.len() >= fewest) {
            return ticks;
        }
    }
    linear(range, length_px, axis)
}

pub(super) fn widest(ticks: &[Tick]) -> i32 {
    ticks.iter().map(|(_, label)| width(label, TEXT_PX)).max().unwrap_or(0)
}

/// Multiples of 1, 2 or 5 times a power of ten: the finest step that fits.
fn linear(range: &Range, length_px: i32, axis: usize) -> Vec<Tick> {
    let span = range.high() - range.low();
    let most = f64::from(length_px) / [60.0, 42.0][axis];
    let finest = magnitude(span / most.max(1.0));
    let steps = (finest..finest + 5).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powi(power)));
    for step in steps.filter(|step| span / step <= most.max(1.0)) {
        let numbers = Numbers::new(range.high().abs().max(range.low().abs()), step);
        let [from, to] = [(range.low() / step - 1e-9).ceil(), (range.high() / step + 1e-9).floor()];
        let count = (to - from).max(-1.0) as usize + 1;
        let values = (0..count).map(|n| (from + n as f64) * step);
        let ticks: Vec<Tick> = values.map(|value| (value, numbers.text(value))).collect();
        if fit(&ticks, range, length_px, axis) {
            return ticks;
        }
    }
    Vec::new()
}

/// Every `stride`-th power of ten, times each of `digits`.
fn decimal(range: &Range, digits: &[f64], stride: i32) -> Vec<Tick> {
    let [from, to] = [magnitude(range.low()) - 1, magnitude(range.high()) + 1];
    let powers = (from..=to).filter(|power| power.rem_euclid(stride) == 0);
    let values = powers.flat_map(|power| digits.iter().map(move |digit| (scaled(*digit, power), power)));
    let is_scientific = range.high() >= 1e6 || range.low() < 0.99e-4;
    let text = |value: f64, power: i32| {
        let is_scientific = is_scientific && !(-2..3).contains(&power);
        Numbers { step: 10f64.powi(power), is_scientific }.text(value)
    };
    values.filter(|(value, _)| range.contains(*value)).map(|(value, power)| (value, text(value, power))).collect()
}

/// Whether the texts of neighbouring ticks are at least [`GAP_PX`] apart.
fn fit(ticks: &[Tick], range: &Range, length_px: i32, axis: usize) -> bool {
    let middle_and_half = |(value, text): &Tick| {
        let half = f64::from([width(text, TEXT_PX), TEXT_PX][axis]) / 2.0;
        (range.share(*value) * f64::from(length_px), half)
    };
    ticks.windows(2).all(|pair| {
        let [(one, half), (other, other_half)] = [&pair[0], &pair[1]].map(middle_and_half);
        (one - other).abs() >= half + other_half + GAP_PX
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(first: f64, last: f64, is_log: bool, px: i32) -> Vec<String> {
        let range = Range { first, last, is_log };
        ticks(&range, px, 0).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(texts(0.0, 1.0, false, 400), ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
        assert_eq!(texts(1.0, -1.0, false, 300), ["-1", "-0.5", "0", "0.5", "1"]);
        assert_eq!(texts(1e6, 3e6, false, 200), ["1e6", "2e6", "3e6"]);
    }

    #[test]
    fn log_ticks_are_powers_or_with_two_and_five() {
        assert_eq!(texts(0.8, 60.0, true, 500), ["1", "2", "5", "10", "20", "50"]);
        assert_eq!(texts(0.1, 1e5, true, 400), ["0.1", "1", "10", "100", "1000", "10000", "100000"]);
        assert_eq!(texts(1e-8, 1e2, true, 300), ["1e-8", "1e-6", "1e-4", "0.01", "1", "100"]);
        assert_eq!(texts(9.0, 12.0, true, 300), ["9", "10", "11", "12"]);
    }

    #[test]
    fn any_range_has_ticks_that_stand_apart() {
        for power in -12..12 {
            for (low, high) in [(1.0, 1.3), (1.0, 7.0), (1.0, 33.0), (0.5, 4e4), (-3.0, 0.5)] {
                let [first, last] = [low, high].map(|end| end * 10f64.powi(power));
                for is_log in [false, true].into_iter().filter(|is_log| !is_log || first > 0.0) {
                    let range = Range { first, last, is_log };
                    let ticks = ticks(&range, 320, 0);
                    assert!(ticks.len() > 1 && fit(&ticks, &range, 320, 0), "{range:?} {ticks:?}");
                }
            }
        }
    }
}
