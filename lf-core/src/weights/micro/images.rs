//! Micro-images in the rows of one set: light that voxels send through each lenslet, or values that they look up.

use super::array::{LANES, LensletArray};
use super::stop::{Stop, StopRow};
use crate::simd::fastest;
use crate::weights::model::RowSet;
use rayon::prelude::*;

/// Components of a pixel: the light, and its moments along x and y.
const PARTS: usize = 3;
/// Values beside a row of pixels, for a patch that extends beyond it.
pub(super) const ROOM: usize = 8;

/// How rows of micro-images are stored in a buffer.
#[derive(Debug, Clone, Copy)]
pub(super) struct MicroLayout {
    /// Pixels of a micro-image, a side.
    pub(super) side: usize,
    /// Values of a part of a row of pixels.
    pub(super) width: usize,
    /// Maximum number of rows of a micro-image in a set.
    pub(super) slots: usize,
    /// Values of a micro-image.
    pub(super) image: usize,
    /// Values of a row of lenslets.
    pub(super) stride: usize,
}

impl MicroLayout {
    pub(super) fn new(array: &LensletArray, step: usize) -> Self {
        let (side, width, slots) = (array.side, array.side + ROOM, array.side.div_ceil(step));
        let image = slots * PARTS * width;
        Self { side, width, slots, image, stride: ROOM + array.length * image }
    }

    /// Values of a row of pixels, with all its parts.
    #[inline(always)]
    pub(super) fn slot(&self) -> usize {
        PARTS * self.width
    }

    /// Where a row of a lenslet's micro-image begins, in the buffer of rows of lenslets.
    #[inline(always)]
    pub(super) fn place(&self, row: usize, number: usize, slot: usize) -> usize {
        row * self.stride + ROOM + number * self.image + slot * PARTS * self.width
    }
}

/// Buffers of a projection for sets of every n-th image row.
#[derive(Debug)]
pub struct MicroImages {
    step: usize,
    pub(super) layout: MicroLayout,
    pub(super) values: Vec<f32>,
    /// Each micro-image's first row on the sensor, modulo n.
    pub(super) remainders: Vec<i32>,
}

/// Pixels of a row of a micro-image that lie on the sensor.
struct Pixels {
    from: usize,
    to: usize,
    /// Column of the sensor of the first.
    column: usize,
}

impl Pixels {
    fn new(array: &LensletArray, lenslet: usize, width: usize) -> Option<Self> {
        let first = array.column[lenslet];
        let from = (-first).max(0) as usize;
        let to = (width as i32 - first).clamp(0, array.side as i32) as usize;
        (from < to).then(|| Self { from, to, column: (first + from as i32) as usize })
    }
}

/// Each micro-image's first row on the sensor, modulo `step`.
pub(super) fn remainders(array: &LensletArray, step: usize) -> Vec<i32> {
    array.row.iter().map(|row| row.rem_euclid(step as i32)).collect()
}

fn set_stop(array: &LensletArray, stop: Stop, lenslet: usize, line: usize, row: &mut StopRow) {
    let middle = [array.middle_x[lenslet], array.middle_y[lenslet]];
    fastest(
        #[inline(always)]
        || row.set(array.side, line, middle, array.per_mm[lenslet] * stop.half_mm, stop.is_round),
    );
}

impl MicroImages {
    pub(super) fn new(array: &LensletArray, step: usize) -> Self {
        let layout = MicroLayout::new(array, step);
        Self { step, layout, values: vec![0.0; layout.stride * array.rows()], remainders: remainders(array, step) }
    }

    /// The n of the sets.
    pub fn step(&self) -> usize {
        self.step
    }

    /// Predicts the bytes of the buffers.
    pub(super) fn estimated_bytes(array: &LensletArray, step: usize) -> usize {
        4 * (MicroLayout::new(array, step).stride * array.rows() + array.row.len())
    }

    /// Sets the rows of the set, in an image of `width` columns and `stride` values a row, to the light of the
    /// micro-images.
    pub(super) fn add_up(
        &self,
        array: &LensletArray,
        stop: Stop,
        rows: RowSet,
        width: usize,
        stride: usize,
        image: &mut [f32],
    ) {
        let MicroLayout { side, width: part, stride: lenslets, .. } = self.layout;
        let lines = image.par_chunks_mut(stride).enumerate().filter(|(row, _)| rows.holds(*row as u32));
        lines.for_each_init(StopRow::default, |share, (image_row, out)| {
            out.fill(0.0);
            // Find the rows of lenslets whose micro-images cover the image row.
            let holds = |span: &(i32, i32)| span.0 <= image_row as i32 && (image_row as i32) < span.1 + side as i32;
            for (row, _) in array.spans.iter().enumerate().filter(|(_, span)| holds(span)) {
                let values = &self.values[row * lenslets..][..lenslets];
                for number in 0..array.length - LANES {
                    let lenslet = row * array.length + number;
                    let line = image_row as i32 - array.row[lenslet];
                    if line < 0 || line >= side as i32 {
                        continue;
                    }
                    let Some(Pixels { from, to, column }) = Pixels::new(array, lenslet, width) else { continue };
                    // Add the light and its moments, each times the stop's share.
                    set_stop(array, stop, lenslet, line as usize, share);
                    let place = self.layout.place(0, number, line as usize / self.step);
                    let [light, by_x, by_y] = [0, 1, 2].map(|n| &values[place + n * part..][from..to]);
                    let shares = [&share.share, &share.by_x, &share.by_y].map(|values| &values[from..to]);
                    for (n, out) in out[column..column + to - from].iter_mut().enumerate() {
                        *out += light[n] * shares[0][n] + by_x[n] * shares[1][n] + by_y[n] * shares[2][n];
                    }
                }
            }
        });
    }

    /// Sets the micro-images to the set's rows of an image times the stop's shares.
    pub(super) fn look_up(
        &mut self,
        array: &LensletArray,
        stop: Stop,
        rows: RowSet,
        width: usize,
        stride: usize,
        image: &[f32],
    ) {
        let (layout, step, remainders) = (self.layout, self.step, &self.remainders);
        let height = image.len() / stride;
        self.values.par_chunks_mut(layout.stride).enumerate().for_each_init(
            StopRow::default,
            |share, (row, values)| {
                values.fill(0.0);
                for number in 0..array.length - LANES {
                    let lenslet = row * array.length + number;
                    let Some(Pixels { from, to, column }) = Pixels::new(array, lenslet, width) else { continue };
                    // Find the rows of the micro-image that are in the set.
                    let ahead = (rows.first as i32 - remainders[lenslet]).rem_euclid(step as i32) as usize;
                    for slot in 0..layout.slots {
                        let line = ahead + slot * step;
                        let image_row = array.row[lenslet] + line as i32;
                        if line >= layout.side || image_row < 0 || image_row >= height as i32 {
                            continue;
                        }
                        // Multiply the pixels by the stop's share and its slopes.
                        set_stop(array, stop, lenslet, line, share);
                        let place = layout.place(0, number, slot);
                        let pixels = &image[image_row as usize * stride + column..][..to - from];
                        for (n, shares) in [&share.share, &share.by_x, &share.by_y].into_iter().enumerate() {
                            let out = values[place + n * layout.width..][from..to].iter_mut();
                            out.zip(pixels)
                                .zip(&shares[from..to])
                                .for_each(|((out, value), share)| *out = value * share);
                        }
                    }
                }
            },
        );
    }
}
