//! Rays traced one by one, where the sums along lines are not sure.

use super::lattice_lines::{LineRays, Lines};
use super::views::{ROUNDING_PX, SEEN};
use glam::DVec2;
use std::ops::Range;

impl Lines<'_> {
    /// The first voxel whose ray passes the second of two cells. Near their edge, that voxel's ray decides.
    #[inline(never)]
    pub(super) fn first_beyond(
        &self,
        rays: &LineRays,
        tolerance: f64,
        place: f64,
        voxel: usize,
        [old, new]: [(i64, i64); 2],
    ) -> usize {
        if (place - place.round()).abs() > tolerance {
            return voxel;
        }
        let voxel = place.round().clamp(0.0, self.last_x()) as usize;
        let nearest = self.optics.lattice().nearest_centre_mm(self.array_mm(rays, voxel));
        let distance = |(lenslet, row)| nearest.distance_squared(self.views.lattice.centre_mm(lenslet, row));
        voxel + usize::from(distance(old) < distance(new))
    }

    #[inline(always)]
    fn light(&self, pixel: Option<(usize, usize)>) -> i64 {
        pixel.map_or(0, |(column, row)| SEEN - i64::from(self.levels.values[row * self.levels.width + column]))
    }

    /// Where the ray of a voxel meets the array, mm.
    #[inline(always)]
    pub(super) fn array_mm(&self, rays: &LineRays, x: usize) -> DVec2 {
        let [first_x, first_y] = self.first;
        let point = DVec2::new(self.grid.centre_mm(0, first_x + x), self.grid.centre_mm(1, first_y + rays.y));
        self.rays.array_mm(point, self.views.sections_mm[rays.section]) + self.shift_mm
    }

    /// Where a ray that meets the perfect lattice at `array_mm`, in the cell of `centre_mm`, meets the sensor, mm. The
    /// lenslet departs from there to `departed_mm` with all that its cell holds.
    #[inline(always)]
    fn sensor_mm(&self, centre_mm: DVec2, departed_mm: DVec2, array_mm: DVec2, section_mm: DVec2) -> DVec2 {
        self.optics.sensor_through(departed_mm, array_mm + (departed_mm - centre_mm), section_mm)
    }

    /// Notes the rays through one lenslet that may meet several pixels; `centre` in voxels from the line's first.
    #[inline(always)]
    pub(super) fn note_mixed(&self, rays: &LineRays, centre: DVec2, (lenslet, row): (i64, i64), changes: &mut [i64]) {
        let centre_mm = self.views.lattice.centre_mm(lenslet, row);
        let (low, high) = self.cell.ends(-centre.y);
        let (low, high) = ((centre.x + low).max(-0.5), (centre.x + high).min(self.last_x() + 0.5));
        let tolerance = self.tolerance;
        if low > high + 2.0 * tolerance {
            return;
        }
        let is_near = |place: f64| (place - (place + 0.5).floor()).abs() < tolerance;
        if is_near(low) || is_near(high) {
            return self.note_rays(rays, Some(centre_mm), (low - tolerance, high + tolerance), changes);
        }
        let run = low.ceil() as usize..high.ceil() as usize;
        if !run.is_empty() && !self.note_run(rays, centre_mm, run.clone(), changes) {
            self.note_rays(rays, Some(centre_mm), (run.start as f64, (run.end - 1) as f64), changes);
        }
    }

    /// Notes a run of voxels whose rays pass one lenslet, if they meet one pixel or two. False if rounding may decide.
    #[inline(always)]
    fn note_run(&self, rays: &LineRays, centre_mm: DVec2, run: Range<usize>, changes: &mut [i64]) -> bool {
        let section_mm = self.views.sections_mm[rays.section];
        let departed_mm = self.views.measured.departed(centre_mm);
        let place_px =
            |x: usize| self.optics.place_px(self.sensor_mm(centre_mm, departed_mm, self.array_mm(rays, x), section_mm));
        // Along the run a ray's place on the sensor only rises or only falls.
        let (first, last) = (place_px(run.start), place_px(run.end - 1));
        let is_sure = |place: DVec2| {
            let part = place - place.floor();
            part.min_element() > ROUNDING_PX && part.max_element() < 1.0 - ROUNDING_PX
        };
        if !(is_sure(first) && is_sure(last)) {
            return false;
        }
        let mut add = |run: Range<usize>, place: DVec2| {
            let light = self.light(self.optics.pixel_under(place));
            changes[run.start] += light;
            changes[run.end] -= light;
        };
        if first.floor() == last.floor() {
            add(run, first);
            return true;
        }
        // The run passes from one pixel to the next, whose edge lies between them.
        let edge = first.x.floor().max(last.x.floor());
        let way = (edge - first.x) / (last.x - first.x) * (run.len() - 1) as f64;
        let turn = run.start + (way.ceil() as usize).clamp(1, run.len() - 1);
        let (before, after) = (place_px(turn - 1), place_px(turn));
        let is_turn =
            is_sure(before) && is_sure(after) && before.floor() == first.floor() && after.floor() == last.floor();
        if is_turn {
            add(run.start..turn, first);
            add(turn..run.end, last);
        }
        is_turn
    }

    /// Notes the voxels within `reach` one by one: those whose rays pass the lenslet at `centre_mm`, or all if None.
    #[inline(never)]
    pub(super) fn note_rays(&self, rays: &LineRays, centre_mm: Option<DVec2>, reach: (f64, f64), changes: &mut [i64]) {
        let section_mm = self.views.sections_mm[rays.section];
        let near_mm2 = 0.01 * self.views.lattice.along_mm.length_squared();
        let first = reach.0.ceil().max(0.0) as usize;
        let end = ((reach.1.floor() + 1.0).max(0.0) as usize).min(changes.len() - 1);
        for x in first..end {
            let array_mm = self.array_mm(rays, x);
            let nearest = self.optics.lattice().nearest_centre_mm(array_mm);
            if centre_mm.is_none_or(|centre_mm| nearest.distance_squared(centre_mm) < near_mm2) {
                let departed_mm = self.views.measured.departed(nearest);
                let sensor_mm = self.sensor_mm(nearest, departed_mm, array_mm, section_mm);
                let light = self.light(self.optics.pixel_at(sensor_mm));
                changes[x] += light;
                changes[x + 1] -= light;
            }
        }
    }
}
