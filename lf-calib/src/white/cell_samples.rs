//! The pixels of many lenslet images, averaged by their place in the cell.

use super::{basis::shortest, cell_fit::thinned, followed::FollowedLattice};
use crate::fit::robust::chosen;
use glam::DVec2;
use ndarray::ArrayView2;
use std::collections::BTreeMap;

/// Pixels that are averaged. More cost time and gain nothing.
const PIXELS: usize = 1 << 17;
/// Side of a bin: a share of the shortest lattice vector, and its limits, px.
const BIN: f64 = 1.0 / 28.0;
const BIN_PX: [f64; 2] = [0.25, 0.5];
/// Distance of the pixels from the centre, in shortest lattice vectors: beyond the corner of a square cell.
const REACH: f64 = 0.72;
/// A lenslet is left out if its gain is not within these shares of its neighbours' gain: it is dead, or covered by
/// dust.
const GAIN: [f64; 2] = [0.6, 1.6];

/// Pixels of one bin.
#[derive(Clone, Copy, Default)]
pub(crate) struct CellSample {
    /// Mean offset from the centre of the lenslet image, px.
    pub offset_px: DVec2,
    /// Mean count over the gain of the lenslets around. A dark level that was not subtracted is part of it.
    pub level: f64,
    /// Number of pixels.
    pub count: f64,
}

impl FollowedLattice {
    /// The mean cell as samples, without the pixels that a second stop may have touched.
    pub fn cell_samples(&mut self, image: ArrayView2<f32>) -> Vec<CellSample> {
        let Ok(kept) = self.fit_smooth() else { return Vec::new() };
        let lenslets = self.least_cut(chosen(&self.fits, &kept), image.dim());
        let shortest = shortest(self.basis_px);
        let reach = REACH * shortest;
        let side = (BIN * shortest).clamp(BIN_PX[0], BIN_PX[1]);
        let (height, width) = image.dim();
        let mut bins: BTreeMap<(i64, i64), CellSample> = BTreeMap::new();
        for (index, fit) in thinned(&lenslets, self.basis_px, PIXELS) {
            let (centre, gain) = (self.smooth.at(index), self.gain.at(index).x);
            let is_inside = centre.min_element() > reach + 1.0
                && centre.x < width as f64 - reach - 1.0
                && centre.y < height as f64 - reach - 1.0;
            if !is_inside || !(GAIN[0]..GAIN[1]).contains(&(fit.gain / gain)) {
                continue;
            }
            let untouched = self.untouched(centre, image.dim());
            let range = |centre: f64| (centre - reach) as usize..=(centre + reach) as usize;
            for (row, column) in range(centre.y).flat_map(|row| range(centre.x).map(move |column| (row, column))) {
                let offset = DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - centre;
                if offset.length() > reach || untouched.as_ref().is_some_and(|untouched| !untouched.holds(offset)) {
                    continue;
                }
                let bin = (offset / side).floor();
                let sample = bins.entry((bin.y as i64, bin.x as i64)).or_default();
                sample.offset_px += offset;
                sample.level += f64::from(image[(row, column)]) / gain;
                sample.count += 1.0;
            }
        }
        let mean = |sample: CellSample| CellSample {
            offset_px: sample.offset_px / sample.count,
            level: sample.level / sample.count,
            count: sample.count,
        };
        bins.into_values().map(mean).filter(|sample| sample.level.is_finite()).collect()
    }
}
