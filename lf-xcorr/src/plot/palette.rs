//! Colours for a value between two ends: dark blue through magenta to orange, readable as lines on white paper.

use plotters::style::RGBColor;

/// Colours at equal distances. Lightness rises all the way, so order survives a grey print and most colour blindness.
const STOPS: [[u8; 3]; 6] =
    [[23, 20, 120], [94, 10, 160], [160, 30, 150], [205, 65, 105], [236, 110, 60], [245, 165, 40]];

/// The colour at `share`, 0 to 1.
pub(super) fn colour(share: f64) -> RGBColor {
    let place = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let low = (place as usize).min(STOPS.len() - 2);
    let part = place - low as f64;
    let [r, g, b] = std::array::from_fn(|c| {
        (STOPS[low][c] as f64 + part * (STOPS[low + 1][c] as f64 - STOPS[low][c] as f64)).round() as u8
    });
    RGBColor(r, g, b)
}

/// The number 1, 2 or 5 times a power of ten that is nearest to `value` from below.
pub(super) fn round_below(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    // A hair of room for 0.2 = 2 x 0.1 in binary.
    [5.0, 2.0, 1.0].map(|digit| digit * power).into_iter().find(|round| *round <= value * (1.0 + 1e-9)).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers() {
        for (value, round) in [(0.0234, 0.02), (0.99, 0.5), (1.0, 1.0), (73.0, 50.0), (0.2, 0.2)] {
            assert!((round_below(value) - round).abs() < 1e-12 * round);
        }
    }
}
