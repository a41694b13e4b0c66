//! Light on the finer sensor, and how it becomes that of the pixels.

use super::fine_sensor::FineSensor;
use super::pictures::LANES;
use super::quantities::QUANTITIES;
use crate::simd::fastest;

/// Light and derivatives in finer pixels, and what comes of it.
#[derive(Debug, Default)]
pub(super) struct FineLight {
    /// Row by row of finer pixels; a row has a line of columns for each quantity and each part of a pixel.
    fine: Vec<f32>,
    down: Vec<f32>,
    /// Columns of a line, those before the first pixel, lines of a quantity and quantities.
    stride: usize,
    before: usize,
    parts: usize,
    quantities: usize,
    /// Pixels, for each quantity row by row, and columns of a row.
    pub(super) pixels: [Vec<f32>; QUANTITIES],
    pub(super) columns: usize,
}

impl FineLight {
    /// Makes room for pixels.
    pub(super) fn begin(&mut self, sensor: &FineSensor, [columns, rows]: [usize; 2], quantities: usize) {
        let FineSensor { parts, reach, .. } = *sensor;
        self.before = 2 * reach;
        self.columns = (columns + 2 * reach).next_multiple_of(LANES);
        self.stride = self.columns + self.before;
        (self.parts, self.quantities) = (parts, quantities);
        self.fine.clear();
        self.fine.resize(rows * parts * self.line(), 0.0);
    }

    fn line(&self) -> usize {
        self.quantities * self.parts * self.stride
    }

    /// Where a row's columns of one part begin.
    pub(super) fn start(&self, row: usize, part: usize) -> usize {
        row * self.line() + part * self.stride + self.before
    }

    /// Adds to the first quantity in a row of finer pixels.
    #[inline(always)]
    pub(super) fn add_row(&mut self, row: usize, numbers: &[f32]) {
        for part in 0..self.parts {
            let start = self.start(row, part);
            let own = numbers.iter().skip(part).step_by(self.parts);
            self.fine[start..].iter_mut().zip(own).for_each(|(sum, number)| *sum += *number);
        }
    }

    /// Sets a quantity at places that count from [`Self::start`].
    #[inline(always)]
    pub(super) fn set(&mut self, quantity: usize, at: &[u32], numbers: &[f32]) {
        let fine = &mut self.fine[quantity * self.parts * self.stride..];
        for (at, number) in at.iter().zip(numbers) {
            fine[*at as usize] = *number;
        }
    }
}

impl FineSensor {
    /// Smooths finer pixels to pixels, which begin `reach` pixels before them.
    #[inline(never)]
    pub(super) fn smooth(&self, light: &mut FineLight, rows: usize, is_by_blur: bool) {
        fastest(
            #[inline(always)]
            || self.smooth_all(light, rows, is_by_blur),
        );
    }

    #[inline(always)]
    fn smooth_all(&self, light: &mut FineLight, rows: usize, is_by_blur: bool) {
        self.smooth_rows(light, (rows, light.quantities), &self.weights[0]);
        for quantity in 0..light.quantities {
            self.smooth_columns(light, (quantity, quantity), &self.weights[0]);
        }
        if is_by_blur {
            // By the blur along x and y.
            self.smooth_columns(light, (0, QUANTITIES - 1), &self.weights[1]);
            self.smooth_rows(light, (rows, 1), &self.weights[1]);
            let along_x = std::mem::take(&mut light.pixels[QUANTITIES - 1]);
            self.smooth_columns(light, (0, QUANTITIES - 1), &self.weights[0]);
            for (sum, more) in light.pixels[QUANTITIES - 1].iter_mut().zip(&along_x) {
                *sum += more;
            }
        }
    }

    /// Smooths the first quantities of the rows.
    #[inline(always)]
    fn smooth_rows(&self, light: &mut FineLight, (rows, quantities): (usize, usize), weights: &[f32]) {
        let (line, wanted) = (light.line(), quantities * light.parts * light.stride);
        let FineLight { fine, down, .. } = light;
        let fine_rows = fine.len() / line;
        down.resize(rows * line, 0.0);
        for (row, down) in down.chunks_exact_mut(line).enumerate() {
            let down = &mut down[..wanted];
            down.fill(0.0);
            for (tap, weight) in weights.iter().enumerate() {
                let Some(at) = (row * self.parts + tap).checked_sub(2 * self.reach * self.parts) else { continue };
                if at < fine_rows {
                    for (sum, value) in down.iter_mut().zip(&fine[at * line..]) {
                        *sum += weight * value;
                    }
                }
            }
        }
    }

    /// From one quantity of the smoothed rows to another of the pixels.
    #[inline(always)]
    fn smooth_columns(&self, light: &mut FineLight, (from, to): (usize, usize), weights: &[f32]) {
        let line = light.line();
        let FineLight { down, pixels, columns, stride, .. } = light;
        let out = &mut pixels[to];
        out.resize(down.len() / line * *columns, 0.0);
        for (down, out) in down.chunks_exact(line).zip(out.chunks_exact_mut(*columns)) {
            let down = &down[from * self.parts * *stride..][..self.parts * *stride];
            for (first, out) in out.chunks_exact_mut(LANES).enumerate() {
                let mut sum = [0f32; LANES];
                for (tap, weight) in weights.iter().enumerate() {
                    let start = tap % self.parts * *stride + first * LANES + tap / self.parts;
                    let values: &[f32; LANES] = down[start..start + LANES].try_into().expect("eight columns");
                    for k in 0..LANES {
                        sum[k] += weight * values[k];
                    }
                }
                out.copy_from_slice(&sum);
            }
        }
    }
}
