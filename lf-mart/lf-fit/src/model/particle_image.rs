//! The image of a particle on the sensors of all cameras, within a window, with the derivatives that the fit needs.

use super::window::{Part, Window};
use crate::cameras::shape::ANALYTIC;
use crate::cameras::view::Cameras;
use crate::particle::Particle;
use lf_core::particle_image::{PLACES, ParticleModel, Patch, QUANTITIES, Scratch};
use ndarray::{Array2, s};
use std::ops::Range;

/// Numbers of a pixel: the derivatives of its counts by x, y and z in pixels of the focal plane and by the logarithm of
/// the light. The last one is the counts.
pub(crate) const UNKNOWNS: usize = 4;
/// The counts among the numbers of a pixel.
pub(crate) const COUNTS: usize = 3;

/// A pixel of the window, and the derivatives of its counts by the size, drift and blur that particles share.
pub(crate) type Slopes = (u32, [f32; ANALYTIC]);

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
pub(crate) struct ParticleImage {
    /// The particle when it was rendered.
    pub(crate) rendered: Particle,
    /// How far the counts have been moved since, pixels of the focal plane.
    step: [f64; 3],
    /// Light over that when it was rendered.
    factor: f64,
    blocks: Vec<Block>,
    pixels: Vec<[f32; UNKNOWNS]>,
}

/// The quantities of the model that are computed for an image.
pub(crate) enum Quantities<'a> {
    /// The light alone, for trials of places: all derivatives are 0.
    Light,
    /// Light and place.
    Places,
    /// All, which are shown patch by patch: for the unknowns that particles share.
    All(&'a mut dyn FnMut(Patch, &[[f64; QUANTITIES]])),
}

/// Lenslets and pixels for which a new image has room.
const BLOCKS: usize = 128;
const PIXELS: usize = 1024;
/// Lenslets are left out if all their pixels have less than this share of a particle's light.
const LEAST_SHARE: f32 = 1e-7;
/// On a blurred sensor, columns and rows at the rim of a lenslet's pixels are left out if all have less than this share
/// of its brightest one. They are half of the pixels, and hold a thousandth of the light.
const LEAST_OF_BRIGHTEST: f32 = 3e-3;

/// A part of the window, and how numbers of a camera's model become those of an image.
struct Target<'a> {
    model: &'a ParticleModel,
    part: &'a Part,
    /// Length of the window's rows.
    row: usize,
    /// Factors of the light and of the derivatives by the place.
    light: f64,
    length: f64,
    /// From the frame of the camera to that of the first one.
    rotation: Option<&'a [[f64; 3]; 3]>,
    /// The share of its light that each pixel counts.
    flat: Option<&'a Array2<f32>>,
}

impl ParticleImage {
    /// Renders a particle.
    pub(crate) fn new(cameras: &Cameras, particle: &Particle, window: &Window, scratch: &mut Scratch) -> Self {
        Self::render(cameras, particle, window, scratch, Quantities::Places)
    }

    /// Renders the light of a particle, without derivatives.
    pub(crate) fn light(cameras: &Cameras, particle: &Particle, window: &Window, scratch: &mut Scratch) -> Self {
        Self::render(cameras, particle, window, scratch, Quantities::Light)
    }

    /// Adds to a window what waves at the rim of the stop add to the light of a particle.
    pub(crate) fn add_rest(cameras: &Cameras, particle: &Particle, window: &mut Window, scratch: &mut Scratch) {
        for (view, part) in cameras.views.iter().zip(&window.parts) {
            let Particle { place_mm, light, log_size } = view.seen(particle);
            view.model.visit_rest(place_mm, log_size.exp(), scratch, |patch, pixels| {
                for (n, pixel) in pixels.iter().enumerate() {
                    if let Some((row, column)) = part.place(&patch, n) {
                        let share = view.flat.map_or(1.0, |flat| flat[(row, column)].max(0.0));
                        let at = part.start + (row - part.top) * window.columns + column - part.left;
                        window.light[at] += light as f32 * share * pixel[0];
                    }
                }
            });
        }
    }

    /// Renders some quantities of a particle in each camera.
    pub(crate) fn render(
        cameras: &Cameras,
        particle: &Particle,
        window: &Window,
        scratch: &mut Scratch,
        mut quantities: Quantities,
    ) -> Self {
        let (blocks, pixels) = (Vec::with_capacity(BLOCKS), Vec::with_capacity(PIXELS));
        let mut image = Self { rendered: *particle, step: [0.0; 3], factor: 1.0, blocks, pixels };
        for (view, part) in cameras.views.iter().zip(&window.parts) {
            if part.rows == 0 || part.columns == 0 {
                continue;
            }
            let Particle { place_mm, light, log_size } = view.seen(particle);
            let size = log_size.exp();
            let rotation = view.rotation();
            let target = Target {
                model: &view.model,
                part,
                row: window.columns,
                light,
                length: light * cameras.pixel_mm(),
                rotation,
                flat: view.flat,
            };
            let mut take = |patch: Patch, pixels: &[[f32; PLACES]]| image.take(&target, patch, pixels);
            match &mut quantities {
                Quantities::Light => view.model.visit_light(place_mm, size, scratch, take),
                Quantities::Places => view.model.visit_places(place_mm, size, scratch, take),
                Quantities::All(each) => {
                    let mut places = Vec::new();
                    view.model.visit(place_mm, size, scratch, |patch, pixels| {
                        places.clear();
                        places.extend(pixels.iter().map(|[light, x, y, z, ..]| [light, x, y, z].map(|v| *v as f32)));
                        take(patch, &places);
                        each(patch, pixels);
                    });
                }
            }
        }
        // Many images are held at once.
        image.blocks.shrink_to_fit();
        image.pixels.shrink_to_fit();
        image
    }

    /// Renders a particle in the only camera, with the derivatives by what particles share.
    pub(crate) fn with_slopes(
        cameras: &Cameras,
        particle: &Particle,
        window: &Window,
        scratch: &mut Scratch,
    ) -> (Self, Vec<Slopes>) {
        let (part, view) = (&window.parts[0], cameras.first());
        let mut scale = view.shape.scales(view.camera).map(|scale| particle.light * scale);
        // A particle that is larger than others grows more with the size of all.
        scale[0] *= particle.log_size.exp();
        let mut slopes = Vec::new();
        let mut take = |patch: Patch, pixels: &[[f64; QUANTITIES]]| {
            for (n, pixel) in pixels.iter().enumerate() {
                if let Some((row, column)) = part.place(&patch, n) {
                    let at = (row - part.top) * part.columns + column - part.left;
                    let share = view.flat.map_or(1.0, |flat| f64::from(flat[(row, column)].max(0.0)));
                    slopes.push((at as u32, std::array::from_fn(|k| (share * scale[k] * pixel[PLACES + k]) as f32)));
                }
            }
        };
        let image = Self::render(cameras, particle, window, scratch, Quantities::All(&mut take));
        (image, slopes)
    }

    /// The columns and rows of a patch that hold its light. None if that is too little.
    #[inline(always)]
    pub(crate) fn lit(model: &ParticleModel, patch: &Patch, pixels: &[[f32; PLACES]]) -> Option<[Range<usize>; 2]> {
        let most = pixels.iter().fold(0f32, |most, pixel| most.max(pixel[0]));
        if most < LEAST_SHARE {
            return None;
        }
        if !model.is_blurred() {
            return Some([0..patch.columns as usize, 0..patch.rows as usize]);
        }
        // First and last column, and row.
        let [mut low, mut high] = [[usize::MAX; 2], [0; 2]];
        for (row, line) in pixels.chunks(patch.columns as usize).enumerate() {
            for (column, pixel) in line.iter().enumerate() {
                if pixel[0] > LEAST_OF_BRIGHTEST * most {
                    low = [low[0].min(column), low[1].min(row)];
                    high = [high[0].max(column), row];
                }
            }
        }
        Some([0, 1].map(|axis| low[axis]..high[axis] + 1))
    }

    /// Bytes of an image with this number of lenslets and pixels.
    pub(crate) fn bytes(lenslets: usize, pixels: usize) -> usize {
        lenslets * size_of::<Block>() + pixels * size_of::<[f32; UNKNOWNS]>()
    }

    /// An image of single lines: first pixel and numbers.
    #[cfg(test)]
    pub(crate) fn by_hand(lines: &[(usize, Vec<[f32; UNKNOWNS]>)]) -> Self {
        let block =
            |(start, pixels): &(usize, Vec<_>)| Block { start: *start as u32, columns: pixels.len() as u16, rows: 1 };
        let pixels = lines.iter().flat_map(|(_, pixels)| pixels.iter().copied()).collect();
        Self { factor: 1.0, blocks: lines.iter().map(block).collect(), pixels, ..Self::default() }
    }

    /// The image after a small step from where it was rendered, by its derivatives, with another light.
    pub(crate) fn moved(&self, particle: &Particle, step: [f64; 3]) -> Self {
        let factor = particle.light / self.rendered.light;
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

    /// Takes the part of a patch that lies within the window.
    #[inline(always)]
    fn take(&mut self, target: &Target, patch: Patch, pixels: &[[f32; PLACES]]) {
        let Target { model, part, row: row_length, light, length, rotation, flat } = *target;
        let Some([columns, rows]) = Self::lit(model, &patch, pixels) else { return };
        let within = |first: u32, lit: Range<usize>, low: usize, size: usize| {
            let from = (first as usize + lit.start).clamp(low, low + size);
            (from, (first as usize + lit.end).clamp(from, low + size))
        };
        let (left, right) = within(patch.column, columns, part.left, part.columns);
        let (top, bottom) = within(patch.row, rows, part.top, part.rows);
        if left >= right || top >= bottom {
            return;
        }
        let start = part.start + (top - part.top) * row_length + left - part.left;
        let (columns, rows) = ((right - left) as u16, (bottom - top) as u16);
        self.blocks.push(Block { start: start as u32, columns, rows });
        let (light, length) = (light as f32, length as f32);
        let turned = rotation.map(|rows| rows.map(|row| row.map(|number| number as f32)));
        for row in top..bottom {
            let first = (row - patch.row as usize) * patch.columns as usize + left - patch.column as usize;
            // The chain rule. An identity costs nothing.
            for pixel in &pixels[first..first + right - left] {
                let [share, x, y, z] = *pixel;
                let by = match &turned {
                    None => [x, y, z],
                    Some([a, b, c]) => [0, 1, 2].map(|k| a[k] * x + b[k] * y + c[k] * z),
                };
                self.pixels.push([length * by[0], length * by[1], length * by[2], light * share]);
            }
            if let Some(flat) = flat {
                let line = self.pixels.len() - (right - left);
                let shares = flat.slice(s![row, left..right]);
                let pixels = self.pixels[line..].iter_mut().zip(shares);
                pixels.for_each(|(pixel, share)| pixel.iter_mut().for_each(|value| *value *= share.max(0.0)));
            }
        }
    }

    /// Calls `each(place in the window, numbers)` for all pixels. A pixel may come more than once.
    #[inline(always)]
    pub(crate) fn pixels(&self, columns: usize, mut each: impl FnMut(usize, &[f32; UNKNOWNS])) {
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

    /// Calls `each(first place in the window, numbers of the pixels)` line by line.
    #[inline(always)]
    pub(crate) fn lines(&self, columns: usize, mut each: impl FnMut(usize, &[[f32; UNKNOWNS]])) {
        let mut rest = self.pixels.as_slice();
        for block in &self.blocks {
            for row in 0..block.rows as usize {
                let (line, behind) = rest.split_at(block.columns as usize);
                each(block.start as usize + row * columns, line);
                rest = behind;
            }
        }
    }

    /// Sums of the numbers of all pixels, times the `factor` of the pixel's place.
    pub(crate) fn products(&self, columns: usize, factor: impl Fn(usize) -> f32) -> [f64; UNKNOWNS] {
        let mut sums = [0f64; UNKNOWNS];
        self.pixels(columns, |n, pixel| {
            let factor = factor(n);
            (0..UNKNOWNS).for_each(|k| sums[k] += f64::from(factor * pixel[k]));
        });
        sums
    }

    /// Adds `sign` times the particle's light to a window.
    pub(crate) fn add_to(&self, light: &mut [f32], columns: usize, sign: f32) {
        self.lines(columns, |start, line| {
            for (light, pixel) in light[start..start + line.len()].iter_mut().zip(line) {
                *light += sign * pixel[COUNTS];
            }
        });
    }

    /// Whether the window sees nothing of it.
    pub(crate) fn is_dark(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Scales the light.
    pub(crate) fn scale(&mut self, factor: f32) {
        self.factor *= f64::from(factor);
        self.pixels.iter_mut().for_each(|pixel| pixel.iter_mut().for_each(|value| *value *= factor));
    }
}
