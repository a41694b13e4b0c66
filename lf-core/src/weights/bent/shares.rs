//! The share of a narrow beam that a lenslet's cell takes.

use crate::weights::{axis::Span, blur::Blur, geometry::Geometry};
use glam::{DVec2, Vec2};

/// Points a side of the table.
const STEPS: usize = 128;

/// The share of a beam that a cell takes, by the beam's place, in one slice.
#[derive(Debug, Clone)]
pub(super) struct CellShares {
    /// Half sides of the table, mm.
    pub(super) half: Vec2,
    /// Steps of the table for a mm.
    per_mm: Vec2,
    table: Vec<f32>,
}

impl CellShares {
    /// For beams whose rays spread by `alpha`, through sections of side `side`, mm, in slice `z`.
    pub(super) fn new(geometry: &Geometry, z: usize, side: f64, alpha: f64) -> Self {
        // The beam is much narrower than the cell, so its width may be rounded up.
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
        let half = half.as_vec2();
        Self { half, per_mm: 0.5 * (STEPS - 1) as f32 / half, table }
    }

    /// The share of a beam whose middle lies `beyond` the lenslet's centre; linear between the table's points.
    #[inline(always)]
    pub(super) fn at(&self, beyond: Vec2) -> f32 {
        let place = (beyond + self.half) * self.per_mm;
        if place.min_element() < 0.0 || place.max_element() >= (STEPS - 1) as f32 {
            return 0.0;
        }
        let (x, y) = (place.x as usize, place.y as usize);
        let part = place - Vec2::new(x as f32, y as f32);
        let four = &self.table[y * STEPS + x..][..STEPS + 2];
        let along = |a: f32, b: f32| a + part.x * (b - a);
        let (upper, lower) = (along(four[0], four[1]), along(four[STEPS], four[STEPS + 1]));
        upper + part.y * (lower - upper)
    }
}
