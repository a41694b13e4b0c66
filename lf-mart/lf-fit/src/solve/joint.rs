//! Levenberg-Marquardt on the places and lights of a group of particles in a window. The other particles are held.

use super::normal::{FINE, Normal, conjugate_gradients};
use crate::cameras::noise::{LANES, Lanes, Noise};
use crate::cameras::view::Cameras;
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{ParticleImage, UNKNOWNS};
use crate::model::window::Window;
use crate::particle::Particle;
use lf_core::particle_image::Scratch;
use lf_core::simd::fastest;
use std::borrow::Cow;

/// When a fit ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StopRule {
    /// Largest number of steps.
    pub(crate) steps: usize,
    /// A step that lowers -2 log L by less is the last.
    pub(crate) gain: f64,
}

impl StopRule {
    /// The rule for this number of particles, from the rule for one.
    pub(crate) fn times(self, particles: usize) -> Self {
        Self { gain: self.gain * particles as f64, ..self }
    }
}

/// A fitted group.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub(crate) particles: Vec<Particle>,
    pub(crate) images: Vec<ParticleImage>,
    /// -2 log L minus that of the window without the group.
    pub(crate) deviance: f64,
    /// Whether the last step that was taken still moved a particle.
    pub(crate) is_busy: Vec<bool>,
}

/// Where a fit begins.
struct Start {
    particles: Vec<Particle>,
    images: Vec<ParticleImage>,
    damping: f64,
}

/// A particle is busy if its part in a step lowers -2 log L by more than this. Less moves it by a tenth of its
/// uncertainty.
const BUSY: f64 = 0.01;
/// Busy particles go on without the others if they are less than this share.
const FEW: f64 = 0.6;

/// Fall of -2 log L by the part that one particle has in a step.
fn fall(gradient: &[f64; UNKNOWNS], step: &[f64; UNKNOWNS]) -> f64 {
    gradient.iter().zip(step).map(|(gradient, step)| gradient * step).sum()
}

/// Damping: its start, its change after a good and after a bad step, and where it ends.
pub(crate) const DAMPING: f64 = 0.01;
pub(crate) const LESS: f64 = 0.2;
pub(crate) const MORE: f64 = 8.0;
pub(crate) const LEAST_DAMPING: f64 = 1e-6;
const MOST_DAMPING: f64 = 1e4;
/// Blocks serve another step after one that lowered -2 log L by less than this for each particle.
const STALE: f64 = 0.3;
/// Longest step sideways and along z, pixels of the focal plane.
const SIDEWAYS: f64 = 1.0;
const ALONG_Z: f64 = 20.0;
/// Range of the factor by which a step changes the light.
const LIGHT_FACTORS: [f64; 2] = [0.3, 3.0];
/// An image is rendered again if a ray has moved by more than this, pixels on the array. Below, the derivatives give
/// the light to the square of this, a ten-thousandth.
const NEAR: f64 = 0.015;

impl Cameras<'_> {
    /// The image of a particle near the place where `image` was rendered. Takes the derivatives if that is near enough.
    fn image_after(
        &self,
        particle: &Particle,
        image: &ParticleImage,
        window: &Window,
        scratch: &mut Scratch,
    ) -> ParticleImage {
        let from = &image.rendered;
        let step_mm: [f64; 3] = std::array::from_fn(|k| particle.place_mm[k] - from.place_mm[k]);
        if self.views.iter().any(|view| view.moved_px(step_mm) > NEAR) {
            return ParticleImage::new(self, particle, window, scratch);
        }
        image.moved(particle, step_mm.map(|step| step / self.pixel_mm()))
    }

    /// -2 log L of a window with the images, minus that without them.
    pub(crate) fn deviance<'i>(
        &self,
        window: &Window,
        images: impl Iterator<Item = &'i ParticleImage>,
        buffers: &mut FitBuffers,
    ) -> f64 {
        buffers.fit(window.seen.len());
        buffers.paint(images, window.columns);
        let sum = self.painted_deviance(window, buffers);
        buffers.wipe();
        sum
    }

    fn painted_deviance(&self, window: &Window, buffers: &FitBuffers) -> f64 {
        let of_camera = |camera: usize| {
            let is_own = |n: &u32| window.camera_of(*n as usize) == camera;
            let own: Cow<[u32]> = match window.parts.len() {
                1 => Cow::Borrowed(&buffers.touched),
                _ => buffers.touched.iter().copied().filter(is_own).collect(),
            };
            Self::deviance_of(&self.views[camera].noise, &own, window, buffers)
        };
        (0..window.parts.len()).map(of_camera).sum()
    }

    /// -2 log L of painted pixels of one camera.
    fn deviance_of(noise: &Noise, touched: &[u32], window: &Window, buffers: &FitBuffers) -> f64 {
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

    /// Fills weights and residuals at the painted pixels of a window that lacks the light of the images.
    pub(crate) fn weigh(&self, window: &Window, buffers: &mut FitBuffers) {
        self.weigh_with(window, buffers, |n, own| window.light[n] + own);
    }

    /// Fills weights and residuals at the painted pixels of a window that holds all light.
    pub(crate) fn weigh_whole(&self, window: &Window, buffers: &mut FitBuffers) {
        self.weigh_with(window, buffers, |n, _| window.light[n]);
    }

    #[inline(always)]
    fn weigh_with(&self, window: &Window, buffers: &mut FitBuffers, expected: impl Fn(usize, f32) -> f32) {
        for n in &buffers.touched {
            let n = *n as usize;
            let expected = expected(n, buffers.own[n]);
            let seen = window.seen[n];
            let weight = if seen.is_nan() { 0.0 } else { 1.0 / window.noise(self, n).variance(expected) };
            buffers.weight[n] = weight;
            buffers.residual[n] = if seen.is_nan() { 0.0 } else { weight * (seen - expected) };
        }
    }

    /// Fits a group whose images are known. The window holds the light of all others.
    ///
    /// When few particles still move, the others are held from then on: a fit of a tile ends with the few slow ones.
    pub(crate) fn joint(
        &self,
        window: &mut Window,
        particles: &[Particle],
        images: Vec<ParticleImage>,
        rule: StopRule,
        buffers: &mut FitBuffers,
    ) -> Fitted {
        self.joint_from(window, Start { particles: particles.to_vec(), images, damping: DAMPING }, rule, buffers)
    }

    fn joint_from(&self, window: &mut Window, start: Start, rule: StopRule, buffers: &mut FitBuffers) -> Fitted {
        // Compare the image with the light that the particles have at the start.
        let Start { mut particles, mut images, mut damping } = start;
        let mut is_busy = vec![true; particles.len()];
        buffers.fit(window.seen.len());
        buffers.paint(images.iter(), window.columns);
        let mut deviance = self.painted_deviance(window, buffers);
        let mut is_weighed = false;
        let mut normal = Normal::default();
        let mut is_stale = true;
        for n in 0..rule.steps {
            // Set up the normal equations, or the gradient alone after a small step.
            if !is_weighed {
                self.weigh(window, buffers);
                if is_stale {
                    normal = Normal::new(images.iter(), window.columns, buffers);
                } else {
                    normal.set_gradient(images.iter(), window.columns, buffers);
                }
                is_weighed = true;
            }
            // Solve for a step, take it, and compare again.
            let step = conjugate_gradients(&normal, &normal.gradient, damping, FINE);
            buffers.wipe();
            let next: Vec<Particle> =
                particles.iter().zip(&step).map(|(particle, step)| self.moved(particle, step)).collect();
            let (shown, pairs): (&Window, Vec<_>) = (window, next.iter().zip(&images).collect());
            let next_images = buffers.draw(&pairs, |scratch, (particle, image): &(&Particle, &ParticleImage)| {
                self.image_after(particle, image, shown, scratch)
            });
            buffers.paint(next_images.iter(), window.columns);
            let reached = self.painted_deviance(window, buffers);
            // Keep a step that helps. Otherwise, try a shorter one.
            if reached < deviance {
                let gain = deviance - reached;
                (particles, images, deviance) = (next, next_images, reached);
                damping = (damping * LESS).max(LEAST_DAMPING);
                is_weighed = false;
                is_stale = gain > STALE * particles.len() as f64;
                is_busy = normal.gradient.iter().zip(&step).map(|(g, s)| fall(g, s) > BUSY).collect();
                if gain < rule.gain {
                    break;
                }
                // Go on with the few particles that still move.
                let busy = is_busy.iter().filter(|is_busy| **is_busy).count();
                if (busy as f64) < FEW * particles.len() as f64 {
                    buffers.wipe();
                    let left =
                        StopRule { steps: rule.steps - n - 1, gain: rule.gain * busy as f64 / particles.len() as f64 };
                    let fitted = Fitted { particles, images, deviance, is_busy };
                    return self.joint_of_few(window, fitted, left, damping, buffers);
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
        Fitted { particles, images, deviance, is_busy }
    }

    /// Goes on with a fit of the busy particles, the others held.
    fn joint_of_few(
        &self,
        window: &mut Window,
        mut fitted: Fitted,
        left: StopRule,
        damping: f64,
        buffers: &mut FitBuffers,
    ) -> Fitted {
        if left.steps == 0 || !fitted.is_busy.contains(&true) {
            return fitted;
        }
        let is_busy = fitted.is_busy.clone();
        let hold = |images: &[ParticleImage], window: &mut Window, sign: f32| {
            let quiet = images.iter().zip(&is_busy).filter(|(_, is_busy)| !**is_busy);
            quiet.for_each(|(image, _)| image.add_to(&mut window.light, window.columns, sign));
        };
        let busy: Vec<usize> = (0..is_busy.len()).filter(|n| is_busy[*n]).collect();
        hold(&fitted.images, window, 1.0);
        let particles = busy.iter().map(|n| fitted.particles[*n]).collect();
        let images: Vec<ParticleImage> = busy.iter().map(|n| std::mem::take(&mut fitted.images[*n])).collect();
        let before = self.deviance(window, images.iter(), buffers);
        let few = self.joint_from(window, Start { particles, images, damping }, left, buffers);
        fitted.deviance -= before - few.deviance;
        for (k, (particle, image)) in few.particles.into_iter().zip(few.images).enumerate() {
            let n = busy[k];
            (fitted.particles[n], fitted.images[n], fitted.is_busy[n]) = (particle, image, few.is_busy[k]);
        }
        hold(&fitted.images, window, -1.0);
        fitted
    }

    /// A particle after a step. Step and depth are held within bounds.
    pub(crate) fn moved(&self, particle: &Particle, step: &[f64; UNKNOWNS]) -> Particle {
        let [x, y, z] = particle.place_mm;
        let ([low, high], pixel_mm) = (self.first().depth_mm, self.pixel_mm());
        let aside = |step: f64| pixel_mm * step.clamp(-SIDEWAYS, SIDEWAYS);
        let z = z + pixel_mm * step[2].clamp(-ALONG_Z, ALONG_Z);
        let factor = (1.0 + step[3]).clamp(LIGHT_FACTORS[0], LIGHT_FACTORS[1]);
        Particle {
            place_mm: [x + aside(step[0]), y + aside(step[1]), z.clamp(low, high)],
            light: particle.light * factor,
            ..*particle
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::view::tests::{ASIDE, NOISE, PIXEL_MM, Sight, numbers, view, whole};
    use crate::model::particle_image::COUNTS;
    use crate::solve::covariance::{Prior, covariance};
    use crate::solve::normal::cholesky;
    use lf_core::camera::Pose;
    use lf_core::linear::{inverse_column, solve};

    const SIZE: usize = 3 * UNKNOWNS;

    fn light(cameras: &Cameras, particles: &[Particle], window: &Window) -> Vec<f64> {
        let mut sum = vec![0.0; window.seen.len()];
        for particle in particles {
            numbers(cameras, particle, window).iter().zip(&mut sum).for_each(|(pixel, sum)| *sum += pixel[COUNTS]);
        }
        sum
    }

    fn moved(particles: &[Particle], n: usize, by: f64) -> Vec<Particle> {
        let mut particles = particles.to_vec();
        match n % UNKNOWNS {
            3 => particles[n / UNKNOWNS].light *= by.exp(),
            axis => particles[n / UNKNOWNS].place_mm[axis] += by * PIXEL_MM,
        }
        particles
    }

    /// Derivatives by differences, and the dense normal equations: matrix and right side.
    fn dense(cameras: &Cameras, particles: &[Particle], window: &Window) -> (Vec<f64>, Vec<f64>) {
        let now = light(cameras, particles, window);
        let slopes: Vec<Vec<f64>> = (0..SIZE)
            .map(|n| {
                let step = if n % UNKNOWNS == 3 { 1e-3 } else { 0.02 };
                let (before, after) = (
                    light(cameras, &moved(particles, n, -step), window),
                    light(cameras, &moved(particles, n, step), window),
                );
                after.iter().zip(&before).map(|(after, before)| (after - before) / (2.0 * step)).collect()
            })
            .collect();
        let seen: Vec<usize> = (0..now.len()).filter(|n| !window.seen[*n].is_nan()).collect();
        let weight = |n: usize| 1.0 / (NOISE.gain * now[n] + NOISE.read_variance);
        let sum = |a: usize, with: &dyn Fn(usize) -> f64| -> f64 {
            seen.iter().map(|n| weight(*n) * slopes[a][*n] * with(*n)).sum()
        };
        let matrix = (0..SIZE * SIZE).map(|n| sum(n / SIZE, &|pixel| slopes[n % SIZE][pixel])).collect();
        let right = (0..SIZE).map(|a| sum(a, &|pixel| f64::from(window.seen[pixel]) - now[pixel])).collect();
        (matrix, right)
    }

    /// Three particles that share pixels, before two cameras at 90 degrees. The fit and its covariances agree with slow
    /// dense least squares.
    #[test]
    fn two_cameras_fit_as_dense_least_squares_do() {
        let sights = [Sight::new(20), Sight::new(20)];
        let views = vec![view(&sights[0], Pose::default(), 1.0), view(&sights[1], ASIDE, 0.8)];
        let cameras = Cameras { views };
        let mut window = whole(&cameras);
        let truth = [[0.0, 0.0, 0.5], [0.05, 0.04, 0.45], [-0.06, 0.1, -0.4]];
        let truth = truth.map(|place_mm| Particle::new(place_mm, 1e5));
        let clean = light(&cameras, &truth, &window);
        // Add numbers without a pattern, about as large as the noise.
        for (n, seen) in window.seen.iter_mut().enumerate() {
            let even: f64 = (0..4).map(|k| ((n * 4 + k) as f64 * 0.618_033_988_75).fract() - 0.5).sum();
            *seen += (clean[n] + even * 1.7 * (NOISE.gain * clean[n] + NOISE.read_variance).sqrt()) as f32;
        }
        let start: Vec<Particle> = (0..SIZE).fold(truth.to_vec(), |particles, n| {
            moved(&particles, n, [0.3, -0.2, 0.9, 0.1][n % UNKNOWNS] * [1.0, -1.0, 0.7][n / UNKNOWNS])
        });
        let mut slow = start.clone();
        for _ in 0..8 {
            let (mut matrix, mut right) = dense(&cameras, &slow, &window);
            cholesky(&mut matrix, SIZE);
            solve(&matrix, &mut right);
            slow = (0..SIZE).fold(slow, |particles, n| moved(&particles, n, right[n]));
        }
        let mut buffers = FitBuffers::default();
        let images: Vec<ParticleImage> = start
            .iter()
            .map(|particle| ParticleImage::new(&cameras, particle, &window, &mut buffers.scratch))
            .collect();
        let rule = StopRule { steps: 40, gain: 1e-9 };
        let fitted = cameras.joint(&mut window, &start, images, rule, &mut buffers);
        for (fast, slow) in fitted.particles.iter().zip(&slow) {
            for k in 0..3 {
                let off = (fast.place_mm[k] - slow.place_mm[k]) / PIXEL_MM;
                assert!(off.abs() < 4e-3, "axis {k}: {off:.1e} px");
            }
            assert!((fast.light / slow.light - 1.0).abs() < 1e-4);
        }
        // Covariances, with a prior too weak to matter.
        fitted.images.iter().for_each(|image| image.add_to(&mut window.light, window.columns, 1.0));
        buffers.paint(fitted.images.iter(), window.columns);
        cameras.weigh_whole(&window, &mut buffers);
        let normal = Normal::new(fitted.images.iter(), window.columns, &mut buffers);
        let found = covariance(&normal, &[1, 0, 2], Prior([1e3; UNKNOWNS]));
        let (mut matrix, _) = dense(&cameras, &slow, &window);
        cholesky(&mut matrix, SIZE);
        for k in 0..UNKNOWNS {
            let wanted = inverse_column(&matrix, SIZE, UNKNOWNS + k)[UNKNOWNS + k];
            assert!((found[k][k] / wanted - 1.0).abs() < 0.02, "unknown {k}: {} for {wanted}", found[k][k]);
        }
    }
}
