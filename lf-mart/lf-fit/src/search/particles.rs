//! All particles of a frame, and work on them tile by tile: those of a tile are fitted together, the others held.

use super::summed::{Difference, Summed};
use super::tiles::{Tile, TilePlan, Tiling};
use crate::cameras::view::{CameraView, Cameras};
use crate::model::buffers::FitBuffers;
use crate::model::particle_image::{COUNTS, ParticleImage};
use crate::model::window::Window;
use crate::particle::Particle;
use crate::solve::joint::StopRule;
use crate::solve::size::SizeSpread;
use lf_core::Refusal;
use lf_core::particle_image::{ParticleModel, Scratch};
use lf_core::statistics::upper_median;
use rayon::prelude::*;

/// The numbers of the particles of all tiles, seen from one tile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Members<'a> {
    pub(crate) tiles: &'a [Tile],
    pub(crate) lists: &'a [Vec<usize>],
    /// The number of the tile.
    pub(crate) own: usize,
}

impl<'a> Members<'a> {
    /// The tile's own.
    pub(crate) fn own(&self) -> &'a [usize] {
        &self.lists[self.own]
    }

    /// Its own and those of its neighbours, rising; the flag marks its own.
    pub(crate) fn about(&self) -> Vec<(usize, bool)> {
        let mut about = Vec::new();
        for (n, tile) in self.tiles.iter().enumerate() {
            if tile.meets(&self.tiles[self.own]) {
                about.extend(self.lists[n].iter().map(|member| (*member, n == self.own)));
            }
        }
        about.sort_unstable();
        about
    }
}

/// The particles and the cameras that see them.
#[derive(Debug, Clone)]
pub(crate) struct Particles<'a> {
    pub(crate) cameras: Cameras<'a>,
    pub(crate) list: Vec<Particle>,
    /// Whether a particle stayed whole when it was tried to be two.
    pub(crate) is_whole: Vec<bool>,
    /// Whether a round works on a particle: the last one still moved it, or changed something near it.
    pub(crate) is_awake: Vec<bool>,
    /// Pixels of the focal plane within which a change wakes particles.
    pub(crate) beside_px: f64,
    /// Largest distance of a lit pixel from the particle's chief ray, pixels.
    pub(crate) reach_px: usize,
    /// How the sizes of particles spread; None if all may be of one size.
    pub(crate) size_spread: Option<SizeSpread>,
    /// The particles whose waves the cameras hold.
    pub(crate) summed: Summed,
}

/// Tiles that are rendered before their light is added up; bounds the memory.
pub(crate) const AT_ONCE: usize = 16;
/// A change wakes particles within this number of lenslets.
const WAKES: f64 = 2.0;
/// Particles may grow to this many times their first size.
const GROWTH: f64 = 3.0;
/// Step of the Z-order curve along which first particles are sorted, px.
const CURVE_PX: f64 = 8.0;
/// Smallest factor by which a round of sharing changes the light.
const LEAST_FACTOR: f64 = 1e-6;

/// Largest distance from a particle's chief ray to a pixel that it lights, pixels.
fn reach_px(view: &CameraView) -> Result<usize, Refusal> {
    let wide = ParticleModel::new(view.camera, GROWTH * view.shape.sigma_px * view.pixel_mm, view.depth_mm)?;
    Ok(view.depth_mm.into_iter().fold(0f64, |reach, z| reach.max(wide.reach_px(z))).ceil() as usize)
}

/// The number of a place along a Z-order curve over the sensor.
fn along_z_curve(place_px: [f64; 2]) -> u32 {
    let [x, y] = place_px.map(|px| (px.max(0.0) / CURVE_PX) as u32);
    (0..16).fold(0, |key, bit| key | (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1))
}

impl<'a> Particles<'a> {
    /// Particles without light on the sensors yet: see [`Particles::render`].
    pub(crate) fn new(cameras: Cameras<'a>, mut list: Vec<Particle>) -> Result<Self, Refusal> {
        let reach_px = reach_px(cameras.first())?;
        let model = &cameras.first().model;
        list.sort_by_cached_key(|particle| along_z_curve(model.chief_px(particle.place_mm)));
        let beside_px = WAKES * cameras.first().camera.pitch_px();
        let mut particles = Self {
            cameras,
            list: Vec::new(),
            is_whole: Vec::new(),
            is_awake: Vec::new(),
            beside_px,
            reach_px,
            size_spread: None,
            summed: Summed::default(),
        };
        particles.set(list);
        Ok(particles)
    }

    /// Takes other particles. All are awake.
    pub(crate) fn set(&mut self, list: Vec<Particle>) {
        (self.is_whole, self.is_awake) = (vec![false; list.len()], vec![true; list.len()]);
        self.list = list;
    }

    /// The tiles of the first sensor.
    pub(crate) fn tiling(&self) -> Tiling {
        Tiling::new(self.cameras.first().size(), self.reach_px)
    }

    pub(crate) fn plan(&self) -> TilePlan {
        self.tiling().plan(&self.cameras, &self.list)
    }

    /// The numbers of the particles of each tile.
    fn members(&self) -> Vec<Vec<usize>> {
        self.tiling().members(&self.cameras, &self.list)
    }

    /// Lights of the particles before the sensor; of all if none is. Those beside it may have any light.
    fn lights(&self) -> Vec<f64> {
        let view = self.cameras.first();
        let is_before = |particle: &&Particle| {
            let place = view.model.chief_px(particle.place_mm);
            place.iter().zip(view.size()).all(|(place, size)| (0.0..size as f64).contains(place))
        };
        let before: Vec<f64> = self.list.iter().filter(is_before).map(|particle| particle.light).collect();
        if before.is_empty() { self.list.iter().map(|particle| particle.light).collect() } else { before }
    }

    /// Median light.
    pub(crate) fn usual_light(&self) -> f64 {
        upper_median(&mut self.lights()).unwrap_or(0.0)
    }

    /// The light of the particle that half of all light is brighter than. Many faint particles do not move it.
    pub(crate) fn weighty_light(&self) -> f64 {
        let mut lights = self.lights();
        lights.sort_by(|a, b| b.total_cmp(a));
        let half = 0.5 * lights.iter().sum::<f64>();
        let mut sum = 0.0;
        let reached = lights.iter().find(|light| {
            sum += **light;
            sum >= half
        });
        reached.copied().unwrap_or(0.0)
    }

    /// Drops the particles with less than this share of the light above which half of all light is.
    pub(crate) fn drop_faint(&mut self, share: f64) {
        let least = share * self.weighty_light();
        self.set(self.list.iter().filter(|particle| particle.light > least).copied().collect());
    }

    /// Renders all particles anew.
    pub(crate) fn render(&mut self) {
        self.cameras.views.iter_mut().for_each(CameraView::darken);
        let list = self.list.clone();
        self.draw(&list, |cameras, particle, window, scratch| {
            let image = ParticleImage::light(cameras, particle, window, scratch);
            image.add_to(&mut window.light, window.columns, 1.0);
        });
        self.hold();
    }

    /// Finds anew the light that passes hold.
    fn hold(&mut self) {
        self.cameras.views.iter_mut().for_each(CameraView::take_far);
        if self.cameras.views.iter().any(|view| view.model.follows_waves()) {
            let shape = self.cameras.first().shape;
            let Difference { is_anew, particles } = self.summed.follow(&self.list, shape, self.cameras.pixel_mm());
            self.cameras.views.iter_mut().for_each(|view| view.put_aside(is_anew));
            self.draw(&particles, ParticleImage::add_rest);
            self.cameras.views.iter_mut().for_each(CameraView::take_back);
        }
        self.cameras.views.iter_mut().for_each(CameraView::spread_far);
    }

    /// Adds to the expected counts what `draw` adds to a window for each particle of a list.
    fn draw(&mut self, list: &[Particle], draw: impl Fn(&Cameras, &Particle, &mut Window, &mut Scratch) + Sync) {
        let TilePlan { windows, members, .. } = self.tiling().plan(&self.cameras, list);
        let tasks: Vec<_> = windows.iter().zip(&members).collect();
        for tasks in tasks.chunks(AT_ONCE) {
            let rendered: Vec<Window> = tasks
                .par_iter()
                .map_init(FitBuffers::default, |buffers, (rectangles, members)| {
                    let mut window = Window::cut(&self.cameras.views, rectangles);
                    window.light.fill(0.0);
                    for n in *members {
                        draw(&self.cameras, &list[*n], &mut window, &mut buffers.scratch);
                    }
                    window
                })
                .collect();
            for window in &rendered {
                window.onto(&mut self.cameras.views, |sum, more| {
                    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
                });
            }
        }
    }

    /// Wakes the particles for which this holds, and lets the others sleep.
    pub(crate) fn wake_where(&mut self, is_wanted: impl Fn(&Particle) -> bool) {
        self.is_awake = self.list.iter().map(is_wanted).collect();
    }

    /// Wakes the particles near places, which are listed by tile.
    pub(crate) fn wake_near(&mut self, places: &[Vec<[f64; 3]>]) {
        let (tiles, members) = (self.tiling().tiles(), self.members());
        let near = |own: usize| -> Vec<usize> {
            let about = tiles.iter().zip(places).filter(|(tile, _)| tile.meets(&tiles[own]));
            let about: Vec<[f64; 3]> = about.flat_map(|(_, places)| places.iter().copied()).collect();
            let is_near = |n: &usize| {
                about.iter().any(|place| self.cameras.is_beside(self.list[*n].place_mm, *place, self.beside_px))
            };
            members[own].iter().copied().filter(is_near).collect()
        };
        let woken: Vec<Vec<usize>> = (0..tiles.len()).into_par_iter().map(near).collect();
        woken.into_iter().flatten().for_each(|n| self.is_awake[n] = true);
    }

    /// The tiles in which a particle is awake.
    pub(crate) fn tiles_awake(&self) -> Vec<bool> {
        self.members().iter().map(|members| members.iter().any(|n| self.is_awake[*n])).collect()
    }

    /// Runs `work` on the wanted tiles, colour by colour, and takes the light that it leaves in the windows. `work`
    /// gets a window, its tile and the tile's particles; `done` gets the number of the tile and the result.
    pub(crate) fn each_tile<T: Send>(
        &mut self,
        is_wanted: impl Fn(usize) -> bool,
        work: impl Fn(&Self, &mut Window, &Tile, Members, &mut FitBuffers) -> T + Sync,
        mut done: impl FnMut(&mut Self, usize, T),
    ) {
        let TilePlan { tiles, windows, colours, .. } = self.plan();
        for colour in 0..=colours.iter().copied().max().unwrap_or(0) {
            let members = self.members();
            let is_asked = |n: &usize| colours[*n] == colour && !members[*n].is_empty() && is_wanted(*n);
            let tasks: Vec<usize> = (0..tiles.len()).filter(is_asked).collect();
            for tasks in tasks.chunks(AT_ONCE) {
                let buffers = || FitBuffers::beside(tasks.len());
                let results: Vec<(Window, T)> = tasks
                    .par_iter()
                    .map_init(buffers, |buffers, n| {
                        let mut window = Window::cut(&self.cameras.views, &windows[*n]);
                        let members = Members { tiles: &tiles, lists: &members, own: *n };
                        let result = work(self, &mut window, &tiles[*n], members, buffers);
                        (window, result)
                    })
                    .collect();
                for (n, (window, result)) in tasks.iter().zip(results) {
                    window.onto(&mut self.cameras.views, |sensor, line| sensor.copy_from_slice(line));
                    done(self, *n, result);
                }
            }
        }
        self.hold();
    }

    /// Fits all particles once. Returns the fall of -2 log L.
    pub(crate) fn sweep(&mut self, rule: StopRule) -> f64 {
        let mut total = 0.0;
        let work = |own: &Self, window: &mut Window, _: &Tile, members: Members, buffers: &mut FitBuffers| {
            let (particles, images) = own.rendered(members, window, buffers, ParticleImage::new);
            images.iter().for_each(|image| image.add_to(&mut window.light, window.columns, -1.0));
            let before = own.cameras.deviance(window, images.iter(), buffers);
            let rule = rule.times(particles.len());
            let fitted = own.cameras.joint(window, &particles, images, rule, buffers);
            fitted.images.iter().for_each(|image| image.add_to(&mut window.light, window.columns, 1.0));
            (before - fitted.deviance, members.own().to_vec(), fitted.particles)
        };
        self.each_tile(
            |_| true,
            work,
            |own, _, (gain, members, particles)| {
                total += gain;
                members.iter().zip(particles).for_each(|(n, particle)| own.list[*n] = particle);
            },
        );
        total
    }

    /// The particles of a tile and their images.
    fn rendered(
        &self,
        members: Members,
        window: &Window,
        buffers: &mut FitBuffers,
        render: impl Fn(&Cameras, &Particle, &Window, &mut Scratch) -> ParticleImage + Send + Sync,
    ) -> (Vec<Particle>, Vec<ParticleImage>) {
        let particles: Vec<Particle> = members.own().iter().map(|n| self.list[*n]).collect();
        let draw = |scratch: &mut _, particle: &_| render(&self.cameras, particle, window, scratch);
        let images = buffers.draw(&particles, draw);
        (particles, images)
    }

    /// Finds the light of all particles, places held, by expectation maximisation. Those left with no more than `least`
    /// lose it.
    pub(crate) fn share_light(&mut self, rounds: usize, least: f64) {
        let floor = |view: &CameraView| view.noise.read_variance.sqrt().max(view.noise.gain) as f32;
        let floors: Vec<f32> = self.cameras.views.iter().map(floor).collect();
        let work = |own: &Self, window: &mut Window, _: &Tile, members: Members, buffers: &mut FitBuffers| {
            let (mut particles, mut images) = own.rendered(members, window, buffers, ParticleImage::light);
            for _ in 0..rounds {
                let ratio = |(n, (seen, light)): (usize, (&f32, &f32))| {
                    let floor = floors[window.camera_of(n)];
                    if seen.is_nan() { 1.0 } else { seen.max(0.0) / (light + floor) }
                };
                let ratios: Vec<f32> = window.seen.iter().zip(&window.light).enumerate().map(ratio).collect();
                for (particle, image) in particles.iter_mut().zip(&mut images) {
                    let (mut sum, mut whole) = (0.0, 0.0);
                    image.pixels(window.columns, |n, pixel| {
                        sum += f64::from(pixel[COUNTS] * ratios[n]);
                        whole += f64::from(pixel[COUNTS]);
                    });
                    let factor = if whole > 0.0 { (sum / whole).max(LEAST_FACTOR) } else { LEAST_FACTOR };
                    particle.light *= factor;
                    image.add_to(&mut window.light, window.columns, factor as f32 - 1.0);
                    image.scale(factor as f32);
                }
            }
            for (particle, image) in particles.iter_mut().zip(&images).filter(|(particle, _)| particle.light <= least) {
                particle.light = 0.0;
                image.add_to(&mut window.light, window.columns, -1.0);
            }
            (members.own().to_vec(), particles)
        };
        self.each_tile(
            |_| true,
            work,
            |own, _, (members, particles)| {
                members.iter().zip(particles).for_each(|(n, particle)| own.list[*n] = particle);
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_through_quadrants_by_hand() {
        let places = [[0.0, 0.0], [9.0, 0.0], [0.0, 9.0], [9.0, 15.9], [16.0, 0.0], [0.0, 16.0], [-3.0, 1.0]];
        assert_eq!(places.map(along_z_curve), [0, 1, 2, 3, 4, 8, 0]);
    }
}
