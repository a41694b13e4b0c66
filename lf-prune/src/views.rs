//! What each section of the aperture sees through each lenslet: the image once, sorted by section.
//!
//! A ray's place in its cell moves it by k of that on the sensor, some hundredths of a pixel: the rays of one section
//! through one lenslet meet one pixel, whatever voxel they come from. Where they may meet several, the view says so.

use crate::Levels;
use crate::sections::Sections;
use glam::DVec2;
use lf_core::camera::Camera;
use lf_core::lattice::Lattice;
use lf_core::optics::Optics;
use rayon::prelude::*;
use std::ops::Range;

/// Light of a ray that is seen, beside which there is room for the sum of all levels, turned positive.
pub(crate) const SEEN: i64 = 1 << 44;

/// Pixels that rounding moves no ray by.
pub(crate) const ROUNDING_PX: f64 = 1e-6;

/// Lenslets at either end of a row, none of which is seen, so that neighbours of all others are known.
const PADDING: i64 = 4;

/// The lattice in rows, those nearest to x, and each section's light.
pub(crate) struct Views {
    /// Rays of the camera as if no lenslet departed and no image were distorted.
    pub(crate) optics: Optics,
    /// Where lenslets really are.
    pub(crate) measured: Lattice,
    /// Centre of lenslet 0 of row 0, mm.
    pub(crate) origin_mm: DVec2,
    /// From lenslet to lenslet of a row, mm.
    pub(crate) along_mm: DVec2,
    /// From row to row, mm.
    pub(crate) across_mm: DVec2,
    /// 1 / (area of a cell), with the sign of the turn from `along_mm` to `across_mm`, 1/mm^2.
    per_area: f64,
    /// Centres of the sections inside the stop, mm.
    pub(crate) sections_mm: Vec<DVec2>,
    first_row: i64,
    /// First lenslet of each row.
    first: Vec<i64>,
    /// Lenslets of a row.
    length: usize,
    /// Section after section, row after row: [`SEEN`] less the level; 0 where rays miss the sensor or may meet several
    /// pixels.
    lights: Vec<i64>,
    /// Lenslets whose rays may meet several pixels, for each row of each section, rising.
    several: Vec<Vec<i64>>,
}

/// The least and the greatest n, not rounded, for which `low <= start + n step <= high`.
#[inline(always)]
pub(crate) fn between(start: f64, per_step: f64, low: f64, high: f64) -> (f64, f64) {
    let (a, b) = ((low - start) * per_step, (high - start) * per_step);
    if a < b { (a, b) } else { (b, a) }
}

/// 1 / `step`; a step of next to nothing counts as a very small one.
pub(crate) fn per_step(step: f64) -> f64 {
    const LARGEST: f64 = 1e12;
    (1.0 / step).clamp(-LARGEST, LARGEST)
}

/// The camera without what moves lenslets or voxels by little from one to the next.
pub(crate) fn straightened(camera: &Camera) -> Camera {
    Camera { centres: None, distortion: None, ..camera.clone() }
}

impl Views {
    /// For a camera whose rays are straight but for distortion: see [`Camera::bends`]. Places are those of the perfect
    /// lattice, from which lenslets may depart.
    pub(crate) fn new(levels: &Levels, camera: &Camera) -> Self {
        let (measured, camera) = (camera.lattice(), &straightened(camera));
        let optics = Optics::new(camera);
        let lattice = optics.lattice();
        let cell_mm = lattice.cell_mm();
        let origin_mm = lattice.centre_mm(0, 0);
        let mut along_mm = lattice.centre_mm(1, 0) - origin_mm;
        let mut across_mm = lattice.centre_mm(0, 1) - origin_mm;
        // A square lattice is its own likeness turned by a right angle, a hexagonal one by a sixth of a turn.
        for _ in 0..cell_mm.len() {
            if along_mm.y.abs() > along_mm.x.abs() * (1.001 * std::f64::consts::PI / cell_mm.len() as f64).tan() {
                let next = if cell_mm.len() == 4 { -along_mm } else { across_mm - along_mm };
                (along_mm, across_mm) = (across_mm, next);
            }
        }

        // Image of a lenslet's centre: c (1 + k) - k U. A cell beyond these sides shows none of its rays on the sensor.
        let k = optics.demagnification();
        let cell_reach = cell_mm.iter().fold(DVec2::ZERO, |reach, corner| reach.max(corner.abs()));
        let [width, height] = optics.sensor_px();
        let half_sensor = 0.5 * camera.sensor.pixel_pitch_mm * DVec2::new(width as f64, height as f64);
        let departure = |side: DVec2| (measured.departed(side * half_sensor) - side * half_sensor).abs().max_element();
        let departures = [DVec2::ONE, DVec2::NEG_ONE, DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0)].map(departure);
        let departure = departures.iter().fold(0.0, |most: f64, departure| most.max(2.0 * departure));
        let sides = half_sensor + k * optics.half_aperture_mm() + cell_reach + departure;
        let corners = [sides, DVec2::new(sides.x, -sides.y)];
        let reach_rows = corners.map(|corner| (along_mm.perp_dot(corner) / along_mm.perp_dot(across_mm)).abs());
        let middle_row = -along_mm.perp_dot(origin_mm) / along_mm.perp_dot(across_mm);
        let reach_rows = reach_rows[0].max(reach_rows[1]);
        let first_row = (middle_row - reach_rows).ceil() as i64;
        // Two more at either end: a ray that leaves a row enters the next, whose neighbours are known too.
        let rows = first_row - 2..=(middle_row + reach_rows).floor() as i64 + 2;
        let first_row = *rows.start();
        let per_along = per_step(along_mm.x);
        let of_row = |row: i64| (-origin_mm.x - row as f64 * across_mm.x) * per_along - sides.x * per_along.abs();
        let first: Vec<i64> = rows.map(|row| of_row(row).floor() as i64 - PADDING).collect();
        let length = (2.0 * sides.x * per_along.abs()).ceil() as usize + 2 * PADDING as usize + 2;

        let sections_mm = Sections::new(camera, levels.options.sections).inside_mm();
        let count = first.len();
        let mut views = Self {
            optics,
            measured,
            origin_mm,
            along_mm,
            across_mm,
            per_area: 1.0 / along_mm.perp_dot(across_mm),
            first_row,
            first,
            length,
            lights: vec![0; sections_mm.len() * count * length],
            several: vec![Vec::new(); sections_mm.len() * count],
            sections_mm,
        };
        let mut lights = std::mem::take(&mut views.lights);
        let mut several = std::mem::take(&mut views.several);
        let reach_px = DVec2::splat(ROUNDING_PX) + k * cell_reach / camera.sensor.pixel_pitch_mm;
        lights.par_chunks_mut(length).zip(&mut several).enumerate().for_each(|(n, (lights, several))| {
            let (section_mm, row) = (views.sections_mm[n / count], n % count);
            for (light, lenslet) in lights.iter_mut().zip(views.first[row]..) {
                let centre = views.measured.departed(views.centre_mm(lenslet, first_row + row as i64));
                let place = views.optics.place_px(centre + k * (centre - section_mm));
                match light_of(levels, place, reach_px, [width, height]) {
                    Some(found) => *light = found,
                    None => several.push(lenslet),
                }
            }
        });
        Self { lights, several, ..views }
    }

    /// Centre of a lenslet of a row, mm.
    pub(crate) fn centre_mm(&self, lenslet: i64, row: i64) -> DVec2 {
        self.origin_mm + lenslet as f64 * self.along_mm + row as f64 * self.across_mm
    }

    /// Number in its row, and row, of the lenslet at a centre.
    #[inline(always)]
    pub(crate) fn lenslet(&self, centre_mm: DVec2) -> (i64, i64) {
        let way = centre_mm - self.origin_mm;
        let (lenslet, row) = (way.perp_dot(self.across_mm), self.along_mm.perp_dot(way));
        let (lenslet, row) = (lenslet * self.per_area, row * self.per_area);
        ((lenslet + 0.5).floor() as i64, (row + 0.5).floor() as i64)
    }

    /// Rows all of whose neighbours are known.
    pub(crate) fn rows(&self) -> Range<i64> {
        self.first_row + 1..self.first_row + self.first.len() as i64 - 1
    }

    /// Lenslets of a row all of whose neighbours are known; beyond them none is seen.
    #[inline(always)]
    pub(crate) fn lenslets(&self, row: i64) -> Range<i64> {
        let first = self.first[(row - self.first_row) as usize];
        first + PADDING - 1..first + self.length as i64 - PADDING + 1
    }

    /// A section's light through lenslets of a row.
    #[inline(always)]
    pub(crate) fn lights(&self, section: usize, row: i64, lenslets: Range<i64>) -> &[i64] {
        let row = (row - self.first_row) as usize;
        let place = (section * self.first.len() + row) * self.length;
        let place = |lenslet: i64| place + (lenslet - self.first[row]) as usize;
        &self.lights[place(lenslets.start)..place(lenslets.end)]
    }

    /// A section's light through a lenslet, none if it is not known.
    #[inline(always)]
    pub(crate) fn light(&self, section: usize, (lenslet, row): (i64, i64)) -> i64 {
        if !self.rows().contains(&row) || !self.lenslets(row).contains(&lenslet) {
            return 0;
        }
        self.lights(section, row, lenslet..lenslet + 1)[0]
    }

    /// Lenslets of a row through which a section's rays may meet several pixels.
    #[inline(always)]
    pub(crate) fn several(&self, section: usize, row: i64) -> &[i64] {
        &self.several[section * self.first.len() + (row - self.first_row) as usize]
    }
}

/// Light of the pixel at a place; 0 where there is none, none where there may be several within the reach.
fn light_of(levels: &Levels, place: DVec2, reach: DVec2, size: [usize; 2]) -> Option<i64> {
    let size = DVec2::new(size[0] as f64, size[1] as f64);
    let (low, high) = ((place - reach).floor(), (place + reach).floor());
    if high.min_element() < 0.0 || low.cmpge(size).any() {
        return Some(0);
    }
    (low == high).then(|| SEEN - i64::from(levels.values[low.y as usize * levels.width + low.x as usize]))
}
