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
    is_touched: Vec<bool>,
    pub(super) touched: Vec<u32>,
}

impl Buffers {
    pub(super) fn fit(&mut self, pixels: usize) {
        for lane in [&mut self.own, &mut self.weight, &mut self.pull] {
            if lane.len() < pixels {
                lane.resize(pixels, 0.0);
            }
        }
        if self.is_touched.len() < pixels {
            self.is_touched.resize(pixels, false);
        }
    }

    /// Lists the pixels of the images and adds their light up in `own`.
    pub(super) fn paint<'i>(&mut self, images: impl Iterator<Item = &'i SpotImage>, columns: usize) {
        let Self { own, is_touched, touched, .. } = self;
        for image in images {
            image.lines(columns, |start, line| {
                let range = start..start + line.len();
                let places = own[range.clone()].iter_mut().zip(&mut is_touched[range]);
                for ((n, pixel), (own, is_touched)) in line.iter().enumerate().zip(places) {
                    *own += pixel[COUNTS];
                    if !*is_touched {
                        *is_touched = true;
                        touched.push((start + n) as u32);
                    }
                }
            });
        }
    }

    pub(super) fn wipe(&mut self) {
        for n in self.touched.drain(..) {
            self.own[n as usize] = 0.0;
            self.is_touched[n as usize] = false;
        }
    }
}
