//! Widths of a particle along the lines of voxels through its brightest voxel.
//!
//! A Gaussian with the peak `P` is fitted to that voxel and its two neighbours on the line. Then
//!
//! ```text
//! r(E) = sqrt(2 ln(P / E))        distance from the peak in standard deviations, exact for a Gaussian
//! ```
//!
//! grows linearly along the line. The width ends at r = 2, or at r = sqrt(2 ln 2) for half maximum, linearly
//! interpolated between two voxels. A Gaussian has its exact widths wherever it lies among the voxels. A lone voxel has
//! a diameter of 0.93 voxels.

use crate::scores::light::VoxelLight;

/// r at which the diameter ends.
const DIAMETER_SIGMA: f64 = 2.0;

/// Constant: intensity of a dark voxel as a share of the brightest voxel on the line. r is 4.3 there. From 1e-3 to 1e-6
/// the diameter of a lone voxel changes from 1.08 to 0.76, and that of the ideal particle does not change.
const DARK: f64 = 1e-4;

/// Constant: most steps from the brightest voxel near the true place to a brighter one beside it. With more steps the
/// search would climb to a neighbouring particle.
const MOST_STEPS: usize = 8;

/// Reads a sparse volume voxel by voxel.
pub(super) struct Profiles<'a> {
    pub light: VoxelLight<'a>,
}

/// Square of the distance between a voxel and a place, both in voxels.
pub(super) fn distance_squared(voxel: [i64; 3], place: [f64; 3]) -> f64 {
    (0..3).map(|axis| (voxel[axis] as f64 - place[axis]).powi(2)).sum()
}

impl Profiles<'_> {
    /// Intensity of a voxel: 0 if it is not held or negative. None outside the grid.
    fn at(&self, voxel: [i64; 3]) -> Option<f64> {
        let shape = self.light.grid.shape;
        if (0..3).any(|axis| voxel[axis] < 0 || voxel[axis] >= shape[axis] as i64) {
            return None;
        }
        let index = self.light.grid.index(voxel.map(|n| n as usize));
        let held = self.light.indices.binary_search(&index).ok();
        Some(held.map_or(0.0, |n| f64::from(self.light.intensity[n]).max(0.0)))
    }

    /// The top of the slope on which the brightest voxel near a place stands: no voxel beside it along an axis is
    /// brighter. None if all is dark within `search_vox` of the place, or if the top is too far.
    pub fn peak(&self, place: [f64; 3], search_vox: [usize; 3]) -> Option<[i64; 3]> {
        let (mut best, mut most) = self.brightest(place, search_vox)?;
        for _ in 0..=MOST_STEPS {
            let before = best;
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut beside = before;
                    beside[axis] += step;
                    let here = self.at(beside).unwrap_or(0.0);
                    if here > most {
                        (best, most) = (beside, here);
                    }
                }
            }
            if best == before {
                return Some(best);
            }
        }
        // Still on a slope: it belongs to another particle.
        None
    }

    /// The brightest voxel within `search_vox` of a place, of equals the nearest, and its intensity. None if all is
    /// dark.
    fn brightest(&self, place: [f64; 3], search_vox: [usize; 3]) -> Option<([i64; 3], f64)> {
        let range = |axis: usize| {
            let (middle, reach) = (place[axis].round() as i64, search_vox[axis] as i64);
            (middle - reach).max(0)..=(middle + reach).min(self.light.grid.shape[axis] as i64 - 1)
        };
        let voxels = range(2).flat_map(|z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])));
        let lit = voxels.map(|voxel| (voxel, self.at(voxel).unwrap_or(0.0))).filter(|(_, light)| *light > 0.0);
        let distance = |voxel| distance_squared(voxel, place);
        lit.min_by(|a, b| b.1.total_cmp(&a.1).then_with(|| distance(a.0).total_cmp(&distance(b.0))))
    }

    /// Diameter and full width at half maximum along an axis, voxels. None if either passes the end of the grid.
    pub fn widths(&self, peak: [i64; 3], axis: usize) -> Option<[f64; 2]> {
        let at = |offset: i64| {
            let mut voxel = peak;
            voxel[axis] += offset;
            self.at(voxel)
        };
        let middle = at(0)?;
        // A Gaussian through three voxels is a parabola through their logarithms. The middle one is 0, the others are
        // not above it.
        let log = |light: Option<f64>| (light.unwrap_or(0.0) / middle).max(DARK).ln();
        let (before, after) = (log(at(-1)), log(at(1)));
        let bend = before + after;
        let offset = if bend < 0.0 { (before - after) / (2.0 * bend) } else { 0.0 };
        let top = if bend < 0.0 { -(before - after).powi(2) / (8.0 * bend) } else { 0.0 };
        let sigmas = |light: f64| (2.0 * (top - (light / middle).max(DARK).ln())).max(0.0).sqrt();

        // Walk from the brightest voxel to the one where r passes the end.
        let reach = |step: i64, end: f64| {
            // The brightest voxel lies before the peak on one side and behind it on the other.
            let is_before = offset * step as f64 > 0.0;
            let mut last = if is_before { -sigmas(middle) } else { sigmas(middle) };
            for n in 1.. {
                let here = sigmas(at(step * n)?);
                if here >= end {
                    return Some((n - 1) as f64 + (end - last) / (here - last));
                }
                last = here;
            }
            None
        };
        let width = |end: f64| Some(reach(-1, end)? + reach(1, end)?);
        Some([width(DIAMETER_SIGMA)?, width((2.0 * 2f64.ln()).sqrt())?])
    }
}
