//! Buffers of a thread that fits particles in a window.

use super::entries::Entries;
use super::image::{COUNTS, SpotImage};
use lf_core::particle_image;

/// Buffers of a thread. `own` is 0 and no pixel is touched between uses.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    pub(super) scratch: particle_image::Scratch,
    pub(super) own: Vec<f32>,
    pub(super) weight: Vec<f32>,
    pub(super) pull: Vec<f32>,
    /// Particles by pixel, and places of blocks, of normal equations.
    pub(super) entries: Entries,
    pub(super) slots: Vec<u32>,
    /// Numbers of images by pixel, one for each lenslet; pixels that have any.
    pub(super) counts: Vec<u32>,
    pub(super) touched: Vec<u32>,
}

impl Buffers {
    pub(super) fn fit(&mut self, pixels: usize) {
        for lane in [&mut self.own, &mut self.weight, &mut self.pull] {
            if lane.len() < pixels {
                lane.resize(pixels, 0.0);
            }
        }
        if self.counts.len() < pixels {
            self.counts.resize(pixels, 0);
        }
    }

    /// Lists the pixels of the images and adds their light up in `own`.
    pub(super) fn paint<'i>(&mut self, images: impl Iterator<Item = &'i SpotImage>, columns: usize) {
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

    pub(super) fn wipe(&mut self) {
        for n in self.touched.drain(..) {
            self.own[n as usize] = 0.0;
            self.counts[n as usize] = 0;
        }
    }
}
