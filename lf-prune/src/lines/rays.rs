//! Rays traced one by one, where runs are not sure.

use super::{Lines, Section, Turning};
use crate::views::{ROUNDING_PX, SEEN};
use glam::DVec2;
use std::ops::Range;

impl Lines<'_> {
    /// The first voxel whose ray passes through the second of two cells, by the ray of a voxel at their edge.
    #[inline(never)]
    pub(super) fn first_beyond(
        &self,
        turning: &Turning,
        place: f64,
        voxel: usize,
        [old, new]: [(i64, i64); 2],
    ) -> usize {
        if (place - place.round()).abs() > turning.unsure {
            return voxel;
        }
        let voxel = place.round().clamp(0.0, self.last_x()) as usize;
        let nearest = self.optics.lattice().nearest_centre_mm(self.array_mm(turning.section, voxel));
        let [old, new] = [old, new].map(|(lenslet, row)| nearest.distance_squared(self.views.centre_mm(lenslet, row)));
        voxel + usize::from(old < new)
    }

    /// Light of the pixel under a place, none beside the sensor.
    #[inline(always)]
    pub(super) fn light(&self, pixel: Option<(usize, usize)>) -> i64 {
        pixel.map_or(0, |(column, row)| SEEN - i64::from(self.levels.values[row * self.levels.width + column]))
    }

    /// Where the ray of a voxel meets the array, mm.
    #[inline(always)]
    pub(super) fn array_mm(&self, section: &Section, x: usize) -> DVec2 {
        let [first_x, first_y] = self.first;
        let point = DVec2::new(self.grid.centre_mm(0, first_x + x), self.grid.centre_mm(1, first_y + section.y));
        // As [`lf_core::optics::Optics::array_from_object`], to the bit.
        -self.beta * point + self.alpha * self.views.sections_mm[section.section] + self.shift_mm
    }

    /// Where a ray that meets the array at a place of the perfect lattice meets the sensor: by the lenslet that departs from
    /// `centre_mm` with all that its cell holds. As [`lf_core::optics::Optics::sensor_from_array`], to the bit.
    #[inline(always)]
    fn sensor_mm(&self, centre_mm: DVec2, array_mm: DVec2, section_mm: DVec2) -> DVec2 {
        let departed = self.views.measured.departed(centre_mm);
        departed + self.optics.demagnification() * (array_mm + (departed - centre_mm) - section_mm)
    }

    /// Notes the rays through one lenslet where they may meet more than one pixel; `centre` is its, from the line's first
    /// voxel.
    #[inline(always)]
    pub(super) fn note_several(&self, section: &Section, centre: DVec2, (lenslet, row): (i64, i64), notes: &mut [i64]) {
        let centre_mm = self.views.centre_mm(lenslet, row);
        let (low, high) = self.cell.ends(-centre.y);
        let (low, high) = ((centre.x + low).max(-0.5), (centre.x + high).min(self.last_x() + 0.5));
        let unsure = self.unsure;
        if low > high + 2.0 * unsure {
            return;
        }
        let near = |place: f64| (place - (place + 0.5).floor()).abs() < unsure;
        if near(low) || near(high) {
            return self.note_rays(section, centre_mm, (low - unsure, high + unsure), notes);
        }
        let run = low.ceil() as usize..high.ceil() as usize;
        if run.is_empty() {
            return;
        }
        let section_mm = self.views.sections_mm[section.section];
        let [width, height] = self.optics.sensor_px().map(|side| side as f64);
        let k_px = self.optics.demagnification() * self.pixels_per_mm;
        let departed = self.views.measured.departed(centre_mm);
        let base = departed * self.pixels_per_mm + 0.5 * DVec2::new(width, height);
        let place = |x: usize| base + k_px * (self.array_mm(section, x) + (departed - centre_mm) - section_mm);
        let pixel = |place: DVec2| {
            let inside = place.x >= 0.0 && place.y >= 0.0 && place.x < width && place.y < height;
            inside.then_some((place.x as usize, place.y as usize))
        };
        // A ray's place on the sensor only rises or only falls along the run.
        let (first, last) = (place(run.start), place(run.end - 1));
        let sure = |place: DVec2| {
            let part = place - place.floor();
            part.min_element() > ROUNDING_PX && part.max_element() < 1.0 - ROUNDING_PX
        };
        let mut add = |run: Range<usize>, place: DVec2| {
            let light = self.light(pixel(place));
            notes[run.start] += light;
            notes[run.end] -= light;
        };
        if sure(first) && sure(last) {
            if first.floor() == last.floor() {
                return add(run, first);
            }
            // It passes from one pixel to the next, whose edge is between them.
            let edge = first.x.floor().max(last.x.floor());
            let way = (edge - first.x) / (last.x - first.x) * (run.len() - 1) as f64;
            let turn = run.start + (way.ceil() as usize).clamp(1, run.len() - 1);
            let (before, after) = (place(turn - 1), place(turn));
            if sure(before) && sure(after) && before.floor() == first.floor() && after.floor() == last.floor() {
                add(run.start..turn, first);
                return add(turn..run.end, last);
            }
        }
        self.note_rays(section, centre_mm, (run.start as f64, (run.end - 1) as f64), notes);
    }

    /// Notes the rays of all voxels, one by one.
    #[inline(never)]
    pub(super) fn note_all(&self, section: &Section, notes: &mut [i64]) {
        for x in 0..notes.len() - 1 {
            let section_mm = self.views.sections_mm[section.section];
            let array_mm = self.array_mm(section, x);
            let nearest = self.optics.lattice().nearest_centre_mm(array_mm);
            let place_mm = self.sensor_mm(nearest, array_mm, section_mm);
            let light = self.light(self.optics.pixel_at(place_mm));
            notes[x] += light;
            notes[x + 1] -= light;
        }
    }

    /// Notes those voxels within `reach` whose rays go through one lenslet, one by one.
    #[inline(never)]
    pub(super) fn note_rays(&self, section: &Section, centre_mm: DVec2, reach: (f64, f64), notes: &mut [i64]) {
        let near_mm2 = 0.01 * self.views.along_mm.length_squared();
        let first = reach.0.ceil().max(0.0) as usize;
        let end = ((reach.1.floor() + 1.0).max(0.0) as usize).min(notes.len() - 1);
        for x in first..end {
            let array_mm = self.array_mm(section, x);
            let nearest = self.optics.lattice().nearest_centre_mm(array_mm);
            if nearest.distance_squared(centre_mm) < near_mm2 {
                let place_mm = self.sensor_mm(nearest, array_mm, self.views.sections_mm[section.section]);
                let light = self.light(self.optics.pixel_at(place_mm));
                notes[x] += light;
                notes[x + 1] -= light;
            }
        }
    }
}
