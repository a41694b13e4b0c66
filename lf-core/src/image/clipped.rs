//! Clipped pixels, found from the end of the image's histogram.

use ndarray::ArrayView2;
use rayon::prelude::*;

/// An image must have this many values below the maximum; with fewer, no histogram shows.
const VALUES: usize = 16;
/// Pixels at the maximum count as a pile if they outnumber those at each of the next values, on average, by the factor
/// `PILE`, by `DEVIATIONS` standard deviations of that average, and if there are at least `FEWEST`. In an unclipped
/// image the maximum has fewer pixels than the next values.
const PILE: f64 = 2.0;
const DEVIATIONS: f64 = 4.0;
const FEWEST: usize = 8;
/// Number of the next values.
const NEXT: usize = 4;
/// Pixels of a parallel task.
const CHUNK: usize = 1 << 16;

/// The level, counts, at which an image is clipped and the share of its pixels there. None if it is not clipped.
///
/// A sensor, amplifier or converter that is full gives the same count for all the light beyond it, so the histogram
/// ends in a pile. No full scale is assumed: counts may be shifted, scaled or floats. Pixels that are not finite do not
/// count. Hot pixels at full scale count as clipped. An image of 16 values or fewer never counts as clipped. In a
/// bright area of little noise (five levels), clipping is found from a tenth of the area. A clipped image is not
/// distinguished from one without noise whose brightest areas are flat. Averaging, division by a flat field and
/// subtraction of a background destroy the pile: call this before.
pub fn clipped_share(image: ArrayView2<f32>) -> Option<(f32, f64)> {
    let pixels = image.as_standard_layout();
    let pixels = pixels.as_slice()?;
    let mut top = Top::default();
    // Merging is exact, so the result does not depend on the number of threads.
    for part in pixels.par_chunks(CHUNK).map(Top::of).collect::<Vec<_>>() {
        part.values.iter().for_each(|(value, count)| top.add(*value, *count));
    }
    let [(level, count), below @ ..] = top.values.as_slice() else { return None };
    let next = below.iter().take(NEXT).map(|(_, count)| *count as f64).sum::<f64>() / NEXT as f64;
    let is_piled = *count >= FEWEST && *count as f64 > PILE * next + DEVIATIONS * next.sqrt();
    (below.len() == VALUES && *level > 0.0 && is_piled).then(|| (*level, *count as f64 / pixels.len() as f64))
}

/// The largest `VALUES + 1` values of an image and the number of pixels with each, the largest first.
#[derive(Default)]
struct Top {
    values: Vec<(f32, usize)>,
}

impl Top {
    fn of(pixels: &[f32]) -> Self {
        let mut top = Self::default();
        pixels.iter().filter(|value| value.is_finite()).for_each(|value| top.add(*value, 1));
        top
    }

    #[inline]
    fn add(&mut self, value: f32, count: usize) {
        let is_full = self.values.len() > VALUES;
        if is_full && value < self.values[VALUES].0 {
            return;
        }
        let place = self.values.partition_point(|(other, _)| *other > value);
        match self.values.get_mut(place) {
            Some((other, pixels)) if *other == value => *pixels += count,
            _ => {
                self.values.insert(place, (value, count));
                self.values.truncate(VALUES + 1);
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use ndarray::Array2;

    /// A uniform random number from 0 to 1, by SplitMix64.
    pub(in crate::image) fn uniform(state: &mut u64) -> f64 {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Counts with a tail like that of particles: few bright pixels on a noisy ground.
    fn particles(brightness: f64, seed: u64) -> Array2<f32> {
        let mut state = seed;
        Array2::from_shape_fn((300, 400), |_| {
            let noise: f64 = (0..4).map(|_| uniform(&mut state)).sum();
            let light = if uniform(&mut state) < 0.1 { -brightness * uniform(&mut state).max(1e-9).ln() } else { 0.0 };
            (100.0 + 5.0 * noise + light) as f32
        })
    }

    /// Counts of a white image: half of the pixels near `level`, the others anywhere below.
    fn white(level: f64, noise: f64, seed: u64) -> Array2<f32> {
        let mut state = seed;
        Array2::from_shape_fn((300, 400), |_| {
            let normal: f64 = (0..12).map(|_| uniform(&mut state)).sum::<f64>() - 6.0;
            let light = (2.0 * uniform(&mut state)).min(1.0) * level;
            (light * (1.0 + noise * normal)).max(0.0) as f32
        })
    }

    fn share(image: &Array2<f32>) -> Option<(f32, f64)> {
        clipped_share(image.view())
    }

    fn at(image: &Array2<f32>, level: f32) -> f64 {
        image.iter().filter(|value| **value == level).count() as f64 / image.len() as f64
    }

    #[test]
    fn a_clipped_image_gives_its_level_and_share_at_any_scale() {
        for seed in 0..5 {
            let cases = [(12, 0.9), (12, 0.99), (12, 0.998), (16, 0.999), (8, 0.9), (8, 0.99)];
            for (n, image) in
                [white(1000.0, 0.02, seed), white(300.0, 0.1, seed), particles(400.0, seed)].iter().enumerate()
            {
                let mut sorted: Vec<f32> = image.iter().copied().collect();
                sorted.sort_by(f32::total_cmp);
                // Little noise at 8 bits needs more than a hundredth of the pixels.
                for (bits, kept) in &cases[..if n < 2 { 5 } else { 6 }] {
                    let limit = sorted[(*kept * sorted.len() as f64) as usize];
                    let full = (2.0f32).powi(*bits) - 1.0;
                    let counts = image.mapv(|value| (value / limit * full).round().min(full));
                    for (scale, offset) in [(1.0, 0.0), (16.0, 0.0), (1.0, 37.0), (1.0 / 4095.0, 0.0)] {
                        let scaled = counts.mapv(|value| value * scale + offset);
                        let level = full * scale + offset;
                        assert_eq!(share(&scaled), Some((level, at(&scaled, level))), "{seed} {bits} {kept} {scale}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_histogram_that_ends_by_itself_is_not_clipped() {
        for seed in 0..20 {
            for image in
                [particles(400.0, seed), particles(3.0, seed), white(1000.0, 0.02, seed), white(40.0, 0.1, seed)]
            {
                assert_eq!(share(&image), None, "floats, {seed}");
                for scale in [1.0, 0.25, 0.05] {
                    let counts = image.mapv(|value| (value * scale).round());
                    assert_eq!(share(&counts), None, "counts, {seed} {scale}");
                    let background = counts.mapv(|value| (value - 30.0 * scale).max(0.0));
                    assert_eq!(share(&background), None, "background subtracted, {seed} {scale}");
                }
            }
        }
    }

    #[test]
    fn images_of_few_values_are_not_clipped() {
        for value in [0.0, 7.0, 4095.0, f32::NAN] {
            assert_eq!(share(&Array2::from_elem((20, 30), value)), None);
        }
        let steps =
            |levels: usize| Array2::from_shape_fn((64, 64), |(row, column)| ((row * 64 + column) % levels) as f32);
        for levels in [2, 8, 16, 32] {
            assert_eq!(share(&steps(levels)), None, "{levels}");
        }
        // Seven tenths at the highest of eight values.
        assert_eq!(share(&steps(24).mapv(|value| value.min(7.0))), None);
        assert_eq!(share(&Array2::zeros((0, 0))), None);
        let negative = particles(400.0, 3).mapv(|value| (value - 5000.0).min(-4500.0));
        assert_eq!(share(&negative), None);
    }

    #[test]
    fn pixels_that_are_not_finite_do_not_count() {
        let mut image = particles(400.0, 1).mapv(|value| value.round().min(500.0));
        let found = share(&image).unwrap();
        image[(3, 4)] = f32::INFINITY;
        image[(5, 4)] = f32::NAN;
        assert_eq!(share(&image).unwrap().0, found.0);
    }
}
