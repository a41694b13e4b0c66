//! The light that each section of the aperture sees through each lenslet: the image once, sorted by section.
//!
//! A ray's place in its lenslet's cell moves it by k times as much on the sensor, some hundredths of a pixel. So the
//! rays of one section through one lenslet usually meet one pixel, from any voxel. The other lenslets are listed.

use crate::score::{levels::Levels, slice::Sections};
use glam::DVec2;
use lf_core::{Camera, Optics, lattice::Lattice};
use rayon::prelude::*;
use std::ops::Range;

/// Light of a ray that meets the sensor. The sum of all levels, turned positive, has room below it.
pub(super) const SEEN: i64 = 1 << 44;

/// Tolerance on the sensor, px; rounding moves no ray farther.
pub(super) const ROUNDING_PX: f64 = 1e-6;

/// Unseen lenslets at either end of a row, so that the neighbours of all others are known.
const PADDING: i64 = 4;

pub(crate) struct Views {
    /// Rays of the camera without distortion and departures of lenslets.
    pub(super) optics: Optics,
    /// The lattice with its departures.
    pub(super) measured: Lattice,
    pub(super) lattice: Rows,
    /// Centres of the sections that are traced, mm.
    pub(super) sections_mm: Vec<DVec2>,
    /// Section after section, row after row: [`SEEN`] less the level; 0 beside the sensor or if pixels may be several.
    lights: Vec<i64>,
    /// Lenslets whose rays may meet several pixels, for each row of each section, rising.
    mixed: Vec<Vec<i64>>,
}

/// The rows of a lattice, nearly along x, that the sensor sees.
pub(super) struct Rows {
    /// Centre of lenslet 0 of row 0, mm.
    pub(super) origin_mm: DVec2,
    /// From lenslet to lenslet of a row, mm.
    pub(super) along_mm: DVec2,
    /// From row to row, mm.
    pub(super) across_mm: DVec2,
    /// 1 / (area of a cell), with the sign of the turn from `along_mm` to `across_mm`, 1/mm^2.
    per_area: f64,
    first_row: i64,
    /// First lenslet of each row.
    first: Vec<i64>,
    /// Lenslets of a row.
    length: usize,
}

/// The least and the greatest n, not rounded, with `low <= start + n step <= high`.
#[inline(always)]
pub(super) fn between(start: f64, per_step: f64, low: f64, high: f64) -> (f64, f64) {
    let (a, b) = ((low - start) * per_step, (high - start) * per_step);
    if a < b { (a, b) } else { (b, a) }
}

/// 1 / `step`, limited for a step near 0.
pub(super) fn per_step(step: f64) -> f64 {
    const LARGEST: f64 = 1e12;
    (1.0 / step).clamp(-LARGEST, LARGEST)
}

/// The camera without distortion and departures of lenslets, which change slowly over the image.
pub(crate) fn straightened(camera: &Camera) -> Camera {
    Camera { centres: None, distortion: None, ..camera.clone() }
}

impl Rows {
    /// The rows of a lattice seen by a sensor, for cells within `sides` mm of the axis.
    fn new(lattice: &Lattice, sides: DVec2) -> Self {
        let origin_mm = lattice.centre_mm(0, 0);
        let [along_mm, across_mm] = Self::directions(lattice);
        let rows = |way: DVec2| along_mm.perp_dot(way) / along_mm.perp_dot(across_mm);
        let reach_rows = rows(sides).abs().max(rows(DVec2::new(sides.x, -sides.y)).abs());
        let middle_row = rows(-origin_mm);
        let first_row = (middle_row - reach_rows).ceil() as i64;
        // Two more at either end: a ray that leaves a row enters the next, whose neighbours must be known too.
        let rows = first_row - 2..=(middle_row + reach_rows).floor() as i64 + 2;
        let first_row = *rows.start();
        let per_along = per_step(along_mm.x);
        let left = |row: i64| (-origin_mm.x - row as f64 * across_mm.x) * per_along - sides.x * per_along.abs();
        let first: Vec<i64> = rows.map(|row| left(row).floor() as i64 - PADDING).collect();
        let length = (2.0 * sides.x * per_along.abs()).ceil() as usize + 2 * PADDING as usize + 2;
        let per_area = 1.0 / along_mm.perp_dot(across_mm);
        Self { origin_mm, along_mm, across_mm, per_area, first_row, first, length }
    }

    /// `[along_mm, across_mm]` of the rows nearest to x.
    fn directions(lattice: &Lattice) -> [DVec2; 2] {
        let origin = lattice.centre_mm(0, 0);
        let mut along = lattice.centre_mm(1, 0) - origin;
        let mut across = lattice.centre_mm(0, 1) - origin;
        // A square lattice is symmetric under a quarter of a turn, a hexagonal one under a sixth.
        let corners = lattice.cell_mm().len();
        for _ in 0..corners {
            if along.y.abs() > along.x.abs() * (1.001 * std::f64::consts::PI / corners as f64).tan() {
                let next = if corners == 4 { -along } else { across - along };
                (along, across) = (across, next);
            }
        }
        [along, across]
    }

    pub(super) fn centre_mm(&self, lenslet: i64, row: i64) -> DVec2 {
        self.origin_mm + lenslet as f64 * self.along_mm + row as f64 * self.across_mm
    }
}

impl Views {
    /// For a camera whose rays are straight except for distortion: see [`Camera::bends`].
    pub(crate) fn new(levels: &Levels, sections: &Sections, camera: &Camera) -> Self {
        let (measured, optics) = (camera.lattice(), Optics::new(&straightened(camera)));
        let k = optics.demagnification;
        let cell_reach = optics.lattice().cell_mm().iter().fold(DVec2::ZERO, |reach, corner| reach.max(corner.abs()));
        let rows = Rows::new(optics.lattice(), seen_sides(&optics, &measured, cell_reach));
        let sections_mm = sections.traced_mm();
        let (count, length) = (rows.first.len(), rows.length);
        let mut lights = vec![0; sections_mm.len() * count * length];
        let mut mixed = vec![Vec::new(); sections_mm.len() * count];
        let reach_px = DVec2::splat(ROUNDING_PX) + k * cell_reach / camera.sensor.pixel_pitch_mm;
        lights.par_chunks_mut(length).zip(&mut mixed).enumerate().for_each(|(n, (lights, mixed))| {
            let (section_mm, row) = (sections_mm[n / count], n % count);
            for (light, lenslet) in lights.iter_mut().zip(rows.first[row]..) {
                // The image of a lenslet's centre: c (1 + k) - k U.
                let centre = measured.departed(rows.centre_mm(lenslet, rows.first_row + row as i64));
                let place = optics.place_px(centre + k * (centre - section_mm));
                match light_at(levels, place, reach_px, optics.sensor_px) {
                    Some(found) => *light = found,
                    None => mixed.push(lenslet),
                }
            }
        });
        Self { optics, measured, lattice: rows, sections_mm, lights, mixed }
    }

    /// The lenslet at a centre: its number in its row, and its row.
    #[inline(always)]
    pub(super) fn lenslet(&self, centre_mm: DVec2) -> (i64, i64) {
        let Rows { origin_mm, along_mm, across_mm, per_area, .. } = self.lattice;
        let way = centre_mm - origin_mm;
        let (lenslet, row) = (way.perp_dot(across_mm) * per_area, along_mm.perp_dot(way) * per_area);
        ((lenslet + 0.5).floor() as i64, (row + 0.5).floor() as i64)
    }

    /// The rows whose neighbours are all known.
    pub(super) fn rows(&self) -> Range<i64> {
        self.lattice.first_row + 1..self.lattice.first_row + self.lattice.first.len() as i64 - 1
    }

    /// The lenslets of a row whose neighbours are all known. Beyond them none is seen.
    #[inline(always)]
    pub(super) fn lenslets(&self, row: i64) -> Range<i64> {
        let first = self.lattice.first[(row - self.lattice.first_row) as usize];
        first + PADDING - 1..first + self.lattice.length as i64 - PADDING + 1
    }

    /// A section's light through lenslets of a row.
    #[inline(always)]
    pub(super) fn lights(&self, section: usize, row: i64, lenslets: Range<i64>) -> &[i64] {
        let row = (row - self.lattice.first_row) as usize;
        let place = (section * self.lattice.first.len() + row) * self.lattice.length;
        let place = |lenslet: i64| place + (lenslet - self.lattice.first[row]) as usize;
        &self.lights[place(lenslets.start)..place(lenslets.end)]
    }

    /// A section's light through a lenslet; 0 if it is not known.
    #[inline(always)]
    pub(super) fn light(&self, section: usize, (lenslet, row): (i64, i64)) -> i64 {
        if !self.rows().contains(&row) || !self.lenslets(row).contains(&lenslet) {
            return 0;
        }
        self.lights(section, row, lenslet..lenslet + 1)[0]
    }

    #[inline(always)]
    pub(super) fn mixed(&self, section: usize, row: i64) -> &[i64] {
        &self.mixed[section * self.lattice.first.len() + (row - self.lattice.first_row) as usize]
    }
}

/// Half sides of the part of the array that the sensor sees, mm. No ray through a cell beyond meets the sensor.
fn seen_sides(optics: &Optics, measured: &Lattice, cell_reach: DVec2) -> DVec2 {
    let [width, height] = optics.sensor_px;
    let half_sensor = 0.5 * optics.pixel_pitch_mm * DVec2::new(width as f64, height as f64);
    let departure = |side: DVec2| (measured.departed(side * half_sensor) - side * half_sensor).abs().max_element();
    let sides = [DVec2::ONE, DVec2::NEG_ONE, DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0)];
    let departure = sides.into_iter().map(departure).fold(0.0, |most: f64, departure| most.max(2.0 * departure));
    half_sensor + optics.demagnification * optics.half_aperture_mm + cell_reach + departure
}

/// Light of the pixel at a place; 0 beside the sensor. None if there may be several pixels within the reach.
fn light_at(levels: &Levels, place: DVec2, reach: DVec2, size: [usize; 2]) -> Option<i64> {
    let size = DVec2::new(size[0] as f64, size[1] as f64);
    let (low, high) = ((place - reach).floor(), (place + reach).floor());
    if high.min_element() < 0.0 || low.cmpge(size).any() {
        return Some(0);
    }
    (low == high).then(|| SEEN - i64::from(levels.values[low.y as usize * levels.width + low.x as usize]))
}
