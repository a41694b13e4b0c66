//! A sparse volume as a caller holds it.

use super::mask::Mask;
use crate::error::{Refused, Side};
use lf_core::Grid;

/// A sparse volume: one intensity per linear index of a grid, indices strictly rising.
#[derive(Debug, Clone, Copy)]
pub struct Sparse<'a> {
    /// The grid that the indices count in.
    pub grid: &'a Grid,
    /// Strictly rising linear indices.
    pub indices: &'a [u64],
    /// Intensity of each voxel; finite and not negative.
    pub intensity: &'a [f32],
}

impl Sparse<'_> {
    /// Refuses, as `side`, an intensity that is negative or not finite, and a volume without light inside `mask`.
    /// Panics if the lengths differ or the indices do not rise.
    pub(crate) fn check(&self, mask: &Mask, side: Side) -> Result<(), Refused> {
        assert_eq!(self.indices.len(), self.intensity.len(), "one intensity per index");
        let rises = self.indices.windows(2).all(|pair| pair[0] < pair[1]);
        assert!(rises && self.indices.last().is_none_or(|&last| last < self.grid.len()), "indices rise in the grid");
        let is_bad = |value: &f32| !(*value >= 0.0 && value.is_finite());
        if let Some(first) = self.intensity.iter().position(is_bad) {
            let count = self.intensity.iter().filter(|value| is_bad(value)).count();
            let voxel = self.grid.voxel(self.indices[first]);
            let found = format!("intensity {} at voxel {voxel:?}, {count} bad values in all", self.intensity[first]);
            return Err(Refused::new(side, found, "wanted finite intensities of 0 or more"));
        }
        if self.peak() == 0.0 {
            let found = format!("{} voxels, none of them lit", self.indices.len());
            return Err(Refused::new(side, found, "wanted a volume with light in it"));
        }
        let counts = |(&index, &value): (&u64, &f32)| value > 0.0 && mask.holds(index, self.grid.voxel(index));
        if !self.indices.iter().zip(self.intensity).any(counts) {
            let found = format!("{} voxels, none of them lit inside the mask", self.indices.len());
            return Err(Refused::new(side, found, "wanted light inside the mask"));
        }
        Ok(())
    }

    /// Refuses the first volume of another grid than the first, the first one that [`Sparse::check`] refuses, and a
    /// mask that leaves nothing. Returns the grid of the voxels that windows may hold. Panics without a pair.
    pub(crate) fn check_pairs(pairs: &[[Self; 2]], mask: &Mask) -> Result<Grid, Refused> {
        let grid = pairs[0][0].grid;
        let sides = || (0..pairs.len()).flat_map(|pair| [Side::First(pair), Side::Second(pair)]);
        let volumes = || pairs.iter().flatten().zip(sides());
        if let Some((volume, side)) = volumes().find(|(volume, _)| !volume.grid.agrees_with(grid)) {
            let wanted = format!("wanted the grid of the first volume, a {grid}");
            return Err(Refused::new(side, volume.grid.to_string(), wanted));
        }
        let part = mask.part(grid)?;
        volumes().try_for_each(|(volume, side)| volume.check(mask, side))?;
        Ok(part)
    }

    pub(crate) fn peak(&self) -> f32 {
        self.intensity.iter().fold(0.0, |peak, &value| value.max(peak))
    }
}
