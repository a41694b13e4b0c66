//! Weights of a camera whose rays bend: a medium before the lens, the steep rays of a telecentric lens, or a sensor
//! that is not parallel to the array.
//!
//! The aperture is cut into sections so small that the rays of one section run straight: the place on the array is
//! linear in the place in the aperture, and so is the place on the sensor, lenslet by lenslet. A table gives the share
//! of a beam that a cell takes; this light falls evenly on the pixels between the ends of its image.

use super::rays::SliceRays;
use super::shares::CellShares;
use crate::frame::sensor_axes;
use crate::weights::geometry::Geometry;
use crate::weights::micro::LensletArray;
use crate::{Optics, simd::fastest};
use glam::{DVec2, Vec2};
use std::{ops::Range, sync::OnceLock};

/// Sections of the aperture for each pixel under a lenslet: 1 is off by 2 to 4 % of a voxel's light, 2 by 1 %.
const SECTIONS_PER_PIXEL: usize = 2;
/// Points a side at which a section is tested against a round stop.
const POINTS: usize = 8;
/// Heights at which the edges of a cell are kept.
const HEIGHTS: usize = 128;
/// Shares below this are dropped.
const LEAST: f32 = 1e-7;
/// An image narrower than this lies on one pixel, px.
const LEAST_PX: f32 = 1e-3;

/// Weights section by section of the aperture.
#[derive(Debug, Clone)]
pub(crate) struct Bent {
    geometry: Geometry,
    sections: Vec<Section>,
    /// Side of a section, mm.
    side: f32,
    /// Half the height of a cell, mm, and its left and right edge from its lowest to its highest line.
    top: f32,
    edges: Vec<[f32; 2]>,
    /// Largest distance of a voxel from the axis, mm.
    field_mm: f64,
    /// Rays and a cell's shares in each slice, made when first used.
    slices: Vec<OnceLock<Slice>>,
}

#[derive(Debug, Clone, Copy)]
struct Section {
    /// Middle of what the stop leaves of it, mm.
    middle: DVec2,
    /// Its share of the light that passes the stop.
    share: f32,
}

#[derive(Debug, Clone)]
struct Slice {
    rays: SliceRays,
    shares: CellShares,
}

/// A section's rays from one voxel, which are straight.
struct SectionBeam {
    /// Where the ray through the middle of the section meets the array, mm.
    array: DVec2,
    /// Spread on the array per length of the aperture, and 1 over it.
    alpha: Vec2,
    per_alpha: Vec2,
}

fn sections(optics: &Optics, count: usize, side: f64) -> Vec<Section> {
    let half = optics.half_aperture_mm;
    let point = |m: usize| DVec2::new((m % POINTS) as f64 + 0.5, (m / POINTS) as f64 + 0.5) * side / POINTS as f64;
    let section = |n: usize| {
        let corner = DVec2::new((n % count) as f64, (n / count) as f64) * side - half;
        let inside = (0..POINTS * POINTS).map(|m| corner + point(m)).filter(|point| optics.passes(*point));
        let count = inside.clone().count() as f64;
        (count > 0.0).then(|| Section { middle: inside.sum::<DVec2>() / count, share: count as f32 })
    };
    let mut sections: Vec<Section> = (0..count * count).filter_map(section).collect();
    let all: f32 = sections.iter().map(|section| section.share).sum();
    sections.iter_mut().for_each(|section| section.share /= all);
    sections
}

impl Bent {
    /// Bytes of a slice before its tables are made.
    pub(crate) const LIST_BYTES: usize = size_of::<OnceLock<Slice>>();

    pub(crate) fn new(geometry: Geometry) -> Self {
        let count = SECTIONS_PER_PIXEL * geometry.sections;
        let side = 2.0 * geometry.optics.half_aperture_mm / count as f64;
        let sections = sections(&geometry.optics, count, side);
        let top = geometry.corner().y;
        let height = |n: usize| top * ((2 * n + 1) as f64 / HEIGHTS as f64 - 1.0);
        let edges = (0..HEIGHTS).map(|n| geometry.edges_at(height(n)).map(|edge| edge as f32)).collect();
        let grid = &geometry.grid;
        let ends = |axis: usize| [0, grid.shape[axis] - 1].map(|voxel| grid.centre_mm(axis, voxel).abs());
        let field_mm = [ends(0), ends(1)].map(|[a, b]| a.max(b)).iter().sum();
        let (side, top) = (side as f32, top as f32);
        Self { sections, side, top, edges, field_mm, slices: vec![OnceLock::new(); grid.shape[2]], geometry }
    }

    fn slice(&self, z: usize) -> &Slice {
        self.slices[z].get_or_init(|| {
            let Geometry { optics, grid, .. } = &self.geometry;
            let rays = SliceRays::new(optics, grid.centre_mm(2, z), self.field_mm);
            // A beam on the axis, half way out of the aperture.
            let half_way = 0.5 * optics.half_aperture_mm;
            let alpha = rays.through(DVec2::ZERO, DVec2::new(half_way, 0.0)).array.x / half_way;
            Slice { shares: CellShares::new(&self.geometry, z, f64::from(self.side), alpha), rays }
        })
    }

    /// Calls `found(column, row, weight)` for the pixels of a voxel on the rows that `wanted` accepts. `array` are the
    /// camera's lenslets.
    pub(crate) fn visit(
        &self,
        array: &LensletArray,
        voxel: [usize; 3],
        wanted: impl Fn(u32) -> bool,
        mut found: impl FnMut(u32, u32, f32),
    ) {
        fastest(
            #[inline(always)]
            || self.visit_inlined(array, voxel, &wanted, &mut found),
        );
    }

    #[inline(always)]
    fn visit_inlined(
        &self,
        array: &LensletArray,
        voxel: [usize; 3],
        wanted: &impl Fn(u32) -> bool,
        found: &mut impl FnMut(u32, u32, f32),
    ) {
        let Geometry { grid, optics, .. } = &self.geometry;
        let [x, y, z_mm] = std::array::from_fn(|axis| grid.centre_mm(axis, voxel[axis]));
        let (object, distortion) = (DVec2::new(x, y), optics.distortion_mm(DVec2::new(x, y), z_mm));
        let object = sensor_axes(object);
        let Slice { rays, shares } = self.slice(voxel[2]);
        let aberrations =
            optics.aberrations(z_mm).map(|aberrations| (aberrations, rays.through(object, DVec2::ZERO).array));
        for section in &self.sections {
            // Trace the section's rays to the array.
            let mut hit = rays.through(object, section.middle);
            if let Some((aberrations, chief)) = &aberrations {
                hit.array += aberrations.shift_mm(*chief, section.middle);
                hit.alpha += aberrations.slope(*chief, section.middle);
            }
            let alpha = hit.alpha.as_vec2();
            let beam = SectionBeam { array: hit.array + distortion, alpha, per_alpha: alpha.recip() };
            // Share its light out over the lenslets nearby, and from there over the pixels.
            array.near(
                beam.array.as_vec2(),
                shares.half,
                #[inline(always)]
                |lenslet| {
                    let centre = array.centre(lenslet);
                    let beyond = (beam.array - centre).as_vec2();
                    let light = section.share * shares.at(beyond);
                    if light >= LEAST {
                        let middle = optics.place_px(optics.sensor_through(centre, beam.array, section.middle));
                        let slope = array.slope(lenslet, beam.alpha);
                        self.share_out(light, self.image_px(&beam, beyond, middle.as_vec2(), slope), wanted, found);
                    }
                },
            );
        }
    }

    /// Two opposite corners, px, of the image of what a lenslet takes of a beam. The beam meets the array `beyond` its
    /// centre, and its middle the sensor at `middle_px`; from there the place changes by `slope`, px for a mm of the
    /// aperture.
    #[inline(always)]
    fn image_px(&self, beam: &SectionBeam, beyond: Vec2, middle_px: Vec2, slope: Vec2) -> [Vec2; 2] {
        // The lenslet takes what lies between the cell's edges, at the height of the middle of this.
        let (v0, v1) = self.taken(beam.per_alpha.y, beyond.y, [-self.top, self.top]);
        let height = beyond.y + beam.alpha.y * 0.5 * (v0 + v1);
        let line = (height + self.top) * (0.5 * HEIGHTS as f32 / self.top);
        let (u0, u1) = self.taken(beam.per_alpha.x, beyond.x, self.edges[(line as usize).min(HEIGHTS - 1)]);
        [middle_px + slope * Vec2::new(u0, v0), middle_px + slope * Vec2::new(u1, v1)]
    }

    /// The part of a section, measured from its middle, whose rays fall between two edges of a cell along one axis. If
    /// no ray does, the light comes over the cell's blurred edge; this gives the half of the section that is nearer to
    /// the cell.
    #[inline(always)]
    fn taken(&self, per_alpha: f32, beyond: f32, [low, high]: [f32; 2]) -> (f32, f32) {
        let half = 0.5 * self.side;
        let (a, b) = ((low - beyond) * per_alpha, (high - beyond) * per_alpha);
        let (from, to) = (a.min(b).max(-half), a.max(b).min(half));
        match from < to {
            true => (from, to),
            false if from < half => (-half, 0.0),
            false => (0.0, half),
        }
    }

    /// Shares light out over the pixels of an image, by their overlap with it.
    #[inline(always)]
    fn share_out(
        &self,
        light: f32,
        [a, b]: [Vec2; 2],
        wanted: &impl Fn(u32) -> bool,
        found: &mut impl FnMut(u32, u32, f32),
    ) {
        let [width, height] = self.geometry.optics.sensor_px;
        let (first, last) = (a.min(b), a.max(b));
        let (columns, rows) = (pixels(first.x, last.x, width), pixels(first.y, last.y, height));
        let per_size = (last - first).max(Vec2::splat(LEAST_PX)).recip();
        for row in rows {
            let down = light * overlap(row, first.y, last.y, per_size.y);
            if down < LEAST || !wanted(row) {
                continue;
            }
            for column in columns.clone() {
                let weight = down * overlap(column, first.x, last.x, per_size.x);
                if weight > 0.0 {
                    found(column, row, weight);
                }
            }
        }
    }
}

/// The pixels of `count` that `[low, high]` touches.
#[inline(always)]
fn pixels(low: f32, high: f32, count: usize) -> Range<u32> {
    if high < 0.0 {
        return 0..0;
    }
    // A cast to u32 stops at 0.
    low as u32..(high as u32).saturating_add(1).min(count as u32)
}

/// The part of `[low, high]` that lies on a pixel, where `per_size` is 1 over the width.
#[inline(always)]
fn overlap(pixel: u32, low: f32, high: f32, per_size: f32) -> f32 {
    let pixel = pixel as f32;
    if high - low < LEAST_PX {
        return if low >= pixel && low < pixel + 1.0 { 1.0 } else { 0.0 };
    }
    ((high.min(pixel + 1.0) - low.max(pixel)) * per_size).max(0.0)
}
