//! Buffers of a thread that fits particles in a window.

use super::image::{COUNTS, SpotImage, UNKNOWNS};
use lf_core::particle_image;

/// Buffers of a thread. `own` and `lane` are 0 and `stamp` is unset between uses.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    pub(super) scratch: particle_image::Scratch,
    pub(super) own: Vec<f32>,
    pub(super) weight: Vec<f32>,
    pub(super) pull: Vec<f32>,
    pub(super) lane: Vec<f32>,
    /// Weighed derivatives of one particle; 0 between uses.
    pub(super) field: Vec<[f32; UNKNOWNS]>,
    is_touched: Vec<bool>,
    pub(super) touched: Vec<u32>,
}

impl Buffers {
    pub(super) fn fit(&mut self, pixels: usize) {
        for lane in [&mut self.own, &mut self.weight, &mut self.pull, &mut self.lane] {
            if lane.len() < pixels {
                lane.resize(pixels, 0.0);
            }
        }
        if self.is_touched.len() < pixels {
            self.is_touched.resize(pixels, false);
        }
    }

    /// Lists the pixels of the images and adds their light up in `own`.
    pub(super) fn paint(&mut self, images: &[SpotImage], columns: usize) {
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
