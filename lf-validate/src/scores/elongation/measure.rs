//! How large and how drawn out reconstructed particles are.
//!
//! The paper takes the diameter of a particle where its intensity has fallen "two standard deviations away from the
//! maximum", which is 3 voxels for its ideal particle, a Gaussian of 0.75 voxel: the diameter is 4 standard deviations of a
//! Gaussian, the width at exp(-2) of its peak. Half maximum is the other width.
//!
//! Both are read along the lines of voxels through a particle's brightest voxel. With the peak `P` of a Gaussian through
//! that voxel and its two neighbours on the line,
//!
//! ```text
//! r(E) = sqrt(2 ln(P / E))        distance from the peak in standard deviations, of a Gaussian exactly
//! ```
//!
//! grows evenly along the line, and the width ends where r is 2, or sqrt(2 ln 2), between two voxels by linear
//! interpolation. A Gaussian wherever it lies among the voxels has its exact widths; a lone voxel has a diameter of 0.93.

use crate::scores::light::Light;
use crate::scores::units::AXES;
use lf_core::grid::Grid;
use lf_core::statistics::quantile;
use serde::Serialize;
use std::collections::BTreeMap;

/// r where the diameter ends.
const DIAMETER_SIGMA: f64 = 2.0;

/// Diameter of the ideal particle, voxels.
pub const IDEAL_VOX: f64 = 3.0;

/// Constant: what a dark voxel counts as, as a share of the brightest of the line. r is 4.3 there; from 1e-3 to 1e-6 the
/// diameter of a lone voxel goes from 1.08 to 0.76 and that of the ideal particle stays.
const DARK: f64 = 1e-4;

/// Constant: steps from the brightest voxel near a particle's true place up to a brighter one beside it. More would climb
/// over to a neighbour.
const CLIMB: usize = 8;

/// Bins of the histogram: half voxels from 0, so that 2 to 4 and 10 to 25 pixels are whole bins at 1 x 1 x 10 pixels.
pub const BIN_VOX: f64 = 0.5;

/// How many bins; what is longer is `beyond`.
pub const BINS: usize = 24;

/// Slabs of equal depth in which medians are given.
pub const SLABS: usize = 20;

/// The score of the particles of a volume.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Elongation {
    /// Particles whose true place is in the grid.
    pub particles: usize,
    /// Those that were measured.
    pub measured: usize,
    /// Those without light near their true place.
    pub missed: usize,
    /// Those whose brightest voxel is also that of a particle nearer to it. Not measured.
    pub merged: usize,
    /// Those that reach over the end of the grid. Not measured.
    pub cut: usize,
    /// Voxel spacing, mm.
    pub voxel_mm: [f64; 3],
    /// A pixel at the focal plane, mm; absent without a camera, and then so is every `px`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_mm: Option<f64>,
    /// The paper's diameter.
    pub diameter: Widths,
    /// Full width at half maximum.
    pub half_maximum: Widths,
    /// Shares of the particles by diameter.
    pub histogram: Histogram,
    /// Medians of the diameter by depth.
    pub by_depth: ByDepth,
}

/// Median, tenth and ninetieth percentile of a width along each axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Widths {
    /// In voxels.
    #[serde(flatten)]
    pub vox: Percentiles<0>,
    /// In millimetres.
    #[serde(flatten)]
    pub mm: Percentiles<1>,
    /// In pixels at the focal plane.
    #[serde(flatten)]
    pub px: Option<Percentiles<2>>,
}

/// Percentiles in the unit number `UNIT` of voxels, millimetres and pixels; NaN without particles.
#[derive(Debug, Clone, PartialEq)]
pub struct Percentiles<const UNIT: usize> {
    /// Along x, y, z.
    pub median: [f64; 3],
    /// A tenth are smaller.
    pub p10: [f64; 3],
    /// A tenth are larger.
    pub p90: [f64; 3],
}

const UNITS: [&str; 3] = ["vox", "mm", "px"];

/// Share of the particles per bin of [`BIN_VOX`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Histogram {
    /// Middles of the bins, voxels.
    pub vox: Vec<f64>,
    /// Middles of the bins of x, pixels; of y the same, if pixels and voxels are square.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x_px: Option<Vec<f64>>,
    /// Middles of the bins of y, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_px: Option<Vec<f64>>,
    /// Middles of the bins of z, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z_px: Option<Vec<f64>>,
    /// Shares along x.
    pub x: Vec<f64>,
    /// Shares along y.
    pub y: Vec<f64>,
    /// Shares along z.
    pub z: Vec<f64>,
    /// Shares longer than the last bin, along x, y, z.
    pub beyond: [f64; 3],
}

/// Medians of the diameter in slabs of equal depth; none, `null`, where a slab has no particle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByDepth {
    /// Middles of the slabs, mm.
    pub z_mm: Vec<f64>,
    /// Particles in each.
    pub particles: Vec<usize>,
    /// Medians along x, voxels.
    pub x_vox: Vec<Option<f64>>,
    /// Medians along y, voxels.
    pub y_vox: Vec<Option<f64>>,
    /// Medians along z, voxels.
    pub z_vox: Vec<Option<f64>>,
}

/// Both widths of a particle, voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Size {
    z_mm: f64,
    diameter: [f64; 3],
    half_maximum: [f64; 3],
}

/// Measures the particles at `places_mm` in volumes of one grid. `search_vox`: how far from its true place a particle's
/// brightest voxel is looked for along each axis. `pixel_mm` is a pixel at the focal plane.
pub fn elongation(
    volumes: &[(Light, Vec<[f64; 3]>)],
    grid: &Grid,
    search_vox: [usize; 3],
    pixel_mm: Option<f64>,
) -> Elongation {
    let (mut sizes, mut counts) = (Vec::new(), Counts::default());
    for (light, places_mm) in volumes {
        measure(*light, places_mm, search_vox, &mut sizes, &mut counts);
    }
    let widths = |width: fn(&Size) -> [f64; 3]| Widths {
        vox: Percentiles::of(&sizes, width, [1.0; 3]),
        mm: Percentiles::of(&sizes, width, grid.spacing_mm),
        px: pixel_mm.map(|pixel| Percentiles::of(&sizes, width, grid.spacing_mm.map(|spacing| spacing / pixel))),
    };
    Elongation {
        particles: counts.particles,
        measured: sizes.len(),
        missed: counts.missed,
        merged: counts.merged,
        cut: counts.cut,
        voxel_mm: grid.spacing_mm,
        pixel_mm,
        diameter: widths(|size| size.diameter),
        half_maximum: widths(|size| size.half_maximum),
        histogram: Histogram::of(&sizes, grid.spacing_mm, pixel_mm),
        by_depth: ByDepth::of(&sizes, grid),
    }
}

#[derive(Default)]
struct Counts {
    particles: usize,
    missed: usize,
    merged: usize,
    cut: usize,
}

fn measure(light: Light, places_mm: &[[f64; 3]], search_vox: [usize; 3], sizes: &mut Vec<Size>, counts: &mut Counts) {
    let lines = Lines { light };
    // Of the particles that share a brightest voxel, the nearest in voxels owns it.
    let mut owners: BTreeMap<u64, (f64, f64)> = BTreeMap::new();
    for place_mm in places_mm {
        let place = [0, 1, 2].map(|axis| light.grid.place_vox(axis, place_mm[axis]));
        let inside = |axis: usize| (-0.5..light.grid.shape[axis] as f64 - 0.5).contains(&place[axis]);
        if !(0..3).all(inside) {
            continue;
        }
        counts.particles += 1;
        let Some(peak) = lines.brightest(place, search_vox) else {
            counts.missed += 1;
            continue;
        };
        let distance = (0..3).map(|axis| (peak[axis] as f64 - place[axis]).powi(2)).sum::<f64>();
        let owner = owners.entry(light.grid.index(peak)).or_insert((f64::INFINITY, 0.0));
        counts.merged += usize::from(owner.0 < f64::INFINITY);
        if distance < owner.0 {
            *owner = (distance, place_mm[2]);
        }
    }
    for (index, (_, z_mm)) in owners {
        let peak = light.grid.voxel(index);
        let widths = [0, 1, 2].map(|axis| lines.widths(peak, axis));
        if let [Some(x), Some(y), Some(z)] = widths {
            sizes.push(Size { z_mm, diameter: [x[0], y[0], z[0]], half_maximum: [x[1], y[1], z[1]] });
        } else {
            counts.cut += 1;
        }
    }
}

/// A sparse volume read along its lines.
struct Lines<'a> {
    light: Light<'a>,
}

impl Lines<'_> {
    /// Intensity of a voxel; 0 where it is not held or negative, none outside the grid.
    fn at(&self, voxel: [i64; 3]) -> Option<f64> {
        let shape = self.light.grid.shape;
        if (0..3).any(|axis| voxel[axis] < 0 || voxel[axis] >= shape[axis] as i64) {
            return None;
        }
        let index = self.light.grid.index(voxel.map(|n| n as usize));
        let held = self.light.indices.binary_search(&index).ok();
        Some(held.map_or(0.0, |n| f64::from(self.light.intensity[n]).max(0.0)))
    }

    /// The brightest voxel near a place, the nearest of equals, or the top of the slope that it stands on: no voxel beside it
    /// along an axis is brighter. None in darkness, and where the top is too far.
    fn brightest(&self, place: [f64; 3], search_vox: [usize; 3]) -> Option<[usize; 3]> {
        let middle = place.map(|p| p.round() as i64);
        let range = |axis: usize| {
            let (reach, last) = (search_vox[axis] as i64, self.light.grid.shape[axis] as i64 - 1);
            (middle[axis] - reach).max(0)..=(middle[axis] + reach).min(last)
        };
        let distance = |voxel: [i64; 3]| (0..3).map(|axis| (voxel[axis] as f64 - place[axis]).powi(2)).sum::<f64>();
        let (mut best, mut most) = (None, 0.0);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let voxel = [x, y, z];
                    let here = self.at(voxel).unwrap_or(0.0);
                    let is_nearer = || best.is_some_and(|best| distance(voxel) < distance(best));
                    if here > most || (here == most && is_nearer()) {
                        (best, most) = (Some(voxel), here);
                    }
                }
            }
        }
        let mut best = best?;
        for _ in 0..=CLIMB {
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
                return Some(best.map(|n| n as usize));
            }
        }
        // Still on a slope, which is not this particle's.
        None
    }

    /// Diameter and full width at half maximum along an axis, voxels; none where either passes the end of the grid.
    fn widths(&self, peak: [usize; 3], axis: usize) -> Option<[f64; 2]> {
        let at = |offset: i64| {
            let mut voxel = peak.map(|n| n as i64);
            voxel[axis] += offset;
            self.at(voxel)
        };
        let middle = at(0)?;
        let log = |light: Option<f64>| (light.unwrap_or(0.0) / middle).max(DARK).ln();
        // The Gaussian through three voxels: a parabola through their logarithms, the middle one 0 and no less than the others.
        let (before, after) = (log(at(-1)), log(at(1)));
        let bend = before + after;
        let offset = if bend < 0.0 { (before - after) / (2.0 * bend) } else { 0.0 };
        let top = if bend < 0.0 { -(before - after).powi(2) / (8.0 * bend) } else { 0.0 };
        let sigmas = |light: f64| (2.0 * (top - (light / middle).max(DARK).ln())).max(0.0).sqrt();

        let reach = |step: i64, end: f64| {
            // The brightest voxel lies short of the peak on one side and beyond it on the other.
            let is_short = offset * step as f64 > 0.0;
            let mut before = if is_short { -sigmas(middle) } else { sigmas(middle) };
            for n in 1.. {
                let here = sigmas(at(step * n)?);
                if here >= end {
                    return Some((n - 1) as f64 + (end - before) / (here - before));
                }
                before = here;
            }
            None
        };
        let width = |end: f64| Some(reach(-1, end)? + reach(1, end)?);
        Some([width(DIAMETER_SIGMA)?, width((2.0 * 2f64.ln()).sqrt())?])
    }
}

impl<const UNIT: usize> Percentiles<UNIT> {
    fn of(sizes: &[Size], width: fn(&Size) -> [f64; 3], unit: [f64; 3]) -> Self {
        let of = |share: f64| {
            [0, 1, 2].map(|axis| {
                let mut along: Vec<f64> = sizes.iter().map(|size| width(size)[axis]).collect();
                quantile(&mut along, share) * unit[axis]
            })
        };
        Self { median: of(0.5), p10: of(0.1), p90: of(0.9) }
    }
}

impl<const UNIT: usize> Serialize for Percentiles<UNIT> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeMap;
        let mut map = serializer.serialize_map(None)?;
        for (name, values) in [("median", self.median), ("p10", self.p10), ("p90", self.p90)] {
            for axis in 0..3 {
                map.serialize_entry(&format!("{name}_{}_{}", AXES[axis], UNITS[UNIT]), &values[axis])?;
            }
        }
        map.end()
    }
}

impl Histogram {
    fn of(sizes: &[Size], voxel_mm: [f64; 3], pixel_mm: Option<f64>) -> Self {
        // Of nothing there is no share.
        let none = if sizes.is_empty() { f64::NAN } else { 0.0 };
        let mut shares = [0, 1, 2].map(|_| vec![none; BINS]);
        let mut beyond = [none; 3];
        let each = 1.0 / sizes.len() as f64;
        for size in sizes {
            for axis in 0..3 {
                let bin = (size.diameter[axis] / BIN_VOX) as usize;
                *shares[axis].get_mut(bin).unwrap_or(&mut beyond[axis]) += each;
            }
        }
        let vox: Vec<f64> = (0..BINS).map(|bin| (bin as f64 + 0.5) * BIN_VOX).collect();
        let px = |axis: usize| pixel_mm.map(|pixel| vox.iter().map(|v| v * voxel_mm[axis] / pixel).collect());
        let (x_px, y_px, z_px) = (px(0), px(1), px(2));
        let [x, y, z] = shares;
        Self { vox, x_px, y_px, z_px, x, y, z, beyond }
    }
}

impl ByDepth {
    fn of(sizes: &[Size], grid: &Grid) -> Self {
        let low_mm = grid.origin_mm[2] - 0.5 * grid.spacing_mm[2];
        let step_mm = grid.shape[2] as f64 * grid.spacing_mm[2] / SLABS as f64;
        let mut slabs: Vec<Vec<&Size>> = vec![Vec::new(); SLABS];
        for size in sizes {
            let slab = ((size.z_mm - low_mm) / step_mm).max(0.0) as usize;
            slabs[slab.min(SLABS - 1)].push(size);
        }
        let median = |axis: usize| {
            let of = |slab: &Vec<&Size>| {
                let mut diameters: Vec<f64> = slab.iter().map(|size| size.diameter[axis]).collect();
                quantile(&mut diameters, 0.5)
            };
            slabs.iter().map(|slab| (!slab.is_empty()).then(|| of(slab))).collect()
        };
        Self {
            z_mm: (0..SLABS).map(|slab| low_mm + (slab as f64 + 0.5) * step_mm).collect(),
            particles: slabs.iter().map(Vec::len).collect(),
            x_vox: median(0),
            y_vox: median(1),
            z_vox: median(2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid { shape: [40, 30, 30], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [0.0; 3] }
    }

    /// Gaussians (place and sigma in voxels) as a sparse volume; what is below `cut` of the peak is dark.
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
        let light = Light { grid: &grid, indices: &volume.0, intensity: &volume.1 };
        let places = places_vox.iter().map(|place| [0, 1, 2].map(|a| place[a] * grid.spacing_mm[a])).collect();
        elongation(&[(light, places)], &grid, [2, 2, 3], Some(0.1))
    }

    #[test]
    fn the_ideal_particle_has_three_voxels_wherever_it_lies() {
        for n in 0..20 {
            let place = [10.0 + 0.137 * f64::from(n), 12.0 - 0.093 * f64::from(n), 14.0 + 0.211 * f64::from(n)];
            let found = score(&blobs(&[(place, [0.75, 0.75, 2.5])], 1e-9), &[place]);
            assert_eq!((found.particles, found.measured), (1, 1));
            let px = found.diameter.px.unwrap();
            for (axis, wanted) in [(0, 3.0), (1, 3.0), (2, 100.0)] {
                assert!((px.median[axis] - wanted).abs() < 1e-4 * wanted, "{place:?}: {px:?}");
            }
            let half = 2.0 * (2.0 * 2f64.ln()).sqrt();
            assert!((found.half_maximum.mm.median[2] - 2.5 * half).abs() < 1e-3);
            assert!((found.half_maximum.vox.median[0] - 0.75 * half).abs() < 1e-4);
        }
    }

    #[test]
    fn a_lone_voxel_is_about_one_voxel() {
        let index = grid().index([10, 10, 10]);
        let found = score(&(vec![index], vec![7.0]), &[[10.0; 3]]);
        let wanted = 2.0 * 2.0 / (2.0 * 1e4f64.ln()).sqrt();
        assert!((found.diameter.vox.median[0] - wanted).abs() < 1e-9 && (wanted - 0.93).abs() < 0.01);
    }

    // Light that MART leaves along z ends in a plateau, not in a Gaussian: three equal voxels have no curvature.
    #[test]
    fn a_plateau_ends_half_a_voxel_or_so_beyond_its_last() {
        let grid = grid();
        let held: Vec<u64> = (9..=13).map(|z| grid.index([10, 10, z])).collect();
        let found = score(&(held, vec![1.0; 5]), &[[10.0, 10.0, 11.0]]);
        let end = 2.0 / (2.0 * 1e4f64.ln()).sqrt();
        assert!((found.diameter.vox.median[2] - (4.0 + 2.0 * end)).abs() < 1e-9);
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
        let counts = (found.particles, found.measured, found.missed, found.merged, found.cut);
        assert_eq!(counts, (4, 1, 1, 1, 1));
        assert_eq!(found.by_depth.particles.iter().sum::<usize>(), 1);
        assert_eq!(found.histogram.x[5] + found.histogram.x[6], 1.0);
    }

    #[test]
    fn a_slope_without_a_top_is_no_particle() {
        let grid = grid();
        let ramp: Vec<u64> = (2..28).map(|z| grid.index([10, 10, z])).collect();
        let light: Vec<f32> = (2..28).map(|z| (0.5 * z as f32).exp()).collect();
        let found = score(&(ramp, light), &[[10.0, 10.0, 8.0]]);
        assert_eq!((found.missed, found.measured), (1, 0));
    }

    #[test]
    fn a_peak_aside_is_climbed_to() {
        let (place, seen) = ([10.0, 10.0, 10.0], [10.0, 10.0, 15.0]);
        let found = score(&blobs(&[(seen, [0.75, 0.75, 3.0])], 1e-6), &[place]);
        assert!((found.diameter.vox.median[2] - 12.0).abs() < 1e-3);
    }

    #[test]
    fn nothing_to_measure_is_null() {
        let found = score(&(Vec::new(), Vec::new()), &[[10.0; 3]]);
        assert_eq!((found.particles, found.missed), (1, 1));
        let json = serde_json::to_value(&found).unwrap();
        assert!(json["diameter"]["median_x_vox"].is_null() && json["by_depth"]["x_vox"][0].is_null());
    }
}
