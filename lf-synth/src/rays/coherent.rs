//! Light of one wavelength from a particle, as a wave: through the stop, onto the array, and by each lenslet's cell to
//! the sensor.
//!
//! The stop lets through the wave that rays describe: its phase is the one whose slope takes each place of the stop to
//! the place on the array that the ray there meets. One Fourier transform gives the wave on the array, and one for
//! each lenslet its image. Places in the stop are counted in lambda g / p as they appear on the sensor, and places on
//! the array in pitches p: then waves turn once for a step of one in both.
//!
//! Points of the particle do not interfere, so the images of some of them are added up.

use super::diffraction::hexagon;
use super::tally::Tally;
use glam::{DMat2, DVec2};
use lf_core::camera::Layout;
use lf_core::fourier::smooth_size;
use lf_core::linear::{cholesky, solve};
use lf_core::{Camera, halo::sinc};
use rustfft::{Fft, FftDirection, FftPlanner, num_complex::Complex};
use std::f64::consts::PI;
use std::sync::Arc;

type Number = Complex<f32>;

/// Numbers of a camera that waves need.
#[derive(Debug)]
pub(super) struct CoherentLight {
    pitch_mm: f64,
    /// lambda g / p.
    unit_mm: f64,
    pixel_mm: f64,
    sigma_px: f64,
    layout: Layout,
    turn: DMat2,
}

/// A particle's rays, and what they meet.
pub(super) struct Rays<'a> {
    /// Where a ray from the particle's middle meets the array and the stop, mm, by a place in the unit square of the
    /// stop; None if it misses the lens.
    pub(super) ray: &'a dyn Fn(DVec2) -> Option<(DVec2, DVec2)>,
    /// Whether light passes, by its places on the array and in the stop, mm.
    pub(super) passes: &'a dyn Fn(DVec2, DVec2) -> bool,
    /// Where a ray meets the sensor, px, by the lenslet's middle and the places on the array and in the stop, mm.
    pub(super) pixel: &'a dyn Fn(DVec2, DVec2, DVec2) -> DVec2,
    /// Half width of the stop, and its area over that of the square around it.
    pub(super) half_mm: f64,
    pub(super) filled: f64,
    /// Standard deviation of the particle on the array, mm.
    pub(super) sigma_mm: f64,
}

/// Waves are followed this far beyond the image of the stop, lambda g / p, and beyond the light on the array, pitches.
const BESIDE: f64 = 8.0;
const BESIDE_PITCHES: f64 = 3.0;
/// Rays along each side of the stop by which the phase is found, and its degree.
const RAYS: usize = 13;
const DEGREE: usize = 6;
/// Points of a particle lie at most this far apart and reach this far from its middle, standard deviations. Those with
/// less than the share [`LEAST_POINT`] of the light of the brightest are left out.
const APART: f64 = 1.3;
const FARTHEST: f64 = 3.0;
const LEAST_POINT: f64 = 0.012;
/// Where light on the array reaches less far from the chief ray, pitches, points lie a step apart: waves of the whole
/// stop meet in a lenslet, and turn against each other between points.
const NARROW: f64 = 1.0;
/// A particle has at least this standard deviation, steps of the wave.
const LEAST_SIGMA: f64 = 0.9;
/// Parts of a step, along an axis, in which the edge of a stop is found.
const PARTS: usize = 12;
/// Lenslets with a smaller share of the light are left dark.
const LEAST_LIGHT: f64 = 1e-6;
/// Width of the part of the array that is looked at around a cell, pitches. It holds twice the width of a cell's light.
const WINDOW: f64 = 2.4;
/// The widest wave on the array, steps along an axis. Light that needs more has no fringes: it is left to rays.
const MOST_STEPS: usize = 4096;

impl CoherentLight {
    /// None for a camera without a wavelength.
    pub(super) fn new(camera: &Camera) -> Option<Self> {
        let pattern = camera.diffraction()?;
        let (pitch_mm, pixel_mm) = (camera.microlenses.pitch_mm, camera.sensor.pixel_pitch_mm);
        Some(Self {
            pitch_mm,
            unit_mm: pattern.unit_px * pixel_mm,
            pixel_mm,
            sigma_px: camera.blur.map_or(0.0, |blur| blur.sigma_px),
            layout: pattern.layout,
            turn: DMat2::from_angle(-camera.microlenses.rotation_rad),
        })
    }

    /// How far beyond the light of rays waves are drawn, mm.
    pub(super) fn beside_mm(&self) -> f64 {
        BESIDE * self.unit_mm + BESIDE_PITCHES * self.pitch_mm
    }

    /// Bytes of a wave on an array whose light is this wide, mm, behind a stop of a half width on the sensor, mm.
    pub(super) fn bytes(&self, wide_mm: f64, half_mm: f64) -> f64 {
        let steps = wide_mm / self.pitch_mm * 2.0 * (half_mm / self.unit_mm + BESIDE);
        steps.min(MOST_STEPS as f64).powi(2) * size_of::<Number>() as f64
    }

    /// Draws a particle through lenslets, whose middles `lenslets` lists about a place on the array within a reach, mm.
    /// Returns false, and draws nothing, if its light on the array is too wide or no ray meets it.
    pub(super) fn draw<L: Iterator<Item = DVec2>>(
        &self,
        rays: &Rays,
        lenslets: impl Fn(DVec2, f64) -> L,
        tally: &mut Tally,
    ) -> bool {
        let Some((chief_mm, middle_mm)) = (rays.ray)(DVec2::ZERO) else { return false };
        // A step in the stop and on the array moves light on the sensor, mm/mm.
        let pixel = |array: DVec2, stop: DVec2| (rays.pixel)(chief_mm, array, stop) * self.pixel_mm;
        let at = pixel(chief_mm, middle_mm);
        let by_stop = (pixel(chief_mm, middle_mm + 0.1 * rays.half_mm) - at) / (0.1 * rays.half_mm);
        let by_array = (pixel(chief_mm + 0.1 * self.pitch_mm, middle_mm) - at) / (0.1 * self.pitch_mm);
        let to_mm = self.unit_mm / by_stop;
        let curvature = by_array * self.pitch_mm / self.unit_mm;
        let half = (rays.half_mm / to_mm).abs().max_element();

        let Some((phase, reach)) = Phase::new(rays, chief_mm, self.pitch_mm, to_mm, half) else { return false };
        let apart = if reach < NARROW { 0.0 } else { APART };
        let reach = reach + BESIDE_PITCHES + FARTHEST * rays.sigma_mm / self.pitch_mm;
        let range = 2.0 * (half + BESIDE);
        let least = Some(2.0 * reach * range).filter(|steps| *steps < MOST_STEPS as f64);
        let Some(steps) = least.map(|steps| smooth_size(steps.ceil() as usize)) else { return false };
        let (step, spacing) = (range / steps as f64, 1.0 / range);
        let wave = self.on_array(rays, &phase, (chief_mm, to_mm), (half, step), steps);

        // Light of the whole stop, in the unit of the squared wave on the array.
        let whole = (steps * steps) as f64 * 4.0 * half * half * rays.filled / (step * step);
        let wide = smooth_size((WINDOW / spacing).ceil() as usize);
        let transform = Transform::new(wide, FftDirection::Forward);
        let cell = self.cell(&transform, (spacing, range), curvature);
        let mut buffer = vec![Number::default(); wide * wide];
        for centre_mm in lenslets(chief_mm, reach * self.pitch_mm) {
            let mut seen = vec![0f32; wide * wide];
            let mut light = 0.0;
            let at = (centre_mm - chief_mm) / (self.pitch_mm * spacing);
            for (node, share) in points(at, rays.sigma_mm / (self.pitch_mm * spacing), apart) {
                let wrapped = |at: i64, n: usize| (at + n as i64 - wide as i64 / 2).rem_euclid(steps as i64) as usize;
                for (row, (numbers, cell)) in buffer.chunks_mut(wide).zip(cell.chunks(wide)).enumerate() {
                    let line = &wave[wrapped(node[1], row) * steps..][..steps];
                    for (column, (number, factor)) in numbers.iter_mut().zip(cell).enumerate() {
                        *number = factor * line[wrapped(node[0], column)];
                    }
                }
                light += share * f64::from(buffer.iter().map(|number| number.norm_sqr()).sum::<f32>());
                if light < LEAST_LIGHT * whole {
                    break;
                }
                transform.process(&mut buffer);
                seen.iter_mut().zip(&buffer).for_each(|(sum, number)| *sum += share as f32 * number.norm_sqr());
            }
            if light >= LEAST_LIGHT * whole {
                let middle_px = (rays.pixel)(centre_mm, centre_mm, DVec2::ZERO);
                self.count(&seen, &transform, (spacing, range), (middle_px, whole), tally);
            }
        }
        true
    }

    /// The wave on the array, `steps` along each axis, from its middle on: what lies before the middle comes last.
    fn on_array(
        &self,
        rays: &Rays,
        phase: &Phase,
        (chief_mm, to_mm): (DVec2, DVec2),
        (half, step): (f64, f64),
        steps: usize,
    ) -> Vec<Number> {
        let reach = (half / step).ceil() as i64 + 1;
        let passes = |at: DVec2| {
            let place_mm = at * to_mm;
            (rays.passes)(chief_mm + self.pitch_mm * phase.at(at).1, place_mm)
        };
        let count = (2 * reach + 2) as usize;
        let corner = |n: usize| step * ((n % count) as f64 - reach as f64 - 0.5);
        let corners: Vec<bool> = (0..count * count).map(|n| passes(DVec2::new(corner(n), corner(n / count)))).collect();
        let mut wave = vec![Number::default(); steps * steps];
        for n in 0..(count - 1) * (count - 1) {
            let (column, row) = (n % (count - 1), n / (count - 1));
            let around = [0, 1, count, count + 1].map(|next| corners[row * count + column + next]);
            let at = step * (DVec2::new(column as f64, row as f64) - reach as f64);
            let open = if around.iter().all(|open| *open == around[0]) {
                f64::from(u8::from(around[0]))
            } else {
                let part = |n: usize| step * ((n as f64 + 0.5) / PARTS as f64 - 0.5);
                let open = (0..PARTS * PARTS).filter(|n| passes(at + DVec2::new(part(n % PARTS), part(n / PARTS))));
                open.count() as f64 / (PARTS * PARTS) as f64
            };
            if open > 0.0 {
                let turned = DVec2::from_angle(-2.0 * PI * phase.at(at).0) * open;
                let index = |n: usize| (n as i64 - reach).rem_euclid(steps as i64) as usize;
                wave[index(row) * steps + index(column)] = Number::new(turned.x as f32, turned.y as f32);
            }
        }
        Transform::new(steps, FftDirection::Inverse).process(&mut wave);
        wave
    }

    /// The factor of the wave on the array by a cell, in the middle of a square of the transform's size. Edges are as
    /// sharp as the range of the sensor can show. A sensor out of focus curves the wave.
    fn cell(&self, transform: &Transform, (spacing, range): (f64, f64), curvature: DVec2) -> Vec<Number> {
        let wide = transform.size;
        let signed = |n: usize| if 2 * n < wide { n as f64 } else { n as f64 - wide as f64 };
        let step = range / wide as f64;
        let far_field = |n: usize| {
            let at = self.turn * (step * DVec2::new(signed(n % wide), signed(n / wide)));
            let field = match self.layout {
                Layout::Square => sinc(at.x) * sinc(at.y),
                Layout::Hexagonal => 0.75f64.sqrt() * hexagon(at),
            };
            Number::new((field * step * step) as f32, 0.0)
        };
        let mut open: Vec<Number> = (0..wide * wide).map(far_field).collect();
        transform.process(&mut open);
        let half = wide / 2;
        let curved = |n: usize| {
            let from_middle = |n: usize| n as f64 - half as f64;
            let at = spacing * DVec2::new(from_middle(n % wide), from_middle(n / wide));
            let wave = DVec2::from_angle(PI * curvature.dot(at * at)).as_vec2();
            let wrapped = |n: usize| (n + wide - half) % wide;
            Number::new(wave.x, wave.y) * open[wrapped(n / wide) * wide + wrapped(n % wide)].re
        };
        (0..wide * wide).map(curved).collect()
    }

    /// Counts the light of a lenslet, `seen` in steps of `range / wide` from its middle on, in pixels.
    fn count(
        &self,
        seen: &[f32],
        transform: &Transform,
        (spacing, range): (f64, f64),
        (middle_px, whole): (DVec2, f64),
        tally: &mut Tally,
    ) {
        let wide = transform.size;
        let unit_px = self.unit_mm / self.pixel_mm;
        let mut waves: Vec<Number> = seen.iter().map(|light| Number::new(*light, 0.0)).collect();
        // Backwards or forwards: the light is real, so the waves differ in their sign alone.
        transform.process(&mut waves);
        let reach_px = 0.5 * range * unit_px;
        let first = (middle_px - reach_px).floor();
        let count = (2.0 * reach_px).ceil() as usize + 1;
        // Waves, 1/px, and how they count in pixels.
        let frequency = |n: usize| {
            let signed = if 2 * n < wide { n as f64 } else { n as f64 - wide as f64 };
            signed * spacing / unit_px
        };
        let along = |first: f64, middle: f64| -> Vec<Number> {
            let of = |pixel: usize, n: usize| {
                let f = frequency(n);
                let damped = sinc(f) * (-2.0 * PI * PI * (self.sigma_px * f).powi(2)).exp();
                let wave = DVec2::from_angle(2.0 * PI * f * (first + pixel as f64 + 0.5 - middle)) * damped;
                Number::new(wave.x as f32, wave.y as f32)
            };
            (0..count * wide).map(|n| of(n / wide, n % wide)).collect()
        };
        let (columns, rows) = (along(first.x, middle_px.x), along(first.y, middle_px.y));
        let scale = (spacing / unit_px).powi(2) / (whole * (wide * wide) as f64);
        for row in 0..count {
            let mut sums = vec![Number::default(); wide];
            for (line, wave) in waves.chunks(wide).zip(&rows[row * wide..]) {
                sums.iter_mut().zip(line).for_each(|(sum, number)| *sum += number * wave);
            }
            for column in 0..count {
                let light = sums.iter().zip(&columns[column * wide..]).map(|(sum, wave)| (sum * wave).re).sum::<f32>();
                let pixel = [first.x as i64 + column as i64, first.y as i64 + row as i64];
                tally.add_share(pixel, scale * f64::from(light));
            }
        }
    }
}

/// Points of the array, in steps of the wave, at which the middle of a cell stands for points of a particle, and their
/// shares of the light. `at` is where it stands for the particle's middle; points lie up to `apart` standard deviations
/// apart.
fn points(at: DVec2, sigma: f64, apart: f64) -> impl Iterator<Item = ([i64; 2], f64)> {
    let sigma = sigma.max(LEAST_SIGMA);
    let apart = (apart * sigma).floor().max(1.0) as i64;
    let count = (FARTHEST * sigma / apart as f64).ceil() as i64;
    let along = move |at: f64| {
        let of = move |n: i64| {
            let node = at.round() as i64 + apart * n;
            (node, (-0.5 * ((node as f64 - at) / sigma).powi(2)).exp())
        };
        (-count..=count).map(of)
    };
    let pairs = along(at.y).flat_map(move |(y, b)| along(at.x).map(move |(x, a)| ([x, y], a * b)));
    let mut pairs: Vec<([i64; 2], f64)> = pairs.collect();
    // The brightest first: without its light the others have none.
    pairs.sort_by(|one, other| other.1.total_cmp(&one.1));
    let most = pairs[0].1;
    pairs.retain(|(_, share)| *share > LEAST_POINT * most);
    let whole = pairs.iter().map(|(_, share)| share).sum::<f64>();
    pairs.into_iter().map(move |(node, share)| (node, share / whole))
}

/// The phase of a wave in the stop, turns: a polynomial.
struct Phase {
    half: f64,
    terms: Vec<f64>,
}

impl Phase {
    /// The phase whose slope is where rays meet the array, in pitches from the chief ray, and how far they lie from it.
    /// None without enough rays.
    fn new(rays: &Rays, chief_mm: DVec2, pitch_mm: f64, to_mm: DVec2, half: f64) -> Option<(Self, f64)> {
        let mut phase = Self { half, terms: Vec::new() };
        let size = powers().count();
        let (mut matrix, mut terms) = (vec![0.0; size * size], vec![0.0; size]);
        let mut reach = 0f64;
        let place = |n: usize| 2.0 * n as f64 / (RAYS - 1) as f64 - 1.0;
        for n in 0..RAYS * RAYS {
            let Some((array_mm, stop_mm)) = (rays.ray)(DVec2::new(place(n % RAYS), place(n / RAYS))) else { continue };
            let hit = (array_mm - chief_mm) / pitch_mm;
            if !hit.is_finite() {
                return None;
            }
            reach = reach.max(hit.abs().max_element());
            let slopes: Vec<DVec2> = phase.slopes(stop_mm / to_mm).collect();
            for (one, row) in slopes.iter().zip(matrix.chunks_mut(size)) {
                row.iter_mut().zip(&slopes).for_each(|(sum, other)| *sum += one.dot(*other));
            }
            terms.iter_mut().zip(&slopes).for_each(|(sum, slope)| *sum += slope.dot(hit));
        }
        cholesky(&mut matrix, size, 0.0)?;
        solve(&matrix, &mut terms);
        phase.terms = terms;
        Some((phase, reach))
    }

    /// Slopes of the terms.
    fn slopes(&self, at: DVec2) -> impl Iterator<Item = DVec2> {
        let half = self.half;
        let at = at / half;
        let slope = |power: i32, x: f64| if power == 0 { 0.0 } else { f64::from(power) * x.powi(power - 1) };
        powers().map(move |(a, b)| DVec2::new(slope(a, at.x) * at.y.powi(b), at.x.powi(a) * slope(b, at.y)) / half)
    }

    /// The phase at a place in the stop, and its slope.
    fn at(&self, place: DVec2) -> (f64, DVec2) {
        let at = place / self.half;
        let phase = powers().zip(&self.terms).map(|((a, b), term)| term * at.x.powi(a) * at.y.powi(b)).sum();
        (phase, self.slopes(place).zip(&self.terms).map(|(slope, term)| *term * slope).sum())
    }
}

/// Powers of the terms of a phase.
fn powers() -> impl Iterator<Item = (i32, i32)> {
    let degree = DEGREE as i32;
    (1..=degree).flat_map(|sum| (0..=sum).map(move |b| (sum - b, b)))
}

/// A Fourier transform of a square of numbers.
struct Transform {
    size: usize,
    along: Arc<dyn Fft<f32>>,
}

impl Transform {
    fn new(size: usize, direction: FftDirection) -> Self {
        Self { size, along: FftPlanner::new().plan_fft(size, direction) }
    }

    fn process(&self, numbers: &mut [Number]) {
        for _ in 0..2 {
            self.along.process(numbers);
            for row in 0..self.size {
                for column in 0..row {
                    numbers.swap(row * self.size + column, column * self.size + row);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rays::tally::{self, LEAST_SHARE};
    use ndarray::Array2;

    const HALF: f64 = 9.0;
    const PITCH_MM: f64 = 2.0;
    /// Standard deviation of the particle, pitches.
    const SIGMA: f64 = 0.06;
    const PIXELS: usize = 60;

    /// A camera with square cells and a square stop. A unit of the stop, mm, is one on the sensor too.
    fn light() -> CoherentLight {
        CoherentLight {
            pitch_mm: PITCH_MM,
            unit_mm: 1.0,
            pixel_mm: 0.8,
            sigma_px: 0.0,
            layout: Layout::Square,
            turn: DMat2::IDENTITY,
        }
    }

    /// The image behind one lenslet of a point whose rays meet the array at `slope` pitches a unit of the stop.
    fn drawn(centre: DVec2, slope: f64, curvature: f64) -> Array2<f32> {
        let rays = Rays {
            ray: &|place: DVec2| Some((slope * PITCH_MM * HALF * place, HALF * place)),
            passes: &|_: DVec2, stop: DVec2| stop.abs().max_element() < HALF,
            pixel: &|centre: DVec2, array: DVec2, stop: DVec2| {
                let in_cell = (array - centre) / PITCH_MM;
                (stop + curvature * in_cell) / 0.8 + 0.5 * PIXELS as f64
            },
            half_mm: HALF,
            filled: 1.0,
            sigma_mm: SIGMA * PITCH_MM,
        };
        let mut tally = Tally::default();
        tally.clear([0.0; 2], [PIXELS as f64; 2], [PIXELS; 2], LEAST_SHARE);
        assert!(light().draw(&rays, |_, _| [PITCH_MM * centre].into_iter(), &mut tally));
        let mut image = Array2::zeros((PIXELS, PIXELS));
        tally::add(&mut image, &[tally]);
        image
    }

    /// The light of a row of pixels: sums over places in the stop, for each place of the cell, and over these.
    fn summed(centre: f64, slope: f64, curvature: f64) -> Vec<f64> {
        const PARTS: usize = 8;
        let places =
            |count: usize, half: f64| (0..count).map(move |n| half * (2.0 * (n as f64 + 0.5) / count as f64 - 1.0));
        let turned = |turns: f64| DVec2::from_angle(2.0 * PI * turns);
        let wave = |x: f64| -> DVec2 {
            let at = |u: f64| turned((centre + x) * u - 0.5 * slope * u * u + 0.5 * curvature * x * x);
            places(400, HALF).map(at).sum::<DVec2>() * (2.0 * HALF / 400.0)
        };
        let cell: Vec<(f64, DVec2)> = places(400, 0.5).map(|x| (x, wave(x))).collect();
        let seen = |s: f64| {
            let sum: DVec2 = cell.iter().map(|(x, wave)| wave.rotate(turned(-x * s))).sum();
            (sum / 400.0).length_squared()
        };
        let part = |n: usize| 0.8 * ((n as f64 + 0.5) / PARTS as f64 - 0.5 * PIXELS as f64);
        let pixel = |n: usize| (0..PARTS).map(|k| seen(part(n * PARTS + k))).sum::<f64>() * 0.8 / PARTS as f64;
        (0..PIXELS).map(|n| pixel(n) / (2.0 * HALF)).collect()
    }

    /// The light of a row of pixels from a particle.
    fn particle(centre: f64, slope: f64, curvature: f64) -> Vec<f64> {
        let points = || (-12..=12).map(|n| 0.25 * f64::from(n)).map(|at| (at, (-0.5 * at * at).exp()));
        let whole = points().map(|(_, share)| share).sum::<f64>();
        let mut sum = vec![0.0; PIXELS];
        for (at, share) in points() {
            let seen = summed(centre + SIGMA * at, slope, curvature);
            sum.iter_mut().zip(seen).for_each(|(sum, light)| *sum += share / whole * light);
        }
        sum
    }

    /// Cells in the middle of the light, at its rim and beyond it; before and behind focus; a sensor out of focus.
    #[test]
    fn lenslets_show_the_sum_of_all_waves() {
        // The last numbers are the largest error over the brightest pixel. A cell beside the light sees far waves only.
        for (centre, slope, curvature, most) in [
            ((0.1, -0.3), 0.25, 0.0, 0.01),
            ((2.2, 0.4), 0.25, 0.0, 0.01),
            ((-1.2, -1.7), -0.2, 0.0, 0.01),
            ((0.2, 0.1), 0.01, 0.0, 0.01),
            ((0.6, 0.2), 0.01, 0.0, 0.11),
            ((1.0, 0.3), 0.15, 0.6, 0.015),
        ] {
            let image = drawn(DVec2::from(centre), slope, curvature);
            let [columns, rows] = [centre.0, centre.1].map(|at| particle(at, slope, curvature));
            let off =
                image.indexed_iter().map(|((row, column), light)| f64::from(*light) - rows[row] * columns[column]);
            let off =
                off.fold(0f64, |most, off| most.max(off.abs())) / f64::from(image.iter().copied().fold(0.0, f32::max));
            assert!(off < most, "{centre:?} {slope} {curvature}: {off}");
            let whole = rows.iter().sum::<f64>() * columns.iter().sum::<f64>();
            let drawn = f64::from(image.sum());
            assert!((drawn / whole - 1.0).abs() < 0.03, "{centre:?} {slope} {curvature}: {drawn} for {whole}");
        }
    }
}
