//! Where along z the light of volumes lies.

use crate::scores::light::Light;
use crate::scores::spread::Spread;
use lf_core::grid::Grid;
use serde::Serialize;

/// The light of volumes of one grid, added up.
#[derive(Debug, Clone)]
pub struct Depth {
    grid: Grid,
    volumes: usize,
    /// Sum of the light over y and the volumes: nx x nz, x fastest.
    section: Vec<f64>,
    /// Sum over the volumes of each slice's brightest voxel.
    peak: Vec<f64>,
}

/// The score of the volumes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// How many volumes.
    pub volumes: usize,
    /// Light of a volume, in the mean.
    pub light: f64,
    /// Mean depth of the light, mm; none in darkness.
    pub mean_z_mm: Option<f64>,
    /// Standard deviation of its depth, mm.
    pub std_z_mm: Option<f64>,
    /// The lit slab, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slab_mm: Option<[f64; 2]>,
    /// Share of the light in slices whose centre is outside the slab; none in darkness or without a slab.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outside_share: Option<f64>,
    /// Brightest slice outside the slab over the mean slice inside.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outside_peak: Option<f64>,
    /// How uneven the slices inside the slab are (all of them without one): standard deviation over mean.
    pub unevenness: Option<f64>,
    /// Mean light of the slices inside the slab; of all of them without one.
    #[serde(skip)]
    pub mean_slice: f64,
    /// Centres of the voxels along x, mm.
    #[serde(skip)]
    pub x_mm: Vec<f64>,
    /// Distance between voxels along x, and between slices, mm.
    #[serde(skip)]
    pub spacing_mm: [f64; 2],
    /// Centres of the slices, mm.
    pub z_mm: Vec<f64>,
    /// Light of each slice of a volume, in the mean.
    pub profile: Vec<f64>,
    /// Brightest voxel of each slice, mean over the volumes.
    pub peak: Vec<f64>,
    /// Light summed over y and the volumes, nx x nz, x fastest. Not in the JSON.
    #[serde(skip)]
    pub section: Vec<f64>,
}

impl Depth {
    /// No volume yet.
    pub fn new(grid: &Grid) -> Self {
        let [nx, _, nz] = grid.shape;
        Self { grid: grid.clone(), volumes: 0, section: vec![0.0; nx * nz], peak: vec![0.0; nz] }
    }

    /// Adds a volume.
    ///
    /// # Errors
    /// Two phrases, found and wanted, where its grid is another.
    pub fn add(&mut self, light: Light) -> Result<(), (String, String)> {
        if !self.grid.agrees_with(light.grid) {
            return Err((light.grid.to_string(), format!("wanted the first volume's {}", self.grid)));
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

    /// What the volumes add up to. `slab_mm` is where light should be.
    pub fn score(self, slab_mm: Option<[f64; 2]>) -> Score {
        let Self { grid, volumes, section, peak } = self;
        let each = 1.0 / volumes as f64;
        let profile: Vec<f64> = section.chunks(grid.shape[0]).map(|row| each * row.iter().sum::<f64>()).collect();
        let z_mm: Vec<f64> = (0..grid.shape[2]).map(|z| grid.centre_mm(2, z)).collect();
        let light = profile.iter().sum::<f64>();
        let mean_of = |value: &dyn Fn(f64) -> f64| {
            let sum: f64 = z_mm.iter().zip(&profile).map(|(&z, &light)| light * value(z)).sum();
            (light > 0.0).then(|| sum / light)
        };
        let mean_z_mm = mean_of(&|z| z);
        let variance = mean_z_mm.and_then(|mean| mean_of(&|z| (z - mean).powi(2)));
        let is_inside = |z: f64| slab_mm.is_none_or(|[low, high]| (low..=high).contains(&z));
        let (inside, outside): (Vec<_>, Vec<_>) =
            z_mm.iter().zip(&profile).map(|(&z, &light)| (z, light)).partition(|(z, _)| is_inside(*z));
        let lights = |slices: &[(f64, f64)]| slices.iter().map(|(_, light)| *light).collect::<Vec<f64>>();
        let (inside, outside) = (lights(&inside), lights(&outside));
        let Spread { bias: mean, std, .. } = Spread::of(&inside);
        let is_judged = slab_mm.is_some() && light > 0.0;
        Score {
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

    fn depth(volumes: &[&[([usize; 3], f32)]]) -> Depth {
        let grid = grid();
        let mut depth = Depth::new(&grid);
        for volume in volumes {
            let (indices, intensity): (Vec<u64>, Vec<f32>) =
                volume.iter().map(|(voxel, light)| (grid.index(*voxel), *light)).unzip();
            depth.add(Light { grid: &grid, indices: &indices, intensity: &intensity }).unwrap();
        }
        depth
    }

    #[test]
    fn two_volumes_by_hand() {
        let volumes: [&[([usize; 3], f32)]; 2] =
            [&[([0, 0, 0], 1.0), ([2, 0, 1], 2.0), ([2, 1, 1], 3.0)], &[([1, 0, 1], 1.0), ([1, 1, 2], 5.0)]];
        let score = depth(&volumes).score(Some([-0.6, 0.5]));
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
    fn darkness_has_no_shares_and_no_slab_none_either() {
        let dark = depth(&[&[]]).score(Some([-1.0, 1.0]));
        assert_eq!((dark.outside_share, dark.outside_peak, dark.unevenness, dark.mean_z_mm), (None, None, None, None));
        assert_eq!(depth(&[&[([0, 0, 0], 1.0)]]).score(None).outside_share, None);
    }

    #[test]
    fn a_volume_of_another_grid_is_refused() {
        let other = Grid { shape: [3, 2, 5], ..grid() };
        let (found, wanted) = depth(&[]).add(Light { grid: &other, indices: &[], intensity: &[] }).unwrap_err();
        assert!(found.contains("3 x 2 x 5") && wanted.contains("3 x 2 x 4"));
    }
}
