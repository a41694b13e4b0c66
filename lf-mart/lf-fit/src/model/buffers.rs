//! Buffers that a thread needs while it fits particles in a window.

use super::entries::Entries;
use super::particle_image::{COUNTS, ParticleImage};
use crate::cameras::shape::SHAPES;
use lf_core::particle_image::Scratch;
use rayon::prelude::*;

/// Buffers of a thread, by pixel of the window. Between uses `own` is 0 and no pixel is touched.
#[derive(Debug, Default)]
pub(crate) struct FitBuffers {
    pub(crate) scratch: Scratch,
    /// Whether other threads may help: there are some, and no more tiles than threads.
    has_help: bool,
    /// Light of the images.
    pub(crate) own: Vec<f32>,
    /// Inverse variances.
    pub(crate) weight: Vec<f32>,
    /// Weights times the difference of seen and expected counts.
    pub(crate) residual: Vec<f32>,
    /// Derivative of a particle's light by its size; 0 between uses.
    pub(crate) by_size: Vec<f32>,
    /// Particles by pixel, and places of blocks, of normal equations.
    pub(crate) entries: Entries,
    pub(crate) slots: Vec<u32>,
    /// Numbers of lenslets' images by pixel.
    pub(crate) counts: Vec<u32>,
    /// Pixels with a count, in the order in which images came to them.
    pub(crate) touched: Vec<u32>,
    /// Derivatives of the shape's fit that are used again: freed after each step, they would leave holes in the heap.
    pub(crate) spare: Vec<Vec<[f32; SHAPES]>>,
}

impl FitBuffers {
    /// Buffers for one of some tiles that are worked on at once.
    pub(crate) fn beside(tiles: usize) -> Self {
        let threads = rayon::current_num_threads();
        Self { has_help: threads > 1 && tiles <= threads, ..Self::default() }
    }

    /// Draws something for each item, in their order.
    pub(crate) fn draw<A: Sync, T: Send>(
        &mut self,
        items: &[A],
        draw: impl Fn(&mut Scratch, &A) -> T + Send + Sync,
    ) -> Vec<T> {
        match self.has_help && items.len() > 1 {
            true => items.par_iter().map_init(Scratch::default, draw).collect(),
            false => items.iter().map(|item| draw(&mut self.scratch, item)).collect(),
        }
    }

    /// Makes room for this number of pixels.
    pub(crate) fn fit(&mut self, pixels: usize) {
        for lane in [&mut self.own, &mut self.weight, &mut self.residual] {
            if lane.len() < pixels {
                lane.resize(pixels, 0.0);
            }
        }
        if self.counts.len() < pixels {
            self.counts.resize(pixels, 0);
        }
    }

    /// Lists the pixels of the images, and adds up their light in `own`.
    pub(crate) fn paint<'i>(&mut self, images: impl Iterator<Item = &'i ParticleImage>, columns: usize) {
        let Self { own, counts, touched, .. } = self;
        for image in images {
            image.lines(columns, |start, line| {
                let range = start..start + line.len();
                let places = own[range.clone()].iter_mut().zip(&mut counts[range]);
                for ((n, pixel), (own, count)) in line.iter().enumerate().zip(places) {
                    *own += pixel[COUNTS];
                    if *count == 0 {
                        touched.push((start + n) as u32);
                    }
                    *count += 1;
                }
            });
        }
    }

    /// Makes the buffers ready for other images.
    pub(crate) fn wipe(&mut self) {
        for n in self.touched.drain(..) {
            self.own[n as usize] = 0.0;
            self.counts[n as usize] = 0;
        }
    }
}
