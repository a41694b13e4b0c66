//! Weights of any straight-ray camera: lenslet by lenslet, slab by slab of its cell, integrated where they are used.
//!
//! This is the slow and simple way, with which tests compare the faster ones. About 0.1 us for each lenslet and slab.

use super::axis::{Piece, Span};
use super::{blur::Blur, chords::Chords, geometry::Geometry};
use glam::DVec2;

/// Weights without tables: sampled apertures on a lattice that is not aligned with the pixels.
#[derive(Debug, Clone)]
pub struct Pieces {
    pub(super) geometry: Geometry,
}

/// Buffers of a thread.
#[derive(Debug, Default)]
pub(super) struct PieceBuffers {
    columns: Vec<Piece>,
    rows: Vec<Piece>,
}

impl Geometry {
    pub(super) fn chords(&self, row: &Piece) -> Chords {
        if self.has_round_stop {
            Chords::of_disc(self.optics.half_aperture_mm, f64::from(row.u0), f64::from(row.u1))
        } else {
            Chords::UNCUT
        }
    }

    pub(super) fn visit(
        &self,
        voxel: [usize; 3],
        PieceBuffers { columns, rows }: &mut PieceBuffers,
        wanted: impl Fn(u32) -> bool,
        mut found: impl FnMut(u32, u32, f32),
    ) {
        let [across, down] = [0, 1].map(|along| self.axis(voxel[2], along));
        let blurs = self.blurs(&across);
        let chief = self.chief_mm(&across, voxel);
        let corner = self.corner();
        let margin = corner + DVec2::from(blurs.map(Blur::reach));
        let spread = across.alpha.abs() * across.half_aperture;
        let whole = Span { low: -corner.y, high: corner.y, blur: blurs[1] };
        for centre in self.optics.lenslets_seen(chief, margin + DVec2::splat(spread)) {
            // Skip a lenslet that the light of a round stop cannot reach. A section's beam is wider than its chief ray.
            let beyond = ((centre - chief).abs() - margin).max(DVec2::ZERO);
            if self.has_round_stop && beyond.length() > spread * (1.0 + 2.0 / self.sections as f64) {
                continue;
            }
            if !down.pixels_reached(chief.y, centre.y, &whole).any(&wanted) {
                continue;
            }
            for slab in &self.slabs {
                let span_y = slab.span(1, blurs);
                if !down.pixels_reached(chief.y, centre.y, &span_y).any(&wanted) {
                    continue;
                }
                rows.clear();
                down.pieces(self.model, chief.y, centre.y, &span_y, rows);
                rows.retain(|row| wanted(row.pixel));
                if rows.is_empty() {
                    continue;
                }
                columns.clear();
                across.pieces(self.model, chief.x, centre.x, &slab.span(0, blurs), columns);
                for row in &*rows {
                    let chords = self.chords(row);
                    for column in &*columns {
                        let weight = self.scale * row.weight * column.weight * chords.share(column.u0, column.u1);
                        if weight > 0.0 {
                            found(column.pixel, row.pixel, weight);
                        }
                    }
                }
            }
        }
    }
}
