//! Weights of a camera whose rays bend: a medium before the lens, or a sensor that is not parallel to the array.
//!
//! The aperture is cut into sections so small that the rays of one section run straight: the place on the array is
//! linear in the place in the aperture, and so is the place on the sensor, lenslet by lenslet. A table gives the share
//! of a beam that a cell takes; this light falls evenly on the pixels between the ends of its image. 0.1 us a section.

use super::{axis::Span, blur::Blur, geometry::Geometry};
use crate::Optics;
use glam::DVec2;
use std::sync::OnceLock;

/// Sections of the aperture for each pixel under a lenslet: 1 errs by 2 to 4 % of a voxel's light, 2 by 1 %.
const SECTIONS_PER_PIXEL: usize = 2;
/// Points a side of the table of a cell's shares.
const STEPS: usize = 128;
/// Points a side at which a section is tested against a round stop.
const POINTS: usize = 8;
/// Distance over which a beam's spread is measured, mm of the aperture; the ray's bend over it is negligible.
const NEAR_MM: f64 = 0.05;
/// Shares below this are dropped.
const LEAST: f64 = 1e-7;

/// Weights section by section of the aperture.
#[derive(Debug, Clone)]
pub struct Bent {
    geometry: Geometry,
    sections: Vec<Section>,
    /// Side of a section, mm.
    side: f64,
    /// The cell's shares in each slice, made when first used.
    shares: Vec<OnceLock<CellShares>>,
}

#[derive(Debug, Clone, Copy)]
struct Section {
    /// Middle of what the stop leaves of it, mm.
    middle: DVec2,
    /// Its share of the light that passes the stop.
    share: f64,
}

/// The share of a beam that a cell takes, by the beam's place, in one slice.
#[derive(Debug, Clone)]
struct CellShares {
    /// Half sides of the table, mm.
    half: DVec2,
    table: Vec<f32>,
}

/// A section's rays from one voxel, near the middle of the section.
struct Beam {
    /// Middle of the section, mm.
    aperture: DVec2,
    /// Where its ray meets the array, mm.
    array: DVec2,
    /// Spread on the array per length of the aperture.
    alpha: DVec2,
}

fn sections(optics: &Optics, count: usize, side: f64) -> Vec<Section> {
    let half = optics.half_aperture_mm;
    let point = |m: usize| DVec2::new((m % POINTS) as f64 + 0.5, (m / POINTS) as f64 + 0.5) * side / POINTS as f64;
    let section = |n: usize| {
        let corner = DVec2::new((n % count) as f64, (n / count) as f64) * side - half;
        let inside = (0..POINTS * POINTS).map(|m| corner + point(m)).filter(|point| optics.passes(*point));
        let share = inside.clone().count() as f64;
        (share > 0.0).then(|| Section { middle: inside.sum::<DVec2>() / share, share })
    };
    let mut sections: Vec<Section> = (0..count * count).filter_map(section).collect();
    let all: f64 = sections.iter().map(|section| section.share).sum();
    sections.iter_mut().for_each(|section| section.share /= all);
    sections
}

impl CellShares {
    /// For the beams of sections of side `side` in slice `z`.
    fn new(geometry: &Geometry, z: usize, side: f64) -> Self {
        // A beam on the axis, half way out of the aperture: its width matters little beside the cell's.
        let Geometry { optics, grid, .. } = geometry;
        let half_way = 0.5 * optics.half_aperture_mm;
        let hit = optics.array_from_object(DVec2::ZERO, grid.centre_mm(2, z), DVec2::new(half_way, 0.0));
        let alpha = hit.x / half_way;
        let beam = (0.5 * side * alpha.abs()).max(1e-3 * geometry.pitch_mm);
        let blurs = geometry.blurs(&geometry.axis(z, 0));
        let half = geometry.corner() + beam + DVec2::from(blurs.map(Blur::reach));
        let profile = |span: Span, half: f64| -> Vec<f64> {
            let at = |n: usize| -half + 2.0 * half * n as f64 / (STEPS - 1) as f64;
            (0..STEPS).map(|n| (span.ramp(at(n) + beam) - span.ramp(at(n) - beam)) / (2.0 * beam)).collect()
        };
        let mut table = vec![0f32; STEPS * STEPS];
        for slab in &geometry.slabs {
            let across = profile(slab.span(0, blurs), half.x);
            let down = profile(slab.span(1, blurs), half.y);
            for (row, down) in table.chunks_mut(STEPS).zip(down) {
                row.iter_mut().zip(&across).for_each(|(share, across)| *share += (down * across) as f32);
            }
        }
        Self { half, table }
    }

    /// The share of a beam whose middle lies `beyond` the lenslet's centre; linear between the table's points.
    #[inline]
    fn at(&self, beyond: DVec2) -> f64 {
        let place = (beyond / self.half + 1.0) * (0.5 * (STEPS - 1) as f64);
        if place.min_element() < 0.0 || place.max_element() >= (STEPS - 1) as f64 {
            return 0.0;
        }
        let (x, y) = (place.x as usize, place.y as usize);
        let part = place - place.floor();
        let row = |y: usize| {
            let [a, b] = [self.table[y * STEPS + x], self.table[y * STEPS + x + 1]].map(f64::from);
            a + part.x * (b - a)
        };
        row(y) + part.y * (row(y + 1) - row(y))
    }
}

impl Bent {
    /// Bytes of a slice before its table is made.
    pub(super) const LIST_BYTES: usize = size_of::<OnceLock<CellShares>>();

    pub(super) fn new(geometry: Geometry) -> Self {
        let count = SECTIONS_PER_PIXEL * geometry.sections;
        let side = 2.0 * geometry.optics.half_aperture_mm / count as f64;
        let sections = sections(&geometry.optics, count, side);
        Self { sections, side, shares: vec![OnceLock::new(); geometry.grid.shape[2]], geometry }
    }

    pub(super) fn visit(&self, voxel: [usize; 3], wanted: impl Fn(u32) -> bool, mut found: impl FnMut(u32, u32, f32)) {
        let Geometry { grid, optics, .. } = &self.geometry;
        let [x, y, z_mm] = std::array::from_fn(|axis| grid.centre_mm(axis, voxel[axis]));
        let place = DVec2::new(x, y);
        let shares = self.shares[voxel[2]].get_or_init(|| CellShares::new(&self.geometry, voxel[2], self.side));
        let corner = self.geometry.corner();
        for section in &self.sections {
            let beam = beam(optics, place, z_mm, section.middle);
            for centre in optics.lenslets_seen(beam.array, shares.half) {
                let light = section.share * shares.at(beam.array - centre);
                if light >= LEAST {
                    self.share_out(light, self.image_px(&beam, centre, corner), &wanted, &mut found);
                }
            }
        }
    }

    /// Two opposite corners, px, of the image of what a lenslet takes of a beam.
    #[inline(always)]
    fn image_px(&self, beam: &Beam, centre: DVec2, corner: DVec2) -> [DVec2; 2] {
        let beyond = beam.array - centre;
        // The lenslet takes what lies between the cell's edges, at the height of the middle of this.
        let (v0, v1) = self.taken(beam.alpha.y, beyond.y, [-corner.y, corner.y]);
        let height = beyond.y + beam.alpha.y * 0.5 * (v0 + v1);
        let (u0, u1) = self.taken(beam.alpha.x, beyond.x, self.geometry.edges_at(height));
        let optics = &self.geometry.optics;
        [(u0, v0), (u1, v1)].map(|(u, v)| {
            let aperture = beam.aperture + DVec2::new(u, v);
            let array = beam.array + beam.alpha * DVec2::new(u, v);
            optics.place_px(optics.sensor_through(centre, array, aperture))
        })
    }

    /// The part of a section, from its middle, whose rays fall between two edges of a cell along one axis.
    #[inline(always)]
    fn taken(&self, alpha: f64, beyond: f64, [low, high]: [f64; 2]) -> (f64, f64) {
        let half = 0.5 * self.side;
        if alpha.abs() * self.side < 1e-9 {
            return (-half, half);
        }
        let (a, b) = ((low - beyond) / alpha, (high - beyond) / alpha);
        (a.min(b).clamp(-half, half), a.max(b).clamp(-half, half))
    }

    /// Shares light out over the pixels of an image, by their overlap with it.
    #[inline(always)]
    fn share_out(
        &self,
        light: f64,
        [a, b]: [DVec2; 2],
        wanted: &impl Fn(u32) -> bool,
        found: &mut impl FnMut(u32, u32, f32),
    ) {
        let [width, height] = self.geometry.optics.sensor_px;
        let whole_px = DVec2::new(width as f64, height as f64);
        let (first, last) = (a.min(b).max(DVec2::ZERO), a.max(b).min(whole_px));
        let size = (b - a).abs().max(DVec2::splat(1e-9));
        if first.x >= whole_px.x || first.y >= whole_px.y || last.x < 0.0 || last.y < 0.0 {
            return;
        }
        for row in first.y as u32..=(last.y as u32).min(height as u32 - 1) {
            let down = light * overlap(row, first.y, last.y, size.y);
            if down < LEAST || !wanted(row) {
                continue;
            }
            for column in first.x as u32..=(last.x as u32).min(width as u32 - 1) {
                let weight = down * overlap(column, first.x, last.x, size.x);
                if weight > 0.0 {
                    found(column, row, weight as f32);
                }
            }
        }
    }
}

#[inline(always)]
fn beam(optics: &Optics, place: DVec2, z_mm: f64, middle: DVec2) -> Beam {
    let at = |aperture: DVec2| optics.array_from_object(place, z_mm, aperture);
    let (x, y) = (DVec2::new(NEAR_MM, 0.0), DVec2::new(0.0, NEAR_MM));
    let alpha = DVec2::new((at(middle + x) - at(middle - x)).x, (at(middle + y) - at(middle - y)).y) / (2.0 * NEAR_MM);
    Beam { aperture: middle, array: at(middle), alpha }
}

/// Overlap of a pixel with `[low, high]` along an axis, over `size`.
#[inline(always)]
fn overlap(pixel: u32, low: f64, high: f64, size: f64) -> f64 {
    let pixel = f64::from(pixel);
    if size < 1e-6 {
        return if low >= pixel && low < pixel + 1.0 { 1.0 } else { 0.0 };
    }
    ((high.min(pixel + 1.0) - low.max(pixel)) / size).max(0.0)
}
