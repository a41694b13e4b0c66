//! The image sorted by section: the shade that each section of the aperture sees through each lenslet.

use super::shades::Shades;
use glam::DVec2;
use lf_core::Camera;
use lf_core::views::{ViewRays, ViewsPlan};
use rayon::prelude::*;
use std::ops::Range;

pub(crate) struct Views<'a> {
    pub(super) plan: &'a ViewsPlan,
    /// Shades by [`ViewRays`]; 0 beside the sensor.
    pub(super) shades: Vec<u8>,
    /// Like `shades`, but 1 on the sensor and 0 beside it.
    pub(super) seen: Vec<u8>,
    /// For each group and row, the lenslets that all sections see on the sensor, counted from the first.
    pub(super) whole: Vec<Range<usize>>,
}

impl<'a> Views<'a> {
    /// Bytes of a view of a lenslet: its shade, and whether it is seen.
    pub(super) const BYTES: usize = 2;

    pub(super) fn new(plan: &'a ViewsPlan, shades: &Shades, sections_mm: &[DVec2], camera: &Camera) -> Self {
        let rays = ViewRays::new(plan, sections_mm, camera);
        let (views, width) = (plan.views(sections_mm.len()), plan.size[0]);
        let (mut values, mut seen) = (vec![0; views * rays.lenslets()], vec![0; views * rays.lenslets()]);
        let lines = values.par_chunks_mut(width).zip(seen.par_chunks_mut(width));
        lines.enumerate().for_each(|(n, (values, seen))| {
            for (place, pixel) in rays.line(n).enumerate() {
                if let Some((column, row)) = pixel {
                    values[place] = shades.values[row * shades.width + column];
                    seen[place] = 1;
                }
            }
        });
        let whole = seen.par_chunks(views * width).map(|row| {
            let is_whole = |i: &usize| row[*i..].iter().step_by(width).all(|seen| *seen == 1);
            let start = (0..width).find(is_whole).unwrap_or(width);
            start..(start..width).find(|i| !is_whole(i)).unwrap_or(width)
        });
        let whole = whole.collect();
        Self { plan, shades: values, seen, whole }
    }
}
