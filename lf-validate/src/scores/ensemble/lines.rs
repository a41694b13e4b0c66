//! Spectra and correlations of the fluctuations along the lines of an axis.
//!
//! Convention: wavenumbers are cycles a millimetre. A spectrum is one-sided and its sum times the step of the
//! wavenumber is the variance along a line. Lines are weighted by a Hann window, since they do not close.

use lf_core::{Field, VectorGrid, field::NO_DATA};
use serde::Serialize;
use std::f64::consts::TAU;

/// Sums over the lines along an axis, of many fields.
#[derive(Debug, Clone)]
pub struct LineSums {
    axis: usize,
    count: usize,
    spacing_mm: f64,
    /// Sums of products of two fluctuations, and of the squares of the first and of the second, by distance in vectors.
    products: [Vec<[f64; 3]>; 3],
    /// Sums of squared amplitudes by wave, and number of lines.
    energy: [Vec<f64>; 3],
    lines: f64,
    window: Vec<f64>,
}

/// Spectra and correlations along an axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LineStatistics {
    /// `x`, `y` or `z`.
    pub axis: &'static str,
    /// Distances of the correlations.
    pub distance_mm: Vec<f64>,
    /// Correlation of u, v and w by distance, over the RMS at both ends; 1 at distance 0.
    pub correlation: [Vec<f64>; 3],
    /// Integral of each correlation up to its first zero; the whole line if it has none.
    pub length_mm: [f64; 3],
    /// Wavenumbers of the spectra.
    pub wavenumber_1_mm: Vec<f64>,
    /// Spectra of u, v and w, mm^2 over 1/mm.
    pub spectrum_mm3: [Vec<f64>; 3],
    /// Lines without a gap, of all fields; spectra are theirs.
    pub lines: usize,
}

impl LineSums {
    /// Sums of no field.
    pub fn new(layout: &VectorGrid, axis: usize) -> Self {
        let count = layout.shape[axis];
        let zeros = |len: usize| [vec![0.0; len], vec![0.0; len], vec![0.0; len]];
        let hann = |n: usize| (0.5 * TAU * (n as f64 + 0.5) / count as f64).sin().powi(2);
        Self {
            axis,
            count,
            spacing_mm: layout.spacing_mm[axis],
            products: std::array::from_fn(|_| vec![[0.0; 3]; count]),
            energy: zeros(count / 2),
            lines: 0.0,
            window: (0..count).map(hann).collect(),
        }
    }

    /// Adds the fluctuations of a field about `mean`. Panics if their layouts differ.
    pub fn add(&mut self, field: &Field, mean: &Field) {
        assert_eq!(field.len(), mean.len(), "vectors of the field and of the mean");
        let (stride, count): (usize, usize) = (field.layout.shape[..self.axis].iter().product(), self.count);
        for first in (0..field.len()).filter(|i| i / stride % count == 0) {
            let at = |n: usize| first + n * stride;
            let has_data = |i: usize| field.flag[i] != NO_DATA && mean.flag[i] != NO_DATA;
            let known: Vec<bool> = (0..count).map(|n| has_data(at(n))).collect();
            let is_whole = known.iter().all(|known| *known);
            for c in 0..3 {
                let one = |n: usize| (field.displacement_mm(at(n)) - mean.displacement_mm(at(n)))[c];
                let line: Vec<f64> = (0..count).map(|n| if known[n] { one(n) } else { 0.0 }).collect();
                for (distance, sums) in self.products[c].iter_mut().enumerate() {
                    for n in (0..count - distance).filter(|n| known[*n] && known[n + distance]) {
                        let (a, b) = (line[n], line[n + distance]);
                        sums.iter_mut().zip([a * b, a * a, b * b]).for_each(|(sum, product)| *sum += product);
                    }
                }
                if is_whole {
                    self.add_waves(c, &line);
                }
            }
            self.lines += f64::from(u8::from(is_whole));
        }
    }

    fn add_waves(&mut self, component: usize, line: &[f64]) {
        let mean = line.iter().sum::<f64>() / line.len() as f64;
        for (n, energy) in self.energy[component].iter_mut().enumerate() {
            let turn = TAU * (n + 1) as f64 / line.len() as f64;
            let weighed = line.iter().zip(&self.window).enumerate();
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (place, (value, window)) in weighed {
                let (sin, cos) = (turn * place as f64).sin_cos();
                real += window * (value - mean) * cos;
                imaginary += window * (value - mean) * sin;
            }
            *energy += real * real + imaginary * imaginary;
        }
    }

    /// The statistics of the fields added.
    pub fn finish(self) -> LineStatistics {
        let Self { axis, count, spacing_mm, products, energy, lines, window } = self;
        let one = |[product, first, second]: &[f64; 3]| product / (first * second).sqrt();
        let correlation = products.map(|sums| sums.iter().map(one).collect::<Vec<f64>>());
        let squares: f64 = window.iter().map(|w| w * w).sum();
        // The highest wave of an even number of places is its own mirror image.
        let fold = |n: usize| if 2 * (n + 1) == count { 1.0 } else { 2.0 };
        let density = |n: usize, energy: f64| fold(n) * energy * spacing_mm / (squares * lines);
        let spectrum_mm3 = energy.map(|waves| waves.iter().enumerate().map(|(n, e)| density(n, *e)).collect());
        LineStatistics {
            axis: ["x", "y", "z"][axis],
            distance_mm: (0..count).map(|n| n as f64 * spacing_mm).collect(),
            length_mm: correlation.each_ref().map(|values| length(values, spacing_mm)),
            correlation,
            wavenumber_1_mm: (1..=count / 2).map(|n| n as f64 / (count as f64 * spacing_mm)).collect(),
            spectrum_mm3,
            lines: lines as usize,
        }
    }
}

/// Integral of a correlation up to its first zero, by trapezoids.
fn length(correlation: &[f64], step: f64) -> f64 {
    let mut sum = 0.0;
    for pair in correlation.windows(2) {
        if pair[1] <= 0.0 {
            return sum + 0.5 * step * pair[0] * pair[0] / (pair[0] - pair[1]);
        }
        sum += 0.5 * step * (pair[0] + pair[1]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::fixtures::field;

    /// Waves of four phases: the fluctuation at any place is a cosine of the distance.
    #[test]
    fn a_wave_has_its_line_and_its_cosine() {
        let shape = [32, 4, 3];
        let mean = field(shape, |_| [0.0; 3]);
        let length_mm = 32.0 * mean.layout.spacing_mm[0];
        let mut sums = LineSums::new(&mean.layout, 0);
        for phase in 0..8 {
            let wave = |x: f64, waves: f64| 0.1 * (TAU * (waves * x / length_mm + f64::from(phase) / 8.0)).cos();
            let one = field(shape, |[x, ..]| [wave(x, 4.0), wave(x, 6.0), 0.0]);
            sums.add(&one, &mean);
        }
        let found = sums.finish();
        assert_eq!((found.axis, found.lines, found.distance_mm[2]), ("x", 8 * 12, 2.0 * mean.layout.spacing_mm[0]));
        for (n, value) in found.correlation[0].iter().enumerate() {
            let wanted = (TAU * 4.0 * n as f64 / 32.0).cos();
            assert!((value - wanted).abs() < 1e-3, "{n}: {value} for {wanted}");
        }
        // A quarter of the wavelength, times 2 / pi.
        let wanted = length_mm / 4.0 / TAU;
        assert!((found.length_mm[0] / wanted - 1.0).abs() < 0.06, "{}", found.length_mm[0]);
        let step = found.wavenumber_1_mm[0];
        for (c, wave) in [(0, 4), (1, 6)] {
            let spectrum = &found.spectrum_mm3[c];
            let variance: f64 = spectrum.iter().map(|density| density * step).sum();
            assert!((variance / 0.005 - 1.0).abs() < 1e-3, "{variance}");
            let top = (0..16).max_by(|a, b| spectrum[*a].total_cmp(&spectrum[*b])).unwrap();
            assert_eq!(top + 1, wave);
        }
    }

    #[test]
    fn gaps_cost_their_lines_spectrum_and_their_own_products() {
        let mean = field([8, 3, 2], |_| [0.0; 3]);
        let mut one = field([8, 3, 2], |_| [0.1, 0.0, 0.0]);
        one.flag[3] = NO_DATA;
        one.u[3] = 9.0;
        let mut sums = LineSums::new(&mean.layout, 0);
        sums.add(&one, &mean);
        let found = sums.finish();
        assert_eq!(found.lines, 5);
        assert!(found.correlation[0].iter().all(|value| (value - 1.0).abs() < 1e-5), "{:?}", found.correlation[0]);
    }
}
