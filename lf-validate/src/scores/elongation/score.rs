//! The numbers that are printed about the sizes of particles.

use crate::scores::units::AXES;
use lf_core::{Grid, statistics::quantile};
use serde::{Serialize, Serializer};

/// Diameter of the ideal particle, voxels.
pub(crate) const IDEAL_VOX: f64 = 3.0;

/// Width of a bin, voxels. With voxels of 1 x 1 x 10 pixels, 2 to 4 and 10 to 25 pixels are whole bins.
pub(crate) const BIN_VOX: f64 = 0.5;

/// Number of bins. Longer diameters count as `beyond`.
pub(crate) const BINS: usize = 24;

/// Slabs of equal depth in which medians are given.
const SLABS: usize = 20;

/// Widths of one particle along x, y and z, voxels.
pub(super) struct ParticleSize {
    /// True depth of the particle.
    pub z_mm: f64,
    pub diameter: [f64; 3],
    pub half_maximum: [f64; 3],
}

/// The score of the particles of one or more volumes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Elongation {
    /// How many particles were measured, and why others were not.
    #[serde(flatten)]
    pub counts: SizeCounts,
    /// Voxel spacing.
    pub(crate) voxel_mm: [f64; 3],
    /// Size of a pixel at the focal plane. Without a camera it is absent, and so is every `px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) pixel_mm: Option<f64>,
    /// The paper's diameter: full width at exp(-2) of the peak.
    pub(crate) diameter: Widths,
    /// Full width at half maximum.
    pub(crate) half_maximum: Widths,
    /// Shares of the particles by diameter.
    pub(crate) histogram: Histogram,
    pub(crate) by_depth: DiametersByDepth,
}

/// Counts of particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct SizeCounts {
    /// Particles whose true place is in the grid.
    pub particles: usize,
    /// Both widths are known along all axes.
    pub measured: usize,
    /// No light near the true place.
    pub missed: usize,
    /// The brightest voxel belongs to a particle nearer to it.
    pub merged: usize,
    /// Reaches over the end of the grid.
    pub cut: usize,
}

/// Percentiles of a width along x, y and z; NaN without particles. In JSON one key for each percentile, axis and unit:
/// `median_x_vox`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Widths {
    /// Names of the percentiles, and their values in voxels.
    percentiles_vox: [(&'static str, [f64; 3]); 3],
    /// The units, and the side of a voxel in them. `px` only with a camera.
    units: Vec<(&'static str, [f64; 3])>,
}

/// Share of the particles in each bin of [`BIN_VOX`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Histogram {
    /// Middles of the bins, voxels; below in pixels, which differ along x and y if voxels are not square.
    pub vox: Vec<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x_px: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_px: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z_px: Option<Vec<f64>>,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub z: Vec<f64>,
    /// Shares beyond the last bin, along x, y, z.
    pub beyond: [f64; 3],
}

/// Medians of the diameter in slabs of equal depth. None for a slab without particles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct DiametersByDepth {
    /// Middles of the slabs.
    pub z_mm: Vec<f64>,
    pub particles: Vec<usize>,
    pub x_vox: Vec<Option<f64>>,
    pub y_vox: Vec<Option<f64>>,
    pub z_vox: Vec<Option<f64>>,
}

impl Elongation {
    /// Medians of the diameter along x, y and z. NaN without particles.
    pub fn medians_vox(&self) -> [f64; 3] {
        self.diameter.median_vox()
    }
}

impl Widths {
    /// Percentiles of one width of all particles.
    pub(super) fn of(widths_vox: impl Iterator<Item = [f64; 3]>, voxel_mm: [f64; 3], pixel_mm: Option<f64>) -> Self {
        let mut along = [const { Vec::new() }; 3];
        for width in widths_vox {
            (0..3).for_each(|axis| along[axis].push(width[axis]));
        }
        let percentile = |(name, share)| (name, [0, 1, 2].map(|axis| quantile(&mut along[axis], share)));
        let mut units = vec![("vox", [1.0; 3]), ("mm", voxel_mm)];
        units.extend(pixel_mm.map(|pixel| ("px", voxel_mm.map(|voxel| voxel / pixel))));
        Self { percentiles_vox: [("median", 0.5), ("p10", 0.1), ("p90", 0.9)].map(percentile), units }
    }

    pub(super) fn median_vox(&self) -> [f64; 3] {
        self.percentiles_vox[0].1
    }

    /// Medians along x, y and z, in pixels with a camera, else in voxels.
    pub fn medians(&self) -> [f64; 3] {
        let unit = self.units.iter().find(|(name, _)| *name == "px").unwrap_or(&self.units[0]).1;
        [0, 1, 2].map(|axis| self.median_vox()[axis] * unit[axis])
    }
}

impl Serialize for Widths {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.units.iter().flat_map(|(unit, voxel)| {
            self.percentiles_vox.iter().flat_map(move |(name, values)| {
                (0..3).map(move |axis| (format!("{name}_{}_{unit}", AXES[axis]), values[axis] * voxel[axis]))
            })
        }))
    }
}

impl Histogram {
    pub(super) fn of(sizes: &[ParticleSize], voxel_mm: [f64; 3], pixel_mm: Option<f64>) -> Self {
        // Shares of no particle do not exist.
        let start = if sizes.is_empty() { f64::NAN } else { 0.0 };
        let mut shares = [0, 1, 2].map(|_| vec![start; BINS]);
        let mut beyond = [start; 3];
        let each = 1.0 / sizes.len() as f64;
        for size in sizes {
            for axis in 0..3 {
                let bin = (size.diameter[axis] / BIN_VOX) as usize;
                *shares[axis].get_mut(bin).unwrap_or(&mut beyond[axis]) += each;
            }
        }
        let vox: Vec<f64> = (0..BINS).map(|bin| (bin as f64 + 0.5) * BIN_VOX).collect();
        let px = |axis: usize| pixel_mm.map(|pixel| vox.iter().map(|v| v * voxel_mm[axis] / pixel).collect());
        let [x_px, y_px, z_px] = [0, 1, 2].map(px);
        let [x, y, z] = shares;
        Self { vox, x_px, y_px, z_px, x, y, z, beyond }
    }
}

impl DiametersByDepth {
    pub(super) fn of(sizes: &[ParticleSize], grid: &Grid) -> Self {
        let low_mm = grid.origin_mm[2] - 0.5 * grid.spacing_mm[2];
        let step_mm = grid.shape[2] as f64 * grid.spacing_mm[2] / SLABS as f64;
        let mut slabs: Vec<Vec<&ParticleSize>> = vec![Vec::new(); SLABS];
        for size in sizes {
            let slab = ((size.z_mm - low_mm) / step_mm).max(0.0) as usize;
            slabs[slab.min(SLABS - 1)].push(size);
        }
        let medians = |axis: usize| {
            let median = |slab: &Vec<&ParticleSize>| {
                let mut diameters: Vec<f64> = slab.iter().map(|size| size.diameter[axis]).collect();
                (!diameters.is_empty()).then(|| quantile(&mut diameters, 0.5))
            };
            slabs.iter().map(median).collect()
        };
        let [x_vox, y_vox, z_vox] = [0, 1, 2].map(medians);
        Self {
            z_mm: (0..SLABS).map(|slab| low_mm + (slab as f64 + 0.5) * step_mm).collect(),
            particles: slabs.iter().map(Vec::len).collect(),
            x_vox,
            y_vox,
            z_vox,
        }
    }
}
