//! The rays of the views: the pixel that each section sees through each lenslet.

use super::cells::Cells;
use super::plan::{LANES, ViewsPlan};
use crate::{Camera, Optics};
use glam::DVec2;
use rayon::prelude::*;

/// The rays of all views of some sections. Views are lines of lenslets: by group of lenslets, row j, section, and part
/// of the cells. In this order the views that a voxel needs lie near each other, in few pages of memory.
pub struct ViewRays<'a> {
    optics: Optics,
    sections_mm: &'a [DVec2],
    /// From a lenslet's centre to the middle of each part of its cell, mm.
    parts_mm: Vec<DVec2>,
    /// Centres of the lenslets, mm.
    centres: Vec<DVec2>,
    width: usize,
}

impl<'a> ViewRays<'a> {
    /// The rays of the views that `plan` asks for.
    pub fn new(plan: &ViewsPlan, sections_mm: &'a [DVec2], camera: &Camera) -> Self {
        let (optics, cells) = (Optics::new(camera), Cells::new(camera));
        let ViewsPlan { first, groups, size: [width, height], parts, .. } = *plan;
        let middle = |part: usize| (2.0 * (part as f64 + 0.5) / parts as f64 - 1.0) * cells.shape.half();
        let centre = |n: usize| {
            let (group, i, j) = (n / width / height, n % width, n / width % height);
            cells.centre_mm(first[0] + (group * LANES + i) as i32, first[1] + j as i32)
        };
        let centres: Vec<DVec2> = (0..groups * width * height).into_par_iter().map(centre).collect();
        let part = |part: usize| cells.step_mm(DVec2::new(middle(part % parts), middle(part / parts)));
        Self { optics, sections_mm, parts_mm: (0..parts * parts).map(part).collect(), centres, width }
    }

    /// Number of lenslets, each with a place in every view.
    pub fn lenslets(&self) -> usize {
        self.centres.len()
    }

    /// Column and row of the pixel at each place of a view's line; None beside the sensor.
    pub fn line(&self, line: usize) -> impl Iterator<Item = Option<(usize, usize)>> {
        let (parts, views) = (self.parts_mm.len(), self.sections_mm.len() * self.parts_mm.len());
        let (section_mm, beyond_mm) = (self.sections_mm[line % views / parts], self.parts_mm[line % parts]);
        let centres = &self.centres[line / views * self.width..][..self.width];
        centres.iter().map(move |centre| {
            let hit = self.optics.sensor_through(*centre, *centre + beyond_mm, section_mm);
            self.optics.pixel_at(hit)
        })
    }
}
