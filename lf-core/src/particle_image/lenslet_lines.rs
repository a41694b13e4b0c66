//! The lenslets that the sensor sees, and where each puts light that passes a place of the stop.

use crate::{Optics, lattice::Lattice};
use glam::DVec2;

/// A lenslet. Light that passes the stop at U and meets the array at t lands at `zero + gamma (t - centre) - kappa U`.
#[derive(Debug, Clone, Copy)]
pub(super) struct LensletLine {
    /// mm on the array.
    pub(super) centre: DVec2,
    /// Place of light through the middles of stop and lenslet, px.
    pub(super) zero: DVec2,
    /// px per mm of the stop.
    pub(super) kappa: DVec2,
    /// px per mm of the array.
    pub(super) gamma: DVec2,
}

/// Lenslets row by row.
#[derive(Debug, Clone)]
pub(super) struct LensletLines {
    lattice: Lattice,
    first_row: i64,
    /// First lenslet and lenslets of each row.
    rows: Vec<(i64, Vec<LensletLine>)>,
    /// Shift of a lenslet's picture with the lattice, px per mm.
    pub(super) by_shift: f64,
}

/// Step of the derivatives on the array, mm. The map is all but linear over a lenslet.
const STEP_MM: f64 = 0.02;

impl LensletLines {
    pub(super) fn new(optics: &Optics, pitch_mm: f64) -> Self {
        // The picture of a lenslet farther out lies beside the sensor.
        let picture = optics.demagnification * optics.half_aperture_mm;
        let reach_mm = optics.pixel_pitch_mm * optics.middle_px() + DVec2::splat(picture + 2.0 * pitch_mm);
        let lattice = optics.lattice();
        let seen: Vec<_> = lattice.rows_within(DVec2::ZERO, reach_mm).collect();
        let row = |(j, row): &(i64, std::ops::RangeInclusive<i64>)| {
            (*row.start(), row.clone().map(|i| line(optics, lattice.centre_mm(i, *j))).collect())
        };
        let (array_gain, lenslet_gain) = optics.gains();
        Self {
            first_row: seen.first().map_or(0, |(j, _)| *j),
            rows: seen.iter().map(row).collect(),
            lattice: lattice.clone(),
            by_shift: (array_gain + lenslet_gain) / optics.pixel_pitch_mm,
        }
    }

    /// The lenslets whose centres lie within `reach_mm` of a place on the array, and a few more.
    #[inline(always)]
    pub(super) fn within(&self, place_mm: DVec2, reach_mm: DVec2) -> impl Iterator<Item = &LensletLine> {
        let wanted = self.lattice.rows_within(self.lattice.perfect(place_mm), reach_mm);
        wanted.flat_map(move |(j, range)| {
            let row = usize::try_from(j - self.first_row).ok().and_then(|row| self.rows.get(row));
            let (first, lenslets) = row.map_or((0, &[][..]), |(first, lenslets)| (*first, lenslets.as_slice()));
            let held = |i: i64| (i - first).clamp(0, lenslets.len() as i64) as usize;
            let (from, to) = (held(*range.start()), held(*range.end() + 1));
            lenslets[from..to.max(from)].iter()
        })
    }
}

fn line(optics: &Optics, centre: DVec2) -> LensletLine {
    let place = |array: DVec2, aperture: DVec2| optics.place_px(optics.sensor_through(centre, array, aperture));
    let slope = |from: DVec2, to: DVec2, length: f64| (to - from) / length;
    let half = optics.half_aperture_mm;
    let (x, y) = (DVec2::X, DVec2::Y);
    let kappa = DVec2::new(
        slope(place(centre, half * x), place(centre, -half * x), 2.0 * half).x,
        slope(place(centre, half * y), place(centre, -half * y), 2.0 * half).y,
    );
    let gamma = DVec2::new(
        slope(place(centre - STEP_MM * x, DVec2::ZERO), place(centre + STEP_MM * x, DVec2::ZERO), 2.0 * STEP_MM).x,
        slope(place(centre - STEP_MM * y, DVec2::ZERO), place(centre + STEP_MM * y, DVec2::ZERO), 2.0 * STEP_MM).y,
    );
    LensletLine { centre, zero: place(centre, DVec2::ZERO), kappa, gamma }
}
