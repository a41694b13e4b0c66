//! The image of a particle within a window, with the derivatives that the fit needs.

use super::window::{Part, Window};
use super::{spot::Spot, view::View};
use lf_core::particle_image::{ParticleModel, Patch, QUANTITIES, Scratch};
use lf_core::simd::fastest;

/// Numbers of a pixel: the derivatives of its counts by x, y and z in pixels of the focal plane and by the logarithm of
/// the light. The last one is the counts.
pub(super) const UNKNOWNS: usize = 4;
/// The counts among the numbers of a pixel.
pub(super) const COUNTS: usize = 3;

/// Pixels of one lenslet.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// First pixel in the window.
    start: u32,
    columns: u16,
    rows: u16,
}

/// The image of a particle.
#[derive(Debug, Clone, Default)]
pub(super) struct SpotImage {
    /// The particle when it was rendered.
    pub(super) rendered: Spot,
    /// How far the counts have been moved since, pixels of the focal plane.
    step: [f64; 3],
    /// Light over that when it was rendered.
    factor: f64,
    blocks: Vec<Block>,
    pixels: Vec<[f32; UNKNOWNS]>,
}

/// Lenslets and pixels that an image has at first room for.
const BLOCKS: usize = 128;
const PIXELS: usize = 1024;
/// Pixels with less than this share of a particle's light are left out.
const LEAST_SHARE: f64 = 1e-7;

impl SpotImage {
    /// Renders a particle. `pixel_mm` is a pixel at the focal plane.
    pub(super) fn of(
        model: &ParticleModel,
        spot: &Spot,
        pixel_mm: f64,
        window: &Window,
        scratch: &mut Scratch,
    ) -> Self {
        let (blocks, pixels) = (Vec::with_capacity(BLOCKS), Vec::with_capacity(PIXELS));
        let mut image = Self { rendered: *spot, step: [0.0; 3], factor: 1.0, blocks, pixels };
        let scale = [spot.light, spot.light * pixel_mm];
        let (part, row) = (window.part(0), window.columns);
        fastest(
            #[inline(always)]
            || {
                model.visit_places(spot.place_mm, scratch, |patch, pixels| {
                    image.take((&part, row), patch, pixels, scale, |by| by);
                });
            },
        );
        image.shrink();
        image
    }

    /// Renders a particle's light for one camera; its derivatives are 0.
    pub(super) fn light_of(model: &ParticleModel, spot: &Spot, window: &Window, scratch: &mut Scratch) -> Self {
        let mut image = Self { rendered: *spot, factor: 1.0, ..Self::default() };
        let (part, row) = (window.part(0), window.columns);
        fastest(
            #[inline(always)]
            || {
                model.visit_light(spot.place_mm, scratch, |patch, pixels| {
                    image.take((&part, row), patch, pixels, [spot.light, 0.0], |by| by);
                });
            },
        );
        image
    }

    /// Adds the pixels of a further camera, whose rectangle of the window is `part` and whose rows are `row` long.
    pub(super) fn add_view(
        &mut self,
        view: &View,
        spot: &Spot,
        pixel_mm: f64,
        (part, row): (&Part, usize),
        scratch: &mut Scratch,
    ) {
        if part.rows == 0 || part.columns == 0 {
            return;
        }
        let seen = view.seen(spot);
        let scale = [seen.light, seen.light * pixel_mm];
        fastest(
            #[inline(always)]
            || {
                view.model.visit_places(seen.place_mm, scratch, |patch, pixels| {
                    self.take((part, row), patch, pixels, scale, |by| view.turned(by));
                });
            },
        );
    }

    /// The same, with all quantities of the model shown to `each`, patch by patch.
    pub(super) fn with_all(
        model: &ParticleModel,
        spot: &Spot,
        pixel_mm: f64,
        window: &Window,
        scratch: &mut Scratch,
        mut each: impl FnMut(Patch, &[[f64; QUANTITIES]]),
    ) -> Self {
        let (blocks, pixels) = (Vec::with_capacity(BLOCKS), Vec::with_capacity(PIXELS));
        let mut image = Self { rendered: *spot, step: [0.0; 3], factor: 1.0, blocks, pixels };
        let scale = [spot.light, spot.light * pixel_mm];
        let (part, row) = (window.part(0), window.columns);
        fastest(
            #[inline(always)]
            || {
                model.visit(spot.place_mm, scratch, |patch, pixels| {
                    image.take((&part, row), patch, pixels, scale, |by| by);
                    each(patch, pixels);
                });
            },
        );
        image.shrink();
        image
    }

    /// Whether the pixels of a lenslet have so little light that they are left out.
    #[inline(always)]
    pub(super) fn is_out(pixels: &[[f64; QUANTITIES]]) -> bool {
        pixels.iter().all(|pixel| pixel[0] < LEAST_SHARE)
    }

    /// Gives back the room that it does not need: many images are held at once.
    fn shrink(&mut self) {
        self.blocks.shrink_to_fit();
        self.pixels.shrink_to_fit();
    }

    /// Bytes of an image of so many lenslets and pixels.
    pub(super) fn bytes(lenslets: usize, pixels: usize) -> usize {
        lenslets * size_of::<Block>() + pixels * size_of::<[f32; UNKNOWNS]>()
    }

    /// An image of single lines: first pixel and numbers.
    #[cfg(test)]
    pub(super) fn by_hand(lines: &[(usize, Vec<[f32; UNKNOWNS]>)]) -> Self {
        let block =
            |(start, pixels): &(usize, Vec<_>)| Block { start: *start as u32, columns: pixels.len() as u16, rows: 1 };
        let pixels = lines.iter().flat_map(|(_, pixels)| pixels.iter().copied()).collect();
        Self { factor: 1.0, blocks: lines.iter().map(block).collect(), pixels, ..Self::default() }
    }

    /// The image after a small step from where it was rendered, by its derivatives, with another light.
    pub(super) fn moved(&self, spot: &Spot, step: [f64; 3]) -> Self {
        let factor = spot.light / self.rendered.light;
        let scale = (factor / self.factor) as f32;
        let more: [f32; 3] = std::array::from_fn(|k| (step[k] - self.step[k]) as f32);
        let mut image =
            Self { rendered: self.rendered, step, factor, blocks: self.blocks.clone(), pixels: self.pixels.clone() };
        for pixel in &mut image.pixels {
            let [x, y, z, counts] = *pixel;
            let counts = counts + ((x * more[0] + y * more[1]) + z * more[2]);
            *pixel = [x * scale, y * scale, z * scale, counts * scale];
        }
        image
    }

    /// Takes a patch; `turn` brings derivatives by the place into the first camera's frame.
    #[inline(always)]
    fn take(
        &mut self,
        (part, row_length): (&Part, usize),
        patch: Patch,
        pixels: &[[f64; QUANTITIES]],
        [light, length]: [f64; 2],
        turn: impl Fn([f64; 3]) -> [f64; 3],
    ) {
        // The part of the patch that lies within the window.
        let within = |first: u32, count: u32, low: usize, size: usize| {
            let from = (first as usize).clamp(low, low + size);
            (from, ((first + count) as usize).clamp(from, low + size))
        };
        let (left, right) = within(patch.column, patch.columns, part.left, part.columns);
        let (top, bottom) = within(patch.row, patch.rows, part.top, part.rows);
        if left >= right || top >= bottom || Self::is_out(pixels) {
            return;
        }
        let start = part.start + (top - part.top) * row_length + left - part.left;
        let (columns, rows) = ((right - left) as u16, (bottom - top) as u16);
        self.blocks.push(Block { start: start as u32, columns, rows });
        for row in top..bottom {
            let first = (row - patch.row as usize) * patch.columns as usize + left - patch.column as usize;
            let line = &pixels[first..first + right - left];
            self.pixels.extend(line.iter().map(|pixel| {
                let [x, y, z] = turn([pixel[1], pixel[2], pixel[3]]);
                [length * x, length * y, length * z, light * pixel[0]].map(|value| value as f32)
            }));
        }
    }

    /// Calls `each(place in the window, numbers)` for all pixels. A pixel may come more than once.
    #[inline(always)]
    pub(super) fn pixels(&self, columns: usize, mut each: impl FnMut(usize, &[f32; UNKNOWNS])) {
        self.lines(
            columns,
            #[inline(always)]
            |start, line| {
                for (n, pixel) in line.iter().enumerate() {
                    each(start + n, pixel);
                }
            },
        );
    }

    /// The same line by line: `each(first place in the window, numbers of the pixels)`.
    #[inline(always)]
    pub(super) fn lines(&self, columns: usize, mut each: impl FnMut(usize, &[[f32; UNKNOWNS]])) {
        let mut rest = self.pixels.as_slice();
        for block in &self.blocks {
            for row in 0..block.rows as usize {
                let (line, behind) = rest.split_at(block.columns as usize);
                each(block.start as usize + row * columns, line);
                rest = behind;
            }
        }
    }

    /// Adds `sign` times the particle's light to a window.
    pub(super) fn add_to(&self, light: &mut [f32], columns: usize, sign: f32) {
        self.lines(columns, |start, line| {
            for (light, pixel) in light[start..start + line.len()].iter_mut().zip(line) {
                *light += sign * pixel[COUNTS];
            }
        });
    }

    /// Whether the window sees nothing of it.
    pub(super) fn is_dark(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Scales the light.
    pub(super) fn scale(&mut self, factor: f32) {
        self.factor *= f64::from(factor);
        self.pixels.iter_mut().for_each(|pixel| pixel.iter_mut().for_each(|value| *value *= factor));
    }
}
