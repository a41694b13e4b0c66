//! Weights where rays bend: a medium before the lens, a sensor that is not parallel to the array.
//!
//! The aperture is cut into sections small enough for the rays of one to run straight: over a section the place on the
//! array is linear in the place in the aperture, and so is that on the sensor, lenslet by lenslet. What a lenslet's cell
//! takes of a section's beam is looked up; it falls on the pixels between the ends of that part. About 0.1 us a section.

use super::Footprint;
use super::axis::Span;
use super::blur::Blur;
use super::cell::Slab;
use crate::optics::Optics;
use glam::DVec2;
use std::sync::OnceLock;

/// Steps of the table of a cell's shares, a side.
const STEPS: usize = 128;
/// Points a side by which the share of a section inside a round stop is counted.
const POINTS: usize = 8;
/// Distance over which a beam's spread is measured, mm of the aperture: its bend over as little changes nothing.
const NEAR_MM: f64 = 0.05;
/// A share below this is none.
const LEAST: f64 = 1e-7;

/// A part of the aperture.
#[derive(Debug, Clone, Copy)]
struct Section {
    /// Its middle, mm.
    middle: DVec2,
    /// Its share of the light that passes the stop.
    share: f64,
}

/// What a cell takes of a beam by the beam's place, for one slice.
#[derive(Debug, Clone)]
struct Shares {
    /// Half sides of what the table holds, mm.
    half: DVec2,
    table: Vec<f32>,
}

/// The sections of a camera's aperture, and the cell's shares of each slice, made when first asked for.
#[derive(Debug, Clone)]
pub(super) struct Bent {
    sections: Vec<Section>,
    /// Side of a section, mm.
    side: f64,
    shares: Vec<OnceLock<Shares>>,
}

impl Bent {
    /// `count` sections a side.
    pub(super) fn new(optics: &Optics, count: usize, slices: usize) -> Self {
        let half = optics.half_aperture_mm();
        let side = 2.0 * half / count as f64;
        let mut sections = Vec::new();
        for n in 0..count * count {
            let corner = DVec2::new((n % count) as f64, (n / count) as f64) * side - half;
            let point =
                |m: usize| DVec2::new((m % POINTS) as f64 + 0.5, (m / POINTS) as f64 + 0.5) * side / POINTS as f64;
            let inside: Vec<DVec2> =
                (0..POINTS * POINTS).map(|m| corner + point(m)).filter(|point| optics.passes(*point)).collect();
            if !inside.is_empty() {
                // A section that the stop's rim cuts stands for the middle of what is left of it.
                let middle = inside.iter().sum::<DVec2>() / inside.len() as f64;
                sections.push(Section { middle, share: inside.len() as f64 });
            }
        }
        let all: f64 = sections.iter().map(|section| section.share).sum();
        sections.iter_mut().for_each(|section| section.share /= all);
        Self { sections, side, shares: vec![OnceLock::new(); slices] }
    }
}

impl Shares {
    /// Of a cell in slabs, for beams of half sides `beam` of a voxel that blurs by `blurs`.
    fn new(slabs: &[Slab], corner: DVec2, beam: DVec2, blurs: [Blur; 2]) -> Self {
        let reach = DVec2::new(blurs[0].reach(), blurs[1].reach());
        let half = corner + beam + reach;
        let along = |edges: [f64; 2], blur: Blur, beam: f64, half: f64| -> Vec<f64> {
            let span = Span { low: edges[0], high: edges[1], blur };
            let at = |n: usize| -half + 2.0 * half * n as f64 / (STEPS - 1) as f64;
            (0..STEPS).map(|n| (span.ramp(at(n) + beam) - span.ramp(at(n) - beam)) / (2.0 * beam)).collect()
        };
        let mut table = vec![0f32; STEPS * STEPS];
        for slab in slabs {
            let across = along(slab.x, blurs[0].widened(slab.slant_x), beam.x, half.x);
            let down = along(slab.y, blurs[1].widened(slab.slant_y), beam.y, half.y);
            for (line, down) in table.chunks_mut(STEPS).zip(down) {
                line.iter_mut().zip(&across).for_each(|(share, across)| *share += (down * across) as f32);
            }
        }
        Self { half, table }
    }

    /// Of a beam whose middle lies at `t` from the lenslet's centre.
    #[inline]
    fn at(&self, t: DVec2) -> f64 {
        let place = (t / self.half + 1.0) * (0.5 * (STEPS - 1) as f64);
        if place.min_element() < 0.0 || place.max_element() >= (STEPS - 1) as f64 {
            return 0.0;
        }
        let (x, y) = (place.x as usize, place.y as usize);
        let part = place - place.floor();
        let line = |y: usize| {
            let [a, b] = [self.table[y * STEPS + x], self.table[y * STEPS + x + 1]].map(f64::from);
            a + part.x * (b - a)
        };
        line(y) + part.y * (line(y + 1) - line(y))
    }
}

impl Footprint {
    /// As [`Footprint::visit`], section by section.
    pub(super) fn visit_bent(
        &self,
        bent: &Bent,
        voxel: [usize; 3],
        wanted: impl Fn(u32) -> bool,
        mut found: impl FnMut(u32, u32, f32),
    ) {
        let z = voxel[2];
        let z_mm = self.grid.centre_mm(2, z);
        let place = DVec2::new(self.grid.centre_mm(0, voxel[0]), self.grid.centre_mm(1, voxel[1]));
        let axis = self.axis(z, self.width);
        let corner = self.corner();
        let optics = &self.optics;
        let alpha_at = |aperture: DVec2| {
            let at = |aperture: DVec2| optics.array_from_object(place, z_mm, aperture);
            let (x, y) = (DVec2::new(NEAR_MM, 0.0), DVec2::new(0.0, NEAR_MM));
            let alpha = DVec2::new((at(aperture + x) - at(aperture - x)).x, (at(aperture + y) - at(aperture - y)).y);
            alpha / (2.0 * NEAR_MM)
        };
        let least_beam = 1e-3 * self.pitch_mm;
        let shares = bent.shares[z].get_or_init(|| {
            // The slice's own beam, on the axis and half way out: its width decides little beside the cell's.
            let alpha = optics.array_from_object(DVec2::ZERO, z_mm, DVec2::new(0.5 * axis.half_aperture, 0.0)).x
                / (0.5 * axis.half_aperture);
            let beam = (0.5 * bent.side * alpha.abs()).max(least_beam);
            Shares::new(&self.slabs, corner, DVec2::splat(beam), [self.blur(&axis, 0), self.blur(&axis, 1)])
        });
        let whole_px = DVec2::new(self.width as f64, self.height as f64);
        for section in &bent.sections {
            let hit = optics.array_from_object(place, z_mm, section.middle);
            let alpha = alpha_at(section.middle);
            for (_, _, centre) in optics.lattice().lenslets_within(hit, shares.half) {
                let beyond = hit - centre;
                let light = section.share * shares.at(beyond);
                if light < LEAST {
                    continue;
                }
                // The part of the section that this lenslet takes: between the cell's edges, at the height of its middle.
                let part = |alpha: f64, beyond: f64, low: f64, high: f64| {
                    let half = 0.5 * bent.side;
                    if alpha.abs() * bent.side < 1e-9 {
                        return (-half, half);
                    }
                    let (a, b) = ((low - beyond) / alpha, (high - beyond) / alpha);
                    let (from, to) = (a.min(b).clamp(-half, half), a.max(b).clamp(-half, half));
                    (from, to)
                };
                let (v0, v1) = part(alpha.y, beyond.y, -corner.y, corner.y);
                let height = beyond.y + alpha.y * 0.5 * (v0 + v1);
                let [low, high] = self.edges_at(height);
                let (u0, u1) = part(alpha.x, beyond.x, low, high);
                let on_sensor = |u: f64, v: f64| {
                    let aperture = section.middle + DVec2::new(u, v);
                    let array = hit + alpha * DVec2::new(u, v);
                    optics.place_px(optics.sensor_through(centre, array, aperture))
                };
                let (a, b) = (on_sensor(u0, v0), on_sensor(u1, v1));
                let (first, last) = (a.min(b).max(DVec2::ZERO), a.max(b).min(whole_px));
                let size = (b - a).abs().max(DVec2::splat(1e-9));
                // Overlap of one pixel with the part's image along an axis, over that image.
                let overlap = |pixel: u32, low: f64, high: f64, size: f64| {
                    let pixel = f64::from(pixel);
                    if size < 1e-6 {
                        return if low >= pixel && low < pixel + 1.0 { 1.0 } else { 0.0 };
                    }
                    ((high.min(pixel + 1.0) - low.max(pixel)) / size).max(0.0)
                };
                if first.x >= whole_px.x || first.y >= whole_px.y || last.x < 0.0 || last.y < 0.0 {
                    continue;
                }
                for row in first.y as u32..=(last.y as u32).min(self.height as u32 - 1) {
                    let down = light * overlap(row, first.y, last.y, size.y);
                    if down < LEAST || !wanted(row) {
                        continue;
                    }
                    for column in first.x as u32..=(last.x as u32).min(self.width as u32 - 1) {
                        let weight = down * overlap(column, first.x, last.x, size.x);
                        if weight > 0.0 {
                            found(column, row, weight as f32);
                        }
                    }
                }
            }
        }
    }
}
