//! Scores ray by ray: slow and obvious, to check the fast way.

use super::scorer::Scorer;
use super::shades::Shades;
use glam::DVec2;
use lf_core::views::Sections;
use lf_core::{Camera, Optics};

/// Distance that a ray of the fast way may have from the exact one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tolerance {
    /// On the array, px.
    pub(crate) array_px: f64,
    /// On the sensor, px.
    pub(crate) sensor_px: f64,
    /// Chief rays closer than this to the edge of a place of the raster may belong to the next place; in places.
    pub(crate) raster: f64,
}

/// Smallest and largest sums over a voxel's rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub(crate) shades: [u32; 2],
    pub(crate) seen: [u32; 2],
}

/// Corners of a square about the origin with sides of 2.
const CORNERS: [DVec2; 4] = [DVec2::ONE, DVec2::NEG_ONE, DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0)];

pub(crate) struct Oracle<'a> {
    scorer: &'a Scorer<'a>,
    shades: &'a Shades<'a>,
    sections_mm: Vec<DVec2>,
    camera: &'a Camera,
    optics: Optics,
    tolerance: Tolerance,
}

/// A place and four around it.
fn around(place: DVec2, reach: f64) -> impl Iterator<Item = DVec2> {
    CORNERS.into_iter().chain([DVec2::ZERO]).map(move |way| place + reach * way)
}

impl<'a> Oracle<'a> {
    pub(crate) fn new(
        scorer: &'a Scorer<'a>,
        shades: &'a Shades<'a>,
        sections: &Sections,
        camera: &'a Camera,
        tolerance: Tolerance,
    ) -> Self {
        let optics = Optics::new(camera);
        Self { scorer, shades, sections_mm: sections.traced_mm(), camera, optics, tolerance }
    }

    /// The step on the perfect lattice, mm, from a voxel's chief ray to the place of the raster that stands for it.
    /// None if that place is uncertain.
    pub(crate) fn to_raster_mm(&self, voxel: DVec2, z: usize) -> Option<DVec2> {
        let (rays, scale) = (self.scorer.slices.rays(z), self.scorer.slices.raster.scale());
        let place = rays.chief(voxel);
        let within = scale * place - (scale * place).floor();
        let is_sure =
            within.min_element() > self.tolerance.raster && within.max_element() < 1.0 - self.tolerance.raster;
        is_sure.then(|| rays.cells.step_mm((DVec2::splat(0.5) - within) / scale))
    }

    /// Sums over the rays of a voxel, moved to its place of the raster. None if that place is uncertain.
    pub(crate) fn bounds(&self, [x, y]: [usize; 2], z: usize) -> Option<Bounds> {
        let grid = self.scorer.slices.grid;
        let step_mm = self.to_raster_mm(DVec2::new(x as f64, y as f64), z)?;
        let point_mm = DVec2::new(grid.centre_mm(0, x), grid.centre_mm(1, y));
        let lattice = self.optics.lattice();
        let perfect = Camera { centres: None, ..self.camera.clone() }.lattice();
        let pixel_mm = self.camera.sensor.pixel_pitch_mm;
        let mut bounds = Bounds { shades: [0; 2], seen: [0; 2] };
        for section_mm in &self.sections_mm {
            let array_mm = self.optics.array_from_object(point_mm, grid.centre_mm(2, z), *section_mm);
            let (mut shades, mut seen) = ([u32::MAX, 0], [1, 0]);
            for place_mm in around(lattice.perfect(array_mm) + step_mm, self.tolerance.array_px * pixel_mm) {
                let cell_mm = perfect.nearest_centre_mm(place_mm);
                let centre_mm = lattice.departed(cell_mm);
                let hit_mm = self.optics.sensor_through(centre_mm, centre_mm + place_mm - cell_mm, *section_mm);
                for place in around(self.optics.place_px(hit_mm), self.tolerance.sensor_px) {
                    let pixel = self.optics.pixel_under(place);
                    let shade = pixel.map_or(0, |(column, row)| self.shades.values[row * self.shades.width + column]);
                    shades = [shades[0].min(shade.into()), shades[1].max(shade.into())];
                    seen = [seen[0].min(pixel.is_some().into()), seen[1].max(pixel.is_some().into())];
                }
            }
            for end in 0..2 {
                bounds.shades[end] += shades[end];
                bounds.seen[end] += seen[end];
            }
        }
        Some(bounds)
    }
}
