//! The way of rays through a camera: aperture, lenslets, stops, blur, pixels.
//!
//! Each step is a loop over a few hundred rays in flight. A step that the scene does not ask for is not run.

use super::aberrations::Aberrations;
use super::coherent::{CoherentLight, Rays};
use super::diffraction::{Diffraction, Pattern};
use super::samples::{Samples, Shape};
use super::second_stop::SecondStop;
use super::sources::{Glow, WhiteCells};
use super::tally::{LEAST_SHARE, Tally};
use super::thick_lens::{LensRay, ThickLens, TracedLens, WIDER};
use crate::{particles::Particle, random::stream};
use glam::DVec2;
use lf_core::{Camera, Optics, camera::Disc, frame::sensor_axes};

/// A camera with the effects that bend or stop its rays.
#[derive(Debug)]
pub struct Instrument {
    /// Without aberrations.
    optics: Optics,
    aberrations: Option<Aberrations>,
    pub(super) aperture: Shape,
    second_stop: Option<SecondStop>,
    /// Light passes inside the discs of all blades, mm in the aperture.
    blades: Vec<Disc>,
    thick_lens: Option<TracedLens>,
    /// Blur of white light.
    blur: Option<Pattern>,
    /// Particles are drawn in coherent light.
    coherent: Option<CoherentLight>,
    /// Width and height of the sensor, px.
    pub(super) size: [usize; 2],
    pixel_pitch_mm: f64,
    /// Width of a lenslet and reach of the blur, px.
    margin_px: f64,
}

/// Rays in flight at a time. Their arrays stay in the nearest cache.
const FLIGHT: usize = 256;

const ZERO: [f64; FLIGHT] = [0.0; FLIGHT];

/// Rays in flight, mm.
struct Flight {
    /// Place in the aperture.
    u: [f64; FLIGHT],
    v: [f64; FLIGHT],
    /// Place on the object, then on the array, then on the sensor.
    x: [f64; FLIGHT],
    y: [f64; FLIGHT],
    /// Whether a second stop or the lens holds the ray back.
    blocked: [bool; FLIGHT],
    /// Pixel, counted from the corner of the tally.
    column: [i32; FLIGHT],
    row: [i32; FLIGHT],
}

impl Flight {
    const START: Self =
        Self { u: ZERO, v: ZERO, x: ZERO, y: ZERO, blocked: [false; FLIGHT], column: [0; FLIGHT], row: [0; FLIGHT] };
}

/// Keep the random streams of particles and of white cells apart.
const PARTICLES: u64 = 0x7261_7973;
const WHITE: u64 = 0x7768_6974;

impl Instrument {
    /// The instrument of a checked camera.
    pub fn new(camera: &Camera, second_stop: Option<SecondStop>, diffraction: Option<&Diffraction>) -> Self {
        let camera = &diffraction.map_or_else(|| camera.clone(), |diffraction| diffraction.of(camera));
        let blur = Pattern::new(camera);
        let reach_mm = blur.as_ref().map_or(0.0, |pattern| pattern.reach_mm);
        let optics = Optics::new(&Camera { aberrations: None, ..camera.clone() });
        let blades = camera.blades.iter().flat_map(|blades| blades.aperture_discs(optics.half_aperture_mm));
        Self {
            blades: blades.collect(),
            optics,
            aberrations: Aberrations::new(camera),
            aperture: camera.main_lens.aperture.into(),
            second_stop,
            thick_lens: None,
            coherent: None,
            blur,
            size: [camera.sensor.width, camera.sensor.height],
            pixel_pitch_mm: camera.sensor.pixel_pitch_mm,
            margin_px: camera.pitch_px() + reach_mm / camera.sensor.pixel_pitch_mm + 2.0,
        }
    }

    /// The instrument with a lens by its surfaces, whose camera [`ThickLens::camera`] made.
    pub fn with_lens(self, lens: Option<&ThickLens>, camera: &Camera) -> Self {
        Self { thick_lens: lens.map(|lens| TracedLens::new(lens, camera)), ..self }
    }

    /// An instrument that draws the light of a particle as one wave in the stop and the lenslets.
    pub fn in_coherent_light(self, camera: &Camera, diffraction: Option<&Diffraction>) -> Self {
        let camera = &diffraction.map_or_else(|| camera.clone(), |diffraction| diffraction.of(camera));
        Self { coherent: CoherentLight::new(camera), ..self }
    }

    /// Draws a particle in coherent light. Returns false, and draws nothing, where it is not asked for or not known.
    fn draw_coherent(
        &self,
        glow: &Glow,
        particle: &Particle,
        (low, high): ([f64; 2], [f64; 2]),
        tally: &mut Tally,
    ) -> bool {
        let Some(coherent) = &self.coherent else { return false };
        tally.clear(low, high, self.size, LEAST_SHARE * particle.intensity);
        let (point, z_mm) = (particle.place_mm.truncate(), particle.place_mm.z);
        let spread = if glow.shape == Shape::Gaussian { 1.0 } else { 0.5 };
        let half_mm = self.optics.half_aperture_mm;
        let rays = Rays {
            ray: &|place: DVec2| self.ray(point, z_mm, place),
            passes: &|array: DVec2, stop: DVec2| {
                let is_open = match (&self.thick_lens, self.aperture) {
                    (Some(lens), _) => lens.lets_through(array, stop),
                    (None, Shape::Disc) => stop.length() < half_mm,
                    (None, _) => stop.abs().max_element() < half_mm,
                };
                is_open && self.passes_stops(array, stop)
            },
            pixel: &|centre: DVec2, array: DVec2, stop: DVec2| {
                self.optics.place_px(self.optics.sensor_through(centre, array, stop))
            },
            half_mm,
            filled: if self.aperture == Shape::Disc { std::f64::consts::FRAC_PI_4 } else { 1.0 },
            sigma_mm: spread * glow.size_mm * particle.size * self.optics.beta(z_mm).abs(),
        };
        let lattice = self.optics.lattice();
        let lenslets = |middle: DVec2, reach_mm: f64| {
            lattice.lenslets_within(middle, DVec2::splat(reach_mm)).map(|(_, _, centre)| centre)
        };
        coherent.draw(&rays, lenslets, tally)
    }

    /// Where the ray of a point through a place of the stop, in half widths, meets the array and the stop, mm. Stops do
    /// not hold it back; None if it misses the lens.
    fn ray(&self, point: DVec2, z_mm: f64, place: DVec2) -> Option<(DVec2, DVec2)> {
        if let Some(lens) = &self.thick_lens {
            let pupil = lens.half_entrance_mm * place;
            let ray = lens.ray_from_object(sensor_axes(point), z_mm, pupil, false)?;
            return Some((ray.array_mm, ray.aperture_mm));
        }
        let stop = self.optics.half_aperture_mm * place;
        Some((self.optics.array_from_object(point, z_mm, stop) + self.aberration_mm(point, z_mm, stop), stop))
    }

    /// Whether a second stop and the blades let light through.
    #[inline(always)]
    fn passes_stops(&self, array: DVec2, aperture: DVec2) -> bool {
        self.second_stop.is_none_or(|stop| stop.passes(&self.optics, array, aperture))
            && self.blades.iter().all(|blade| blade.holds(aperture))
    }

    /// Half width of the area of the stop from which rays are drawn, mm, and the light of a ray over its share of the
    /// stop's.
    fn drawn_mm(&self, half_pupil_mm: f64) -> (f64, f64) {
        if self.thick_lens.is_some() { (WIDER * half_pupil_mm, WIDER * WIDER) } else { (half_pupil_mm, 1.0) }
    }

    /// Pixels of the sensor.
    pub fn pixels(&self) -> f64 {
        self.size.map(|side| side as f64).iter().product()
    }

    /// Pixels of the tally of a particle.
    pub(super) fn tally_px(&self, particle: &Particle, glow: &Glow) -> f64 {
        let [low, high] = self.bounds_px(particle, glow.size_mm * particle.size);
        let side = |axis: usize| {
            let limit = self.size[axis] as f64;
            (high[axis].ceil().clamp(0.0, limit) - low[axis].floor().clamp(0.0, limit)).max(0.0)
        };
        side(0) * side(1)
    }

    /// Bytes of the wave of a particle.
    pub(super) fn wave_bytes(&self, particle: &Particle, glow: &Glow) -> f64 {
        let Some(coherent) = &self.coherent else { return 0.0 };
        let [low, high] = self.bounds_px(particle, glow.size_mm * particle.size);
        let wide_mm = (high[0] - low[0]).max(high[1] - low[1]) * self.pixel_pitch_mm;
        coherent.bytes(wide_mm, self.optics.half_aperture_mm * self.optics.demagnification)
    }

    /// Pixels of the tally of a row of white cells.
    pub(super) fn row_px(&self, cells: &WhiteCells) -> f64 {
        let [width, height] = self.size.map(|side| side as f64);
        width * (2.0 * self.row_reach_px() + cells.cell_mm.y / self.pixel_pitch_mm + 1.0).min(height)
    }

    /// Pixels that the light of a row of white cells reaches beyond its sides.
    fn row_reach_px(&self) -> f64 {
        self.margin_px + self.optics.half_aperture_mm * self.optics.demagnification / self.pixel_pitch_mm
    }

    /// Casts a particle's rays and counts them in `tally`.
    #[inline(always)]
    pub(super) fn cast(&self, samples: &Samples, glow: &Glow, particle: &Particle, seed: u64, tally: &mut Tally) {
        let rays = glow.rays.of_intensity(particle.intensity);
        let mut random = stream(seed ^ PARTICLES, particle.id);
        let in_aperture = self.aperture.motion(&mut random);
        let in_image = glow.shape.motion(&mut random);
        let start = self.blur.as_ref().map_or(0, |_| Pattern::start(&mut random));
        let (centre, z_mm) = (particle.place_mm.truncate(), particle.place_mm.z);
        let half_pupil = self.thick_lens.as_ref().map_or(self.optics.half_aperture_mm, |lens| lens.half_entrance_mm);
        let ((half, light), size) = (self.drawn_mm(half_pupil), glow.size_mm * particle.size);
        let [low, high] = self.bounds_px(particle, size);
        if self.draw_coherent(glow, particle, (low, high), tally) {
            return;
        }
        tally.clear(low, high, self.size, light * particle.intensity / rays as f64);
        let mut flight = Flight::START;
        for first in (0..rays).step_by(FLIGHT) {
            let n = FLIGHT.min(rays - first);
            let Flight { u, v, x, y, blocked, .. } = &mut flight;
            in_aperture.apply(samples.first(first, n), half, &mut u[..n], &mut v[..n]);
            in_image.apply(samples.second(first, n), size, &mut x[..n], &mut y[..n]);
            if let Some(lens) = &self.thick_lens {
                for i in 0..n {
                    let point = sensor_axes(centre + DVec2::new(x[i], y[i]));
                    let ray = lens.ray_from_object(point, z_mm, DVec2::new(u[i], v[i]), true);
                    blocked[i] = ray.is_none();
                    let LensRay { array_mm, aperture_mm } = ray.unwrap_or_default();
                    [x[i], y[i], u[i], v[i]] = [array_mm.x, array_mm.y, aperture_mm.x, aperture_mm.y];
                }
                self.finish(&mut flight, (n, start + first), tally);
                continue;
            }
            for i in 0..n {
                let (point, aperture) = (centre + DVec2::new(x[i], y[i]), DVec2::new(u[i], v[i]));
                let hit =
                    self.optics.array_from_object(point, z_mm, aperture) + self.aberration_mm(point, z_mm, aperture);
                (x[i], y[i]) = (hit.x, hit.y);
            }
            self.finish(&mut flight, (n, start + first), tally);
        }
    }

    /// The shift of a ray on the array by aberrations, mm.
    #[inline(always)]
    fn aberration_mm(&self, point_mm: DVec2, z_mm: f64, aperture_mm: DVec2) -> DVec2 {
        let Some(aberrations) = &self.aberrations else { return DVec2::ZERO };
        let distorted = self.optics.array_from_object(point_mm, z_mm, DVec2::ZERO);
        aberrations.shift_mm(z_mm, distorted - self.optics.distortion_mm(point_mm, z_mm), aperture_mm)
    }

    /// Casts the rays through one row of white cells and counts them in `tally`.
    #[inline(always)]
    pub(super) fn cast_row(&self, samples: &Samples, cells: &WhiteCells, row: usize, seed: u64, tally: &mut Tally) {
        let (half, light) = self.drawn_mm(self.optics.half_aperture_mm);
        let top_mm = cells.corner_mm.y + row as f64 * cells.cell_mm.y;
        let reach_px = self.row_reach_px();
        let edge_px = |y_mm: f64| self.optics.place_px(DVec2::new(0.0, y_mm)).y;
        let low = [0.0, edge_px(top_mm) - reach_px];
        let high = [self.size[0] as f64, edge_px(top_mm + cells.cell_mm.y) + reach_px];
        tally.clear(low, high, self.size, light * cells.counts_per_cell / cells.rays_per_cell as f64);
        let mut flight = Flight::START;
        for column in 0..cells.columns {
            let mut random = stream(seed ^ WHITE, (row * cells.columns + column) as u64);
            let in_aperture = self.aperture.motion(&mut random);
            let in_cell = Shape::Square.motion(&mut random);
            let start = self.blur.as_ref().map_or(0, |_| Pattern::start(&mut random));
            let centre = cells.corner_mm + cells.cell_mm * DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
            for first in (0..cells.rays_per_cell).step_by(FLIGHT) {
                let n = FLIGHT.min(cells.rays_per_cell - first);
                let Flight { u, v, x, y, blocked, .. } = &mut flight;
                in_aperture.apply(samples.first(first, n), half, &mut u[..n], &mut v[..n]);
                in_cell.apply(samples.second(first, n), 0.5, &mut x[..n], &mut y[..n]);
                for i in 0..n {
                    (x[i], y[i]) = (centre.x + cells.cell_mm.x * x[i], centre.y + cells.cell_mm.y * y[i]);
                }
                if let Some(lens) = &self.thick_lens {
                    for i in 0..n {
                        blocked[i] = !lens.lets_through(DVec2::new(x[i], y[i]), DVec2::new(u[i], v[i]));
                    }
                }
                self.finish(&mut flight, (n, start + first), tally);
            }
        }
    }

    /// Takes rays from the array to the sensor and counts them. `sample` is the number of the first ray.
    #[inline(always)]
    fn finish(&self, flight: &mut Flight, (n, sample): (usize, usize), tally: &mut Tally) {
        let Flight { u, v, x, y, blocked, column, row } = flight;
        let is_cut = self.second_stop.is_some() || !self.blades.is_empty();
        if is_cut {
            for i in 0..n {
                let (array, aperture) = (DVec2::new(x[i], y[i]), DVec2::new(u[i], v[i]));
                blocked[i] = self.thick_lens.is_some() && blocked[i] || !self.passes_stops(array, aperture);
            }
        }
        for i in 0..n {
            let hit = self.optics.sensor_from_array(DVec2::new(x[i], y[i]), DVec2::new(u[i], v[i]));
            (x[i], y[i]) = (hit.x, hit.y);
        }
        if let Some(pattern) = &self.blur {
            pattern.deflect(sample, &mut x[..n], &mut y[..n]);
        }
        let corner = DVec2::new(tally.left as f64, tally.top as f64);
        for i in 0..n {
            let place = (self.optics.place_px(DVec2::new(x[i], y[i])) - corner).floor();
            (column[i], row[i]) = (place.x as i32, place.y as i32);
        }
        if is_cut || self.thick_lens.is_some() {
            for i in 0..n {
                if blocked[i] {
                    column[i] = i32::MIN;
                }
            }
        }
        tally.count(&column[..n], &row[..n], self.size);
    }

    /// Low and high pixel bounds of a particle's image: the rays through the rim of the aperture, and a margin.
    fn bounds_px(&self, particle: &Particle, size_mm: f64) -> [[f64; 2]; 2] {
        const RIM: usize = 12;
        // The circle of 1.5 half sides lies outside the corners of a square stop.
        let radius = if self.aperture == Shape::Disc { 1.0 } else { 1.5 };
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (point, z_mm) = (particle.place_mm.truncate(), particle.place_mm.z);
        for n in 0..RIM {
            let way = radius * DVec2::from_angle(std::f64::consts::TAU * n as f64 / RIM as f64);
            let Some((hit, rim)) = self.ray(point, z_mm, way) else { continue };
            let place = self.optics.place_px(self.optics.sensor_from_array(hit, rim));
            (low, high) = (low.min(place), high.max(place));
        }
        let blur = 5.0 * size_mm * self.optics.beta(particle.place_mm.z).abs() / self.pixel_pitch_mm;
        let coherent = self.coherent.as_ref().map_or(0.0, |light| light.beside_mm() / self.pixel_pitch_mm);
        let margin = self.margin_px + blur + coherent;
        [(low - margin).to_array(), (high + margin).to_array()]
    }
}
