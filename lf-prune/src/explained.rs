//! The share of a frame's light that the kept voxels explain.

use crate::plan::Support;
use glam::{DMat2, DVec2};
use lf_core::{Camera, Grid, Optics};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// About this many lit pixels are examined, spread evenly over those of the frame.
const PIXELS: usize = 2000;

/// A pixel is explained if its rays pass a kept voxel this near on the array, px: it may see the rim of a particle,
/// where noise has emptied the voxels.
const RIM_PX: f64 = 2.0;

/// With fewer pixels the share is unknown.
const FEWEST_PIXELS: usize = 30;

impl Support {
    /// The share of the light that falls on pixels which see a kept voxel. Pixels count that have at least `least`
    /// counts, each with at most `most`, so that no bright particle decides. A pixel counts only if all its rays stay
    /// within the sides of the grid. None if few pixels count.
    pub fn explained(
        &self,
        image: ArrayView2<f32>,
        camera: &Camera,
        grid: &Grid,
        [least, most]: [f32; 2],
    ) -> Option<f64> {
        let sight = Sight::new(camera, grid);
        let lit = || image.indexed_iter().filter(|(_, value)| **value >= least && **value > 0.0);
        let step = lit().count() / PIXELS + 1;
        let sample: Vec<_> = lit().step_by(step).map(|(place, value)| (place, value.min(most))).collect();
        let seen: Vec<(f64, bool)> = sample
            .par_iter()
            .filter_map(|((row, column), value)| {
                let paths = sight.paths(*column as u32, *row as u32)?;
                Some((f64::from(*value), paths.iter().any(|[first, end]| self.has_within(*first, *end))))
            })
            .collect();
        let light: f64 = seen.iter().map(|(light, _)| light).sum();
        let explained: f64 = seen.iter().filter(|(_, is_seen)| *is_seen).map(|(light, _)| light).sum();
        (seen.len() >= FEWEST_PIXELS).then(|| explained / light)
    }

    /// Whether a voxel with an index from `first` up to `end` is kept.
    fn has_within(&self, first: u64, end: u64) -> bool {
        let next = self.indices.partition_point(|index| *index < first);
        self.indices.get(next).is_some_and(|index| *index < end)
    }
}

/// The way from a pixel back to the voxels.
struct Sight<'a> {
    optics: Optics,
    grid: &'a Grid,
    /// Half a lenslet's cell and the rim of a particle, mm on the array.
    reach_mm: f64,
    stop_mm: f64,
    /// Distances on the sensor over those on the array.
    gain: f64,
}

impl<'a> Sight<'a> {
    fn new(camera: &Camera, grid: &'a Grid) -> Self {
        let optics = Optics::new(camera);
        let gain = optics.sensor_through(DVec2::Y, DVec2::Y, DVec2::ZERO).y;
        let reach_mm = 0.5 * camera.microlenses.pitch_mm + RIM_PX * camera.sensor.pixel_pitch_mm;
        Self { grid, reach_mm, stop_mm: camera.aperture_mm(), gain, optics }
    }

    /// The place in the stop whose light a pixel takes through the lenslet at `centre_mm`.
    fn stop_place(&self, sensor_mm: DVec2, centre_mm: DVec2) -> DVec2 {
        let through = |stop_mm: DVec2| self.optics.sensor_through(centre_mm, centre_mm, stop_mm);
        let origin = through(DVec2::ZERO);
        let [x, y] =
            [DVec2::X, DVec2::Y].map(|way| (through(0.5 * self.stop_mm * way) - origin) / (0.5 * self.stop_mm));
        DMat2::from_cols(x, y).inverse() * (sensor_mm - origin)
    }

    /// Ranges of voxel indices that a pixel sees, a row of a slice each. None if it sees anything beside the grid.
    fn paths(&self, column: u32, row: u32) -> Option<Vec<[u64; 2]>> {
        let sensor_mm = self.optics.centre_mm(column, row);
        let centre_mm = self.optics.lattice().nearest_centre_mm(sensor_mm / self.gain);
        let stop_mm = self.stop_place(sensor_mm, centre_mm);
        let [nx, ny, nz] = self.grid.shape;
        let mut paths = Vec::new();
        for z in 0..nz {
            let (middle, reach) = self.footprint(centre_mm, stop_mm, self.grid.centre_mm(2, z));
            let [x, y] = [middle.x, middle.y];
            let is_within = |at: f64, reach: f64, count: usize| at >= reach && at + reach <= (count - 1) as f64;
            if !is_within(x, reach.x, nx) || !is_within(y, reach.y, ny) {
                return None;
            }
            let range = |at: f64, reach: f64, count: usize| {
                (at - reach).floor().max(0.0) as usize..((at + reach).ceil() as usize + 1).min(count)
            };
            let along = range(x, reach.x, nx);
            let rows = range(y, reach.y, ny);
            paths.extend(rows.map(|y| {
                let first = self.grid.index([along.start, y, z]);
                [first, first + along.len() as u64]
            }));
        }
        Some(paths)
    }

    /// Middle and half sides, voxels, of the part of a slice whose rays through `stop_mm` meet the lenslet's cell.
    fn footprint(&self, centre_mm: DVec2, stop_mm: DVec2, z_mm: f64) -> (DVec2, DVec2) {
        let array = |object_mm: DVec2| self.optics.array_from_object(object_mm, z_mm, stop_mm);
        let [dx, dy, _] = self.grid.spacing_mm;
        let origin = array(DVec2::ZERO);
        let [x, y] = [DVec2::new(dx, 0.0), DVec2::new(0.0, dy)].map(|step| array(step) - origin);
        let back = DMat2::from_cols(x, y).inverse();
        let spacing = DVec2::new(dx, dy);
        let mut steps = back * (centre_mm - origin);
        steps += back * (centre_mm - array(steps * spacing));
        let middle = steps - DVec2::new(self.grid.origin_mm[0], self.grid.origin_mm[1]) / spacing;
        let reach = self.reach_mm * DVec2::new(1.0 / x.length(), 1.0 / y.length());
        (middle, reach)
    }
}
