//! How the light of volumes is distributed along z.

use super::{distribution::ErrorSpread, light::VoxelLight};
use lf_core::{Grid, Refusal};
use serde::Serialize;

/// Sums over the light of volumes of one grid.
#[derive(Debug, Clone)]
pub struct DepthSums {
    grid: Grid,
    volumes: usize,
    /// Sum of the light over y and the volumes: nx x nz, x fastest.
    section: Vec<f64>,
    /// Brightest voxel of each slice, summed over the volumes.
    peak: Vec<f64>,
}

/// The score of the volumes. Numbers that need light are None if all is dark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Depth {
    /// Number of volumes.
    pub volumes: usize,
    /// Light of a volume, mean over the volumes.
    pub light: f64,
    pub(crate) mean_z_mm: Option<f64>,
    pub(crate) std_z_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) slab_mm: Option<[f64; 2]>,
    /// Share of the light in slices with their centre outside the slab. None without a slab.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outside_share: Option<f64>,
    /// Light of the brightest slice outside the slab over that of the mean slice inside.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) outside_peak: Option<f64>,
    /// Standard deviation over mean of the light of the slices inside the slab, or of all slices without a slab.
    pub(crate) unevenness: Option<f64>,
    /// Mean light of the same slices.
    #[serde(skip)]
    pub(crate) mean_slice: f64,
    /// Centres of the voxels along x.
    #[serde(skip)]
    pub(crate) x_mm: Vec<f64>,
    /// Distance between voxels along x, and between slices.
    #[serde(skip)]
    pub(crate) spacing_mm: [f64; 2],
    /// Centres of the slices.
    pub(crate) z_mm: Vec<f64>,
    /// Light of each slice, mean over the volumes.
    pub(crate) profile: Vec<f64>,
    /// Brightest voxel of each slice, mean over the volumes.
    pub(crate) peak: Vec<f64>,
    /// Light summed over y and the volumes: nx x nz, x fastest.
    #[serde(skip)]
    pub(crate) section: Vec<f64>,
}

/// Bytes of a slice: its brightest voxel, summed; its depth and its light; its light once more among the slices inside
/// or outside the slab, in a list that may grow to twice its length; and a copy for the median.
const SLICE_BYTES: f64 = 8.0 + 8.0 + 8.0 + 16.0 + 8.0;

impl DepthSums {
    /// Upper bound of the bytes of sums over volumes of a grid, and of their score. A picture needs the section in
    /// another order.
    pub fn bytes(grid: &Grid, is_drawn: bool) -> f64 {
        let [nx, _, nz] = grid.shape.map(|count| count as f64);
        let sections = if is_drawn { 2.0 } else { 1.0 };
        8.0 * sections * nx * nz + SLICE_BYTES * nz + 8.0 * nx
    }

    /// Sums of no volume.
    pub fn new(grid: &Grid) -> Self {
        let [nx, _, nz] = grid.shape;
        Self { grid: grid.clone(), volumes: 0, section: vec![0.0; nx * nz], peak: vec![0.0; nz] }
    }

    /// Adds a volume. Refuses another grid.
    pub fn add(&mut self, light: VoxelLight) -> Result<(), Refusal> {
        if !self.grid.agrees_with(light.grid) {
            return Err(Refusal::new(light.grid.to_string(), format!("wanted the first volume's {}", self.grid)));
        }
        let nx = self.grid.shape[0];
        let mut peak = vec![0.0; self.peak.len()];
        for (&index, &value) in light.indices.iter().zip(light.intensity) {
            let [x, _, z] = self.grid.voxel(index);
            self.section[x + nx * z] += f64::from(value);
            peak[z] = f64::max(peak[z], f64::from(value));
        }
        self.peak.iter_mut().zip(peak).for_each(|(sum, peak)| *sum += peak);
        self.volumes += 1;
        Ok(())
    }

    /// The score of the volumes added. `slab_mm`: depths between which there should be light.
    pub fn score(self, slab_mm: Option<[f64; 2]>) -> Depth {
        let Self { grid, volumes, section, peak } = self;
        let each = 1.0 / volumes as f64;
        let profile: Vec<f64> = section.chunks(grid.shape[0]).map(|row| each * row.iter().sum::<f64>()).collect();
        let z_mm: Vec<f64> = (0..grid.shape[2]).map(|z| grid.centre_mm(2, z)).collect();

        // Moments of the depth, weighted by the light.
        let light = profile.iter().sum::<f64>();
        let mean_of = |value: &dyn Fn(f64) -> f64| {
            let sum: f64 = z_mm.iter().zip(&profile).map(|(&z, &light)| light * value(z)).sum();
            (light > 0.0).then(|| sum / light)
        };
        let mean_z_mm = mean_of(&|z| z);
        let variance = mean_z_mm.and_then(|mean| mean_of(&|z| (z - mean).powi(2)));

        let is_inside = |z: f64| slab_mm.is_none_or(|[low, high]| (low..=high).contains(&z));
        let slices = |wanted: bool| {
            let chosen = z_mm.iter().zip(&profile).filter(move |(z, _)| is_inside(**z) == wanted);
            chosen.map(|(_, light)| *light).collect::<Vec<f64>>()
        };
        let (inside, outside) = (slices(true), slices(false));
        let ErrorSpread { bias: mean, std, .. } = ErrorSpread::of(&inside);
        let is_judged = slab_mm.is_some() && light > 0.0;
        Depth {
            volumes,
            light,
            mean_z_mm,
            std_z_mm: variance.map(f64::sqrt),
            slab_mm,
            outside_share: is_judged.then(|| outside.iter().fold(0.0, |sum, light| sum + light) / light),
            outside_peak: (is_judged && mean > 0.0).then(|| outside.iter().copied().fold(0.0, f64::max) / mean),
            unevenness: (mean > 0.0).then(|| std / mean),
            mean_slice: mean,
            x_mm: (0..grid.shape[0]).map(|x| grid.centre_mm(0, x)).collect(),
            spacing_mm: [grid.spacing_mm[0], grid.spacing_mm[2]],
            z_mm,
            profile,
            peak: peak.iter().map(|sum| each * sum).collect(),
            section,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid { shape: [3, 2, 4], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0, 0.0, -1.5] }
    }

    fn sums(volumes: &[&[([usize; 3], f32)]]) -> DepthSums {
        let grid = grid();
        let mut sums = DepthSums::new(&grid);
        for volume in volumes {
            let (indices, intensity): (Vec<u64>, Vec<f32>) =
                volume.iter().map(|(voxel, light)| (grid.index(*voxel), *light)).unzip();
            sums.add(VoxelLight { grid: &grid, indices: &indices, intensity: &intensity }).unwrap();
        }
        sums
    }

    #[test]
    fn two_volumes_by_hand() {
        let volumes: [&[([usize; 3], f32)]; 2] =
            [&[([0, 0, 0], 1.0), ([2, 0, 1], 2.0), ([2, 1, 1], 3.0)], &[([1, 0, 1], 1.0), ([1, 1, 2], 5.0)]];
        let score = sums(&volumes).score(Some([-0.6, 0.5]));
        assert_eq!((score.volumes, score.light), (2, 6.0));
        assert_eq!(score.z_mm, [-1.5, -0.5, 0.5, 1.5]);
        assert_eq!(score.profile, [0.5, 3.0, 2.5, 0.0]);
        assert_eq!(score.peak, [0.5, 2.0, 2.5, 0.0]);
        assert_eq!(score.section, [1.0, 0.0, 0.0, 0.0, 1.0, 5.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(score.outside_share, Some(0.5 / 6.0));
        assert_eq!(score.outside_peak, Some(0.5 / 2.75));
        assert_eq!(score.unevenness, Some(0.25 / 2.75));
        assert!((score.mean_z_mm.unwrap() - (-0.75 - 1.5 + 1.25) / 6.0).abs() < 1e-15);
    }

    #[test]
    fn a_share_outside_needs_light_and_a_slab() {
        let dark = sums(&[&[]]).score(Some([-1.0, 1.0]));
        assert_eq!((dark.outside_share, dark.outside_peak, dark.unevenness, dark.mean_z_mm), (None, None, None, None));
        assert_eq!(sums(&[&[([0, 0, 0], 1.0)]]).score(None).outside_share, None);
    }

    #[test]
    fn a_volume_of_another_grid_is_refused() {
        let other = Grid { shape: [3, 2, 5], ..grid() };
        let refusal = sums(&[]).add(VoxelLight { grid: &other, indices: &[], intensity: &[] }).unwrap_err();
        assert!(refusal.found.contains("3 x 2 x 5") && refusal.wanted.contains("3 x 2 x 4"));
    }
}
