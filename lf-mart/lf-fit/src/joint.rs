//! Levenberg-Marquardt on the places and lights of a group of particles in a window, the others held.

use super::buffers::Buffers;
use super::image::{SpotImage, UNKNOWNS};
use super::noise::{LANES, Lanes, Noise};
use super::normal::{FINE, Normal, conjugate_gradients};
use super::{spot::Spot, view::View, window::Window};
use lf_core::particle_image::ParticleModel;
use lf_core::simd::fastest;

/// The base that all fits of a frame share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting<'a> {
    pub(super) model: &'a ParticleModel,
    /// Further cameras; a window that shows no part of them has their light left out.
    pub(super) views: &'a [View],
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
    /// Whether the last step that was taken still moved a particle.
    pub(super) is_busy: Vec<bool>,
}

/// Where a fit begins.
struct Start {
    spots: Vec<Spot>,
    images: Vec<SpotImage>,
    damping: f64,
}

/// A particle is busy if its part in a step lowers -2 log L by more than this: less is a tenth of its uncertainty.
const BUSY: f64 = 0.01;
/// Busy particles go on without the others if they are less than this share.
const FEW: f64 = 0.6;

/// Fall of -2 log L by a particle's part in a step.
fn fall(gradient: &[f64; UNKNOWNS], step: &[f64; UNKNOWNS]) -> f64 {
    gradient.iter().zip(step).map(|(gradient, step)| gradient * step).sum()
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
        let mut image = SpotImage::of(self.model, spot, self.pixel_mm, window, &mut buffers.scratch);
        for (view, part) in self.views.iter().zip(&window.further) {
            image.add_view(view, spot, self.pixel_mm, (part, window.columns), &mut buffers.scratch);
        }
        image
    }

    /// The image of a particle with its light alone, for trials of places.
    pub(super) fn light_image(&self, spot: &Spot, window: &Window, buffers: &mut Buffers) -> SpotImage {
        if self.views.is_empty() {
            return SpotImage::light_of(self.model, spot, window, &mut buffers.scratch);
        }
        self.image(spot, window, buffers)
    }

    /// Whether two places lie within `aside` pixels of the focal plane, sideways for any of the cameras.
    pub(super) fn is_beside(&self, one: [f64; 3], other: [f64; 3], aside: f64) -> bool {
        let between: [f64; 3] = std::array::from_fn(|axis| one[axis] - other[axis]);
        let reach = aside * self.pixel_mm;
        (0..2).all(|axis| between[axis].abs() < reach) || self.views.iter().any(|view| view.aside_px(between) < aside)
    }

    /// The noise of each camera.
    pub(super) fn noises(&self) -> impl Iterator<Item = &Noise> {
        std::iter::once(&self.noise).chain(self.views.iter().map(|view| &view.noise))
    }

    /// The noise of the camera that a pixel of the window is of.
    #[inline(always)]
    pub(super) fn noise_at(&self, window: &Window, pixel: usize) -> &Noise {
        match window.camera_of(pixel) {
            0 => &self.noise,
            n => &self.views[n - 1].noise,
        }
    }

    /// The image of a particle near the place where `image` was rendered: what the derivatives say if that is near
    /// enough.
    fn image_after(&self, spot: &Spot, image: &SpotImage, window: &Window, buffers: &mut Buffers) -> SpotImage {
        let from = &image.rendered;
        let step: [f64; 3] = std::array::from_fn(|k| (spot.place_mm[k] - from.place_mm[k]) / self.pixel_mm);
        let spread = self.model.spread_px(step[2] * self.pixel_mm);
        let far = |view: &View| view.moved_px(step.map(|step| step * self.pixel_mm)) > NEAR;
        if step[0].abs().max(step[1].abs()).max(spread) > NEAR || self.views.iter().any(far) {
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
        if window.further.is_empty() {
            return Self::deviance_of(&self.noise, &buffers.touched, window, buffers);
        }
        let of_camera = |(camera, noise): (usize, &Noise)| {
            let is_mine = |n: &u32| window.camera_of(*n as usize) == camera;
            let mine: Vec<u32> = buffers.touched.iter().copied().filter(is_mine).collect();
            Self::deviance_of(noise, &mine, window, buffers)
        };
        self.noises().enumerate().map(of_camera).sum()
    }

    /// -2 log L of painted pixels of one camera.
    fn deviance_of(noise: &Noise, touched: &[u32], window: &Window, buffers: &Buffers) -> f64 {
        let mut sum = 0.0;
        fastest(
            #[inline(always)]
            || {
                for chunk in touched.chunks(LANES) {
                    let mut lanes = Lanes::default();
                    for (k, n) in chunk.iter().enumerate() {
                        let (n, seen) = (*n as usize, window.seen[*n as usize]);
                        // Lanes of zeros count nothing, and so do blind pixels.
                        if !seen.is_nan() {
                            let others = window.light[n];
                            lanes.seen[k] = f64::from(seen);
                            lanes.others[k] = f64::from(others);
                            lanes.expected[k] = f64::from(others + buffers.own[n]);
                        }
                    }
                    sum += noise.deviance(&lanes);
                }
            },
        );
        sum
    }

    /// Fills `weight` and `pull` (weight times difference) at the painted pixels.
    pub(super) fn weigh(&self, window: &Window, buffers: &mut Buffers) {
        for n in &buffers.touched {
            let n = *n as usize;
            let expected = window.light[n] + buffers.own[n];
            let seen = window.seen[n];
            let weight = if seen.is_nan() { 0.0 } else { 1.0 / self.noise_at(window, n).variance(expected) };
            buffers.weight[n] = weight;
            buffers.pull[n] = if seen.is_nan() { 0.0 } else { weight * (seen - expected) };
        }
    }

    /// Fills `weight` at the painted pixels of a window that holds all light.
    pub(super) fn weigh_whole(&self, window: &Window, buffers: &mut Buffers) {
        for n in &buffers.touched {
            let n = *n as usize;
            let seen = window.seen[n];
            buffers.weight[n] =
                if seen.is_nan() { 0.0 } else { 1.0 / self.noise_at(window, n).variance(window.light[n]) };
            buffers.pull[n] = 0.0;
        }
    }

    /// Fits a group whose images are known. The window holds the light of all others.
    ///
    /// Particles that a step hardly moves are left alone from then on, as long as the others are few: a fit of a tile
    /// ends with the few that are slow.
    pub(super) fn joint(
        &self,
        window: &mut Window,
        spots: &[Spot],
        images: Vec<SpotImage>,
        ends: Ends,
        buffers: &mut Buffers,
    ) -> Fitted {
        self.joint_from(window, Start { spots: spots.to_vec(), images, damping: DAMPING }, ends, buffers)
    }

    fn joint_from(&self, window: &mut Window, start: Start, ends: Ends, buffers: &mut Buffers) -> Fitted {
        let Start { mut spots, mut images, mut damping } = start;
        let mut is_busy = vec![true; spots.len()];
        buffers.fit(window.seen.len());
        buffers.paint(images.iter(), window.columns);
        let mut deviance = self.painted_deviance(window, buffers);
        let mut is_weighed = false;
        let mut normal = Normal::default();
        let mut is_stale = true;
        for n in 0..ends.steps {
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
                is_busy = normal.gradient.iter().zip(&step).map(|(g, s)| fall(g, s) > BUSY).collect();
                if gain < ends.gain {
                    break;
                }
                let busy = is_busy.iter().filter(|is_busy| **is_busy).count();
                if (busy as f64) < FEW * spots.len() as f64 {
                    buffers.wipe();
                    let left = Ends { steps: ends.steps - n - 1, gain: ends.gain * busy as f64 / spots.len() as f64 };
                    let fitted = Fitted { spots, images, deviance, is_busy };
                    return self.joint_of_few(window, fitted, (left, damping), buffers);
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
        Fitted { spots, images, deviance, is_busy }
    }

    /// Goes on with a fit of the busy particles, the others held.
    fn joint_of_few(
        &self,
        window: &mut Window,
        mut fitted: Fitted,
        (left, damping): (Ends, f64),
        buffers: &mut Buffers,
    ) -> Fitted {
        if left.steps == 0 || !fitted.is_busy.contains(&true) {
            return fitted;
        }
        let is_busy = fitted.is_busy.clone();
        let hold = |images: &[SpotImage], window: &mut Window, sign: f32| {
            let quiet = images.iter().zip(&is_busy).filter(|(_, is_busy)| !**is_busy);
            quiet.for_each(|(image, _)| image.add_to(&mut window.light, window.columns, sign));
        };
        let busy: Vec<usize> = (0..is_busy.len()).filter(|n| is_busy[*n]).collect();
        hold(&fitted.images, window, 1.0);
        let spots = busy.iter().map(|n| fitted.spots[*n]).collect();
        let images: Vec<SpotImage> = busy.iter().map(|n| std::mem::take(&mut fitted.images[*n])).collect();
        let before = self.deviance(window, images.iter(), buffers);
        let few = self.joint_from(window, Start { spots, images, damping }, left, buffers);
        fitted.deviance -= before - few.deviance;
        for (k, (spot, image)) in few.spots.into_iter().zip(few.images).enumerate() {
            let n = busy[k];
            (fitted.spots[n], fitted.images[n], fitted.is_busy[n]) = (spot, image, few.is_busy[k]);
        }
        hold(&fitted.images, window, -1.0);
        fitted
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
