//! How large and how elongated reconstructed particles are.
//!
//! The paper takes the diameter of a particle where its intensity has fallen "two standard deviations away from the
//! maximum". Its ideal particle, a Gaussian of 0.75 voxel, then has 3 voxels: the diameter is 4 standard deviations of
//! a Gaussian, the full width at exp(-2) of its peak. The other width is that at half maximum.

use super::profile::{Profiles, distance_squared};
use super::score::{DiametersByDepth, Elongation, Histogram, ParticleSize, SizeCounts, Widths};
use crate::scores::light::VoxelLight;
use lf_core::Grid;
use std::collections::BTreeMap;

/// Measures the particles at `places_mm` in volumes of one grid.
///
/// The brightest voxel of a particle is searched up to `search_vox` from its true place along each axis. `pixel_mm`:
/// size of a pixel at the focal plane.
pub fn elongation(
    volumes: &[(VoxelLight, Vec<[f64; 3]>)],
    grid: &Grid,
    search_vox: [usize; 3],
    pixel_mm: Option<f64>,
) -> Elongation {
    let (mut sizes, mut counts) = (Vec::new(), SizeCounts::default());
    for (light, places_mm) in volumes {
        measure(*light, places_mm, search_vox, &mut sizes, &mut counts);
    }
    Elongation {
        counts: SizeCounts { measured: sizes.len(), ..counts },
        voxel_mm: grid.spacing_mm,
        pixel_mm,
        diameter: Widths::of(sizes.iter().map(|size| size.diameter), grid.spacing_mm, pixel_mm),
        half_maximum: Widths::of(sizes.iter().map(|size| size.half_maximum), grid.spacing_mm, pixel_mm),
        histogram: Histogram::of(&sizes, grid.spacing_mm, pixel_mm),
        by_depth: DiametersByDepth::of(&sizes, grid),
    }
}

/// Measures the particles of one volume.
fn measure(
    light: VoxelLight,
    places_mm: &[[f64; 3]],
    search_vox: [usize; 3],
    sizes: &mut Vec<ParticleSize>,
    counts: &mut SizeCounts,
) {
    let profiles = Profiles { light };
    // The nearest of the particles that found a brightest voxel: square of the distance, true depth, peak.
    let mut owners: BTreeMap<u64, (f64, f64, [i64; 3])> = BTreeMap::new();
    for place_mm in places_mm {
        let place = [0, 1, 2].map(|axis| light.grid.place_vox(axis, place_mm[axis]));
        let is_inside = |axis: usize| (-0.5..light.grid.shape[axis] as f64 - 0.5).contains(&place[axis]);
        if !(0..3).all(is_inside) {
            continue;
        }
        counts.particles += 1;
        let Some(peak) = profiles.peak(place, search_vox) else {
            counts.missed += 1;
            continue;
        };
        let distance = distance_squared(peak, place);
        let owner = owners.entry(light.grid.index(peak.map(|n| n as usize))).or_insert((f64::INFINITY, 0.0, peak));
        counts.merged += usize::from(owner.0 < f64::INFINITY);
        if distance < owner.0 {
            *owner = (distance, place_mm[2], peak);
        }
    }
    // Read the widths along the three axes.
    for (_, z_mm, peak) in owners.into_values() {
        if let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(|axis| profiles.widths(peak, axis)) {
            sizes.push(ParticleSize { z_mm, diameter: [x[0], y[0], z[0]], half_maximum: [x[1], y[1], z[1]] });
        } else {
            counts.cut += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid { shape: [40, 30, 30], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] }
    }

    /// Gaussians (place and sigma in voxels) as a sparse volume. Voxels below `cut` of the peak are dark.
    fn blobs(blobs: &[([f64; 3], [f64; 3])], cut: f64) -> (Vec<u64>, Vec<f32>) {
        let grid = grid();
        (0..grid.len())
            .filter_map(|index| {
                let at = grid.voxel(index);
                let light = |(place, sigma): &([f64; 3], [f64; 3])| {
                    let r2: f64 = (0..3).map(|a| ((at[a] as f64 - place[a]) / sigma[a]).powi(2)).sum();
                    (-0.5 * r2).exp()
                };
                let sum = blobs.iter().map(light).sum::<f64>();
                (sum > cut).then_some((index, sum as f32))
            })
            .unzip()
    }

    fn score(volume: &(Vec<u64>, Vec<f32>), places_vox: &[[f64; 3]]) -> Elongation {
        let grid = grid();
        let light = VoxelLight { grid: &grid, indices: &volume.0, intensity: &volume.1 };
        let places = places_vox.iter().map(|place| [0, 1, 2].map(|a| place[a] * grid.spacing_mm[a])).collect();
        elongation(&[(light, places)], &grid, [2, 2, 3], Some(0.1))
    }

    #[test]
    fn the_ideal_particle_has_three_voxels_at_any_place() {
        for n in 0..20 {
            let place = [10.0 + 0.137 * f64::from(n), 12.0 - 0.093 * f64::from(n), 14.0 + 0.211 * f64::from(n)];
            let found = score(&blobs(&[(place, [0.75, 0.75, 2.5])], 1e-9), &[place]);
            assert_eq!((found.counts.particles, found.counts.measured), (1, 1));
            let px = found.diameter.medians();
            for (axis, wanted) in [(0, 3.0), (1, 3.0), (2, 100.0)] {
                assert!((px[axis] - wanted).abs() < 1e-4 * wanted, "{place:?}: {px:?}");
            }
            let half = 2.0 * (2.0 * 2f64.ln()).sqrt();
            let mm = serde_json::to_value(&found.half_maximum).unwrap()["median_z_mm"].as_f64().unwrap();
            assert!((mm - 2.5 * half).abs() < 1e-3);
            assert!((found.half_maximum.median_vox()[0] - 0.75 * half).abs() < 1e-4);
        }
    }

    #[test]
    fn a_lone_voxel_is_about_one_voxel() {
        let index = grid().index([10, 10, 10]);
        let found = score(&(vec![index], vec![7.0]), &[[10.0; 3]]);
        let wanted = 2.0 * 2.0 / (2.0 * 1e4f64.ln()).sqrt();
        assert!((found.diameter.median_vox()[0] - wanted).abs() < 1e-9 && (wanted - 0.93).abs() < 0.01);
    }

    // MART leaves light along z that ends in a plateau and not as a Gaussian: three equal voxels have no curvature.
    #[test]
    fn a_plateau_ends_about_half_a_voxel_beyond_its_last_voxel() {
        let grid = grid();
        let held: Vec<u64> = (9..=13).map(|z| grid.index([10, 10, z])).collect();
        let found = score(&(held, vec![1.0; 5]), &[[10.0, 10.0, 11.0]]);
        let end = 2.0 / (2.0 * 1e4f64.ln()).sqrt();
        assert!((found.diameter.median_vox()[2] - (4.0 + 2.0 * end)).abs() < 1e-9);
    }

    #[test]
    fn every_particle_is_counted_once() {
        let places = [
            [10.0, 10.0, 10.0], // stands alone
            [10.3, 10.0, 10.0], // no light of its own: merged with the first, which is nearer
            [30.0, 25.0, 20.0], // no light near it: missed
            [20.0, 10.0, 0.0],  // at the end of the grid: cut
            [50.0, 10.0, 0.0],  // outside
        ];
        let volume = blobs(&[(places[0], [0.75; 3]), (places[3], [0.75; 3])], 1e-6);
        let found = score(&volume, &places);
        assert_eq!(found.counts, SizeCounts { particles: 4, measured: 1, missed: 1, merged: 1, cut: 1 });
        assert_eq!(found.by_depth.particles.iter().sum::<usize>(), 1);
        assert_eq!(found.histogram.x[5] + found.histogram.x[6], 1.0);
    }

    #[test]
    fn a_slope_without_a_top_is_not_a_particle() {
        let grid = grid();
        let ramp: Vec<u64> = (2..28).map(|z| grid.index([10, 10, z])).collect();
        let light: Vec<f32> = (2..28).map(|z| (0.5 * z as f32).exp()).collect();
        let found = score(&(ramp, light), &[[10.0, 10.0, 8.0]]);
        assert_eq!((found.counts.missed, found.counts.measured), (1, 0));
    }

    #[test]
    fn the_search_climbs_to_a_peak_beside_it() {
        let (place, seen) = ([10.0, 10.0, 10.0], [10.0, 10.0, 15.0]);
        let found = score(&blobs(&[(seen, [0.75, 0.75, 3.0])], 1e-6), &[place]);
        assert!((found.diameter.median_vox()[2] - 12.0).abs() < 1e-3);
    }

    #[test]
    fn widths_of_no_particle_are_null() {
        let found = score(&(Vec::new(), Vec::new()), &[[10.0; 3]]);
        assert_eq!((found.counts.particles, found.counts.missed), (1, 1));
        let json = serde_json::to_value(&found).unwrap();
        assert!(json["diameter"]["median_x_vox"].is_null() && json["by_depth"]["x_vox"][0].is_null());
    }
}
