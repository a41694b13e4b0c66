//! Levenberg-Marquardt on the places and lights of a group of particles in a window, the others held.

use super::buffers::Buffers;
use super::image::{SpotImage, UNKNOWNS};
use super::normal::{FINE, Normal, conjugate_gradients};
use super::{noise::Noise, spot::Spot, window::Window};
use lf_core::particle_image::ParticleModel;

/// The base that all fits of a frame share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting<'a> {
    pub(super) model: &'a ParticleModel,
    pub(super) noise: Noise,
    /// A pixel at the focal plane, mm.
    pub(super) pixel_mm: f64,
    /// Least and most depth, mm.
    pub(super) depth_mm: [f64; 2],
}

/// When a fit ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ends {
    /// Most steps.
    pub(super) steps: usize,
    /// A step that lowers -2 log L by less is the last.
    pub(super) gain: f64,
}

/// A fitted group.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub(super) spots: Vec<Spot>,
    pub(super) images: Vec<SpotImage>,
    /// -2 log L beyond that of the window without the group.
    pub(super) deviance: f64,
}

/// Damping: its start, its change after a good and after a bad step, and where it ends.
const DAMPING: f64 = 0.01;
const LESS: f64 = 0.2;
const MORE: f64 = 8.0;
const LEAST_DAMPING: f64 = 1e-6;
const MOST_DAMPING: f64 = 1e4;
/// Blocks serve another step after one that lowered -2 log L by less than this for each particle.
const STALE: f64 = 0.3;
/// Longest step: sideways and along z, pixels of the focal plane. Light falls at most to this share.
const SIDEWAYS: f64 = 1.0;
const ALONG_Z: f64 = 20.0;
const LEAST_LIGHT: f64 = 0.3;
/// An image is not rendered anew if no ray has moved by more than this, pixels on the array: the derivatives tell the
/// light to the square of this, a ten-thousandth.
const NEAR: f64 = 0.015;
/// Light rises at most by this factor.
const MOST_LIGHT: f64 = 3.0;

impl Setting<'_> {
    pub(super) fn image(&self, spot: &Spot, window: &Window, buffers: &mut Buffers) -> SpotImage {
        SpotImage::of(self.model, spot, self.pixel_mm, window, &mut buffers.scratch)
    }

    /// The image of a particle near the place where `image` was rendered: what the derivatives say if that is near
    /// enough.
    fn image_after(&self, spot: &Spot, image: &SpotImage, window: &Window, buffers: &mut Buffers) -> SpotImage {
        let from = &image.rendered;
        let step: [f64; 3] = std::array::from_fn(|k| (spot.place_mm[k] - from.place_mm[k]) / self.pixel_mm);
        let spread = self.model.spread_px(step[2] * self.pixel_mm);
        if step[0].abs().max(step[1].abs()).max(spread) > NEAR {
            return self.image(spot, window, buffers);
        }
        image.moved(spot, step)
    }

    /// -2 log L of a window with the images beyond that without them.
    pub(super) fn deviance<'i>(
        &self,
        window: &Window,
        images: impl Iterator<Item = &'i SpotImage>,
        buffers: &mut Buffers,
    ) -> f64 {
        buffers.fit(window.seen.len());
        buffers.paint(images, window.columns);
        let sum = self.painted_deviance(window, buffers);
        buffers.wipe();
        sum
    }

    fn painted_deviance(&self, window: &Window, buffers: &Buffers) -> f64 {
        let pixel = |n: &u32| {
            let (n, seen) = (*n as usize, window.seen[*n as usize]);
            let others = window.light[n];
            if seen.is_nan() { 0.0 } else { self.noise.deviance(seen, others, others + buffers.own[n]) }
        };
        buffers.touched.iter().map(pixel).sum()
    }

    /// Fills `weight` and `pull` (weight times difference) at the painted pixels.
    pub(super) fn weigh(&self, window: &Window, buffers: &mut Buffers) {
        for n in &buffers.touched {
            let n = *n as usize;
            let expected = window.light[n] + buffers.own[n];
            let seen = window.seen[n];
            let weight = if seen.is_nan() { 0.0 } else { 1.0 / self.noise.variance(expected) };
            buffers.weight[n] = weight;
            buffers.pull[n] = if seen.is_nan() { 0.0 } else { weight * (seen - expected) };
        }
    }

    /// Fills `weight` at the painted pixels of a window that holds all light.
    pub(super) fn weigh_whole(&self, window: &Window, buffers: &mut Buffers) {
        for n in &buffers.touched {
            let n = *n as usize;
            buffers.weight[n] = if window.seen[n].is_nan() { 0.0 } else { 1.0 / self.noise.variance(window.light[n]) };
            buffers.pull[n] = 0.0;
        }
    }

    /// Fits a group whose images are known. The window holds the light of all others.
    pub(super) fn joint(
        &self,
        window: &Window,
        spots: &[Spot],
        mut images: Vec<SpotImage>,
        ends: Ends,
        buffers: &mut Buffers,
    ) -> Fitted {
        buffers.fit(window.seen.len());
        let mut spots = spots.to_vec();
        buffers.paint(images.iter(), window.columns);
        let mut deviance = self.painted_deviance(window, buffers);
        let mut damping = DAMPING;
        let mut is_weighed = false;
        let mut normal = Normal::default();
        let mut is_stale = true;
        for _ in 0..ends.steps {
            if !is_weighed {
                self.weigh(window, buffers);
                if is_stale {
                    normal = Normal::new(images.iter(), window.columns, buffers);
                } else {
                    normal.pull(images.iter(), window.columns, buffers);
                }
                is_weighed = true;
            }
            let step = conjugate_gradients(&normal, &normal.gradient, damping, FINE);
            buffers.wipe();
            let next: Vec<Spot> = spots.iter().zip(&step).map(|(spot, step)| self.moved(spot, step)).collect();
            let next_images: Vec<SpotImage> =
                next.iter().zip(&images).map(|(spot, image)| self.image_after(spot, image, window, buffers)).collect();
            buffers.paint(next_images.iter(), window.columns);
            let reached = self.painted_deviance(window, buffers);
            if reached < deviance {
                let gain = deviance - reached;
                (spots, images, deviance) = (next, next_images, reached);
                damping = (damping * LESS).max(LEAST_DAMPING);
                is_weighed = false;
                is_stale = gain > STALE * spots.len() as f64;
                if gain < ends.gain {
                    break;
                }
            } else {
                damping *= MORE;
                if damping > MOST_DAMPING {
                    break;
                }
                buffers.wipe();
                buffers.paint(images.iter(), window.columns);
            }
        }
        buffers.wipe();
        Fitted { spots, images, deviance }
    }

    /// A spot after a step, which is held within bounds.
    pub(super) fn moved(&self, spot: &Spot, step: &[f64; UNKNOWNS]) -> Spot {
        let [x, y, z] = spot.place_mm;
        let [low, high] = self.depth_mm;
        let aside = |step: f64| self.pixel_mm * step.clamp(-SIDEWAYS, SIDEWAYS);
        let z = z + self.pixel_mm * step[2].clamp(-ALONG_Z, ALONG_Z);
        let factor = (1.0 + step[3]).clamp(LEAST_LIGHT, MOST_LIGHT);
        Spot { place_mm: [x + aside(step[0]), y + aside(step[1]), z.clamp(low, high)], light: spot.light * factor }
    }
}
