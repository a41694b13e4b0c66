//! The Cramer-Rao bound of particles' places, and of the vectors made of them.

use super::units::{AXES, COMPONENTS};
use glam::{DMat3, DVec3};
use lf_core::particle_image::{ParticleModel, Scratch};
use lf_core::{Camera, Refusal, linear};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use std::collections::HashMap;

/// A planned experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// Particles for each lenslet that the lit volume covers at the focal plane.
    pub per_lenslet: f64,
    /// Noise of a pixel.
    pub noise: Noise,
    /// Standard deviation of a particle, pixels at the focal plane.
    pub sigma_px: f64,
    /// First and last lit depth, mm.
    pub depth_mm: [f64; 2],
    /// Side of a window, mm.
    pub window_mm: f64,
    /// Seed of the random places.
    pub seed: u64,
}

/// Noise of the pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Noise {
    /// The standard deviation in all pixels, as a share of the brightest pixel.
    Share(f64),
    /// Photon and read noise.
    Counts {
        /// Counts of a particle in all pixels.
        light: f64,
        /// Counts of an electron.
        gain: f64,
        /// Standard deviation of a pixel without light, counts.
        read: f64,
    },
}

impl Noise {
    /// Variance of a pixel, by the light of a particle, where the image has `light` of it and `brightest` at most.
    fn variance(self, light: f64, brightest: f64) -> f64 {
        match self {
            Self::Share(share) => (share * brightest).powi(2),
            Self::Counts { light: counts, gain, read } => gain * light / counts + (read / counts).powi(2),
        }
    }
}

/// The bound by depth. Pixels are those of the focal plane.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Precision {
    /// Particles in the statistics.
    pub particles: usize,
    /// Particles by depth.
    pub by_depth: ByDepth,
    /// Displacements of whole windows by depth.
    pub windows: Windows,
}

/// Medians over the particles of slabs of equal depth. Null for a slab without particles, and where the image does not
/// determine the place of half of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ByDepth {
    /// Middles of the slabs, mm.
    pub z_mm: Vec<f64>,
    /// Particles.
    pub count: Vec<usize>,
    /// Standard deviations of x, y and z.
    #[serde(flatten)]
    pub deviations: Deviations,
}

/// Root mean squares over windows with three particles or more.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Windows {
    /// Side, mm.
    pub side_mm: f64,
    /// Middles, mm.
    pub z_mm: Vec<f64>,
    /// Particles in a window, mean.
    pub particles: Vec<Option<f64>>,
    /// Standard deviations of u, v and w, the displacement between two frames.
    #[serde(flatten)]
    pub deviations: Deviations,
}

/// Standard deviations by slab along three axes. Serialises to `sx_px` and so on, then `sx_mm` and so on.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviations {
    /// Names of the axes.
    pub names: [&'static str; 3],
    /// The standard deviations, mm.
    pub mm: [Vec<Option<f64>>; 3],
    /// A pixel at the focal plane, mm.
    pub pixel_mm: f64,
}

impl Serialize for Deviations {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let units = [("px", self.pixel_mm), ("mm", 1.0)];
        serializer.collect_map(units.into_iter().flat_map(|(unit, length_mm)| {
            self.names.iter().zip(&self.mm).map(move |(name, values)| {
                let in_unit = values.iter().map(|value| value.map(|mm| mm / length_mm));
                (format!("s{name}_{unit}"), in_unit.collect::<Vec<_>>())
            })
        }))
    }
}

const SLABS: usize = 10;
/// Particles wanted in the statistics, and the number of samples after which they are drawn no longer.
const WANTED: usize = 600;
const SAMPLES: usize = 12;
/// Neighbours within these pixels of the focal plane are free too: 0.995 of the bound with all free.
const NEIGHBOURS_PX: f64 = 28.0;
/// Windows tried in each slab of each sample.
const WINDOWS: usize = 16;
/// Windows with fewer particles are left out.
const LEAST: usize = 3;
/// Unknowns of a particle: place and light.
const UNKNOWNS: usize = 4;

/// Pixels of a particle's image, rising, and the derivatives of their light by its unknowns.
type Pixels = Vec<(u32, [f64; UNKNOWNS])>;

/// A particle of a sample.
struct Member {
    place: DVec3,
    pixels: Pixels,
    /// Whether it is in the statistics.
    counts: bool,
    /// Covariance of its place, mm^2. None if the image does not determine it.
    covariance: Option<DMat3>,
}

/// Particles at random places.
struct Sample {
    members: Vec<Member>,
    /// Particles nearer to the axis than this along x and y are in the statistics.
    inner_mm: f64,
}

impl Sample {
    fn counted(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().filter(|member| member.counts)
    }
}

/// The bound. Refuses what [`ParticleModel::new`] refuses, and a sensor that sees less than a window.
pub fn precision(camera: &Camera, experiment: &Experiment) -> Result<Precision, Refusal> {
    let px = camera.pixel_in_focus_mm();
    let model = ParticleModel::new(camera, experiment.sigma_px * px, experiment.depth_mm)?;
    let mut random = Pcg64Mcg::seed_from_u64(experiment.seed);
    let mut samples: Vec<Sample> = Vec::new();
    let counted = |samples: &[Sample]| samples.iter().flat_map(Sample::counted).count();
    while samples.len() < SAMPLES && counted(&samples) < WANTED {
        samples.push(sample(camera, &model, experiment, &mut random)?);
    }
    Ok(Precision {
        particles: counted(&samples),
        by_depth: by_depth(&samples, experiment, px),
        windows: windows(&samples, experiment, px, &mut random),
    })
}

/// Particles at random places about the axis, those of the inner part with their covariance.
fn sample(
    camera: &Camera,
    model: &ParticleModel,
    experiment: &Experiment,
    random: &mut Pcg64Mcg,
) -> Result<Sample, Refusal> {
    let px = camera.pixel_in_focus_mm();
    let [low, high] = experiment.depth_mm;
    let view = camera.half_view_mm();
    let beam = px * model.reach_px(low).max(model.reach_px(high));
    // Statistics over a window and a half, with a rim of neighbours, as far as the sensor sees the whole of a beam.
    let rim = NEIGHBOURS_PX * px;
    let seen = view[0].min(view[1]) - beam;
    let inner = (0.75 * experiment.window_mm).min(seen - rim);
    let found = || format!("a sensor of {:.2} x {:.2} mm at the focal plane", 2.0 * view[0], 2.0 * view[1]);
    let least = 2.0 * (0.5 * experiment.window_mm + rim + beam);
    Refusal::unless(inner >= 0.5 * experiment.window_mm, found, format!("wanted {least:.2} mm for such windows"))?;
    let outer = inner + rim + beam;
    let lenslet_mm2 = camera.lattice().cell_area_mm2() / camera.main_lens.magnification.powi(2);
    let count = (experiment.per_lenslet * 4.0 * outer * outer / lenslet_mm2).round().max(1.0) as usize;
    let mut scratch = Scratch::default();
    let [width, height] = model.sensor_px();
    let mut light = Array2::<f64>::zeros((height, width));
    let mut members: Vec<Member> = (0..count)
        .map(|_| {
            let mut along = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
            let place = DVec3::new(along(-outer, outer), along(-outer, outer), along(low, high));
            let pixels = image(model, place, width, &mut scratch);
            pixels.iter().for_each(|(n, value)| light[[*n as usize / width, *n as usize % width]] += value[3]);
            let counts = place.truncate().abs().max_element() <= inner;
            Member { place, pixels, counts, covariance: None }
        })
        .collect();
    let brightest = light.iter().fold(0f64, |most, value| most.max(*value));
    for (n, values) in members.iter_mut().flat_map(|member| &mut member.pixels) {
        let here = light[[*n as usize / width, *n as usize % width]];
        let std = experiment.noise.variance(here, brightest).sqrt();
        values.iter_mut().for_each(|value| *value /= std);
    }
    let is_near = |a: DVec3, b: DVec3| (a - b).truncate().abs().max_element() < rim;
    let bound = |(n, member): (usize, &Member)| {
        if !member.counts {
            return None;
        }
        let is_other = |(m, other): &(usize, &Member)| *m != n && is_near(member.place, other.place);
        let others = members.iter().enumerate().filter(is_other).map(|(_, other)| &other.pixels);
        covariance(&member.pixels, &others.collect::<Vec<_>>(), 1.0)
    };
    let covariances: Vec<Option<DMat3>> = members.par_iter().enumerate().map(bound).collect();
    members.iter_mut().zip(covariances).for_each(|(member, covariance)| member.covariance = covariance);
    Ok(Sample { members, inner_mm: inner })
}

/// Light and its derivatives by place, 1/mm, by rising pixel.
fn image(model: &ParticleModel, place: DVec3, width: usize, scratch: &mut Scratch) -> Pixels {
    let mut sums: HashMap<u32, [f64; UNKNOWNS]> = HashMap::new();
    model.visit(place.to_array(), 1.0, scratch, |patch, pixels| {
        for (n, [light, x, y, z, ..]) in pixels.iter().enumerate() {
            let n = n as u32;
            let (column, row) = (patch.column + n % patch.columns, patch.row + n / patch.columns);
            let sum = sums.entry(row * width as u32 + column).or_default();
            sum.iter_mut().zip([x, y, z, light]).for_each(|(sum, value)| *sum += value);
        }
    });
    let mut pixels: Pixels = sums.into_iter().collect();
    pixels.sort_unstable_by_key(|(n, _)| *n);
    pixels
}

/// The covariance of a particle's place, where its own place and light and those of `others` are unknown. None if the
/// image does not determine them.
fn covariance(own: &Pixels, others: &[&Pixels], variance: f64) -> Option<DMat3> {
    /// A pivot below this share of its diagonal means that the image does not determine an unknown.
    const LEAST_PIVOT: f64 = 1e-12;
    // Put the place last: the end of the Cholesky factor then determines its covariance.
    let group: Vec<&Pixels> = others.iter().copied().chain([own]).collect();
    let size = UNKNOWNS * group.len();
    let order = |n: usize| (n + 1) % UNKNOWNS;
    // Sum the Fisher information; the factorisation reads its lower triangle only.
    let mut fisher = vec![0.0; size * size];
    for (a, first) in group.iter().enumerate() {
        for (b, second) in group.iter().enumerate().skip(a) {
            let block = shared(first, second);
            for i in 0..UNKNOWNS {
                for k in 0..UNKNOWNS {
                    let (row, column) = (b * UNKNOWNS + order(k), a * UNKNOWNS + order(i));
                    fisher[row * size + column] = block[i][k] / variance;
                }
            }
        }
    }
    linear::cholesky(&mut fisher, size, LEAST_PIVOT)?;
    // Invert the last three rows and columns of the factor.
    let end = |row: usize, column: usize| fisher[(size - 3 + row) * size + size - 3 + column];
    let lower = DMat3::from_cols_array(&std::array::from_fn(|n| if n % 3 < n / 3 { 0.0 } else { end(n % 3, n / 3) }));
    let inverse = lower.inverse();
    Some(inverse.transpose() * inverse)
}

/// Sums over shared pixels of the products of derivatives.
fn shared(first: &Pixels, second: &Pixels) -> [[f64; UNKNOWNS]; UNKNOWNS] {
    let mut block = [[0.0; UNKNOWNS]; UNKNOWNS];
    let mut rest = second.iter().peekable();
    for (n, a) in first {
        while rest.next_if(|(m, _)| m < n).is_some() {}
        if let Some((_, b)) = rest.peek().filter(|(m, _)| m == n) {
            for (row, a) in block.iter_mut().zip(a) {
                row.iter_mut().zip(b).for_each(|(sum, b)| *sum += a * b);
            }
        }
    }
    block
}

/// Middle of slab n, mm.
fn middle(experiment: &Experiment, n: usize) -> f64 {
    let [low, high] = experiment.depth_mm;
    low + (high - low) * (n as f64 + 0.5) / SLABS as f64
}

fn by_depth(samples: &[Sample], experiment: &Experiment, px: f64) -> ByDepth {
    let [low, high] = experiment.depth_mm;
    let mut slabs: Vec<[Vec<f64>; 3]> = (0..SLABS).map(|_| Default::default()).collect();
    for member in samples.iter().flat_map(Sample::counted) {
        let n = ((member.place.z - low) / (high - low) * SLABS as f64) as usize;
        for axis in 0..3 {
            let deviation = |covariance: DMat3| covariance.col(axis)[axis].max(0.0).sqrt();
            // A particle that the image does not determine has no bound.
            slabs[n.min(SLABS - 1)][axis].push(member.covariance.map_or(f64::INFINITY, deviation));
        }
    }
    let medians = |axis: usize| {
        let median = |slab: &[Vec<f64>; 3]| lf_core::statistics::upper_median(&mut slab[axis].clone());
        slabs.iter().map(|slab| median(slab).filter(|median| median.is_finite())).collect()
    };
    ByDepth {
        z_mm: (0..SLABS).map(|n| middle(experiment, n)).collect(),
        count: slabs.iter().map(|slab| slab[0].len()).collect(),
        deviations: Deviations { names: AXES, mm: [0, 1, 2].map(medians), pixel_mm: px },
    }
}

/// A window's displacement is the weighted mean over its particles, each with twice its covariance.
fn windows(samples: &[Sample], experiment: &Experiment, px: f64, random: &mut Pcg64Mcg) -> Windows {
    let side = experiment.window_mm;
    let mut sums = vec![(0usize, 0usize, DVec3::ZERO); SLABS];
    for sample in samples {
        for (n, sum) in sums.iter_mut().enumerate() {
            for _ in 0..WINDOWS {
                // A window stays among the particles that are in the statistics.
                let mut aside = || (sample.inner_mm - 0.5 * side) * (2.0 * random.random::<f64>() - 1.0);
                let centre = DVec3::new(aside(), aside(), middle(experiment, n));
                let inside = |member: &&Member| (member.place - centre).abs().max_element() < 0.5 * side;
                let covariances: Vec<DMat3> = sample.counted().filter(inside).filter_map(|m| m.covariance).collect();
                if covariances.len() < LEAST {
                    continue;
                }
                let information: DMat3 = covariances.iter().map(|c| (2.0 * *c).inverse()).sum();
                let variance = information.inverse().diagonal();
                if variance.is_finite() {
                    *sum = (sum.0 + 1, sum.1 + covariances.len(), sum.2 + variance);
                }
            }
        }
    }
    let mean = |sum: f64, count: usize| (count > 0).then(|| sum / count as f64);
    let rms = |axis: usize| sums.iter().map(|(count, _, sum)| mean(sum[axis], *count).map(f64::sqrt)).collect();
    Windows {
        side_mm: side,
        z_mm: (0..SLABS).map(|n| middle(experiment, n)).collect(),
        particles: sums.iter().map(|(count, all, _)| mean(*all as f64, *count)).collect(),
        deviations: Deviations { names: COMPONENTS, mm: [0, 1, 2].map(rms), pixel_mm: px },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: of three pixels the two particles share one.
    #[test]
    fn shared_pixels_alone_count() {
        let a: Pixels = vec![(3, [1.0, 0.0, 0.0, 2.0]), (7, [0.0, 1.0, 0.0, 1.0])];
        let b: Pixels = vec![(4, [9.0; 4]), (7, [0.5, 0.0, 3.0, 1.0])];
        let block = shared(&a, &b);
        assert_eq!(block[1], [0.5, 0.0, 3.0, 1.0]);
        assert_eq!(block[3], [0.5, 0.0, 3.0, 1.0]);
        assert_eq!(block[0], [0.0; 4]);
    }

    /// Four pixels that depend on one unknown each: the covariance is the inverse of their squares. It does not exist
    /// if no pixel depends on an unknown.
    #[test]
    fn a_covariance_by_hand() {
        let pixel = |n: usize, value: f64| (n as u32, std::array::from_fn(|k| if k == n { value } else { 0.0 }));
        let alone: Pixels = vec![pixel(0, 2.0), pixel(1, 4.0), pixel(2, 1.0), pixel(3, 1.0)];
        let covariance = covariance(&alone, &[], 4.0).unwrap();
        assert!((covariance.diagonal() - DVec3::new(1.0, 0.25, 4.0)).length() < 1e-12);
        assert!(super::covariance(&alone[..3].to_vec(), &[], 4.0).is_none());
    }

    #[test]
    fn photons_and_reading_make_noise() {
        assert_eq!(Noise::Share(0.5).variance(0.1, 4.0), 4.0);
        // 400 counts of 1000 are 800 electrons, whose root is 14.1 counts; with 5 counts of reading 15 counts.
        let noise = Noise::Counts { light: 1000.0, gain: 0.5, read: 5.0 };
        assert!((noise.variance(0.4, 9.0) - 225e-6).abs() < 1e-12);
    }

    /// By hand: pixels 0 and 1 depend on x, with the information 2. A neighbour that shares no pixel takes nothing from
    /// it. A neighbour whose x changes pixel 0 as much makes that pixel count half.
    #[test]
    fn neighbours_take_what_they_share() {
        let own: Pixels = vec![
            (0, [1.0, 0.0, 0.0, 1.0]),
            (1, [-1.0, 0.0, 0.0, 1.0]),
            (2, [0.0, 1.0, 0.0, 0.0]),
            (3, [0.0, 0.0, 1.0, 0.0]),
        ];
        let far: Pixels =
            (4..8).map(|n| (n, std::array::from_fn(|k| f64::from(u8::from(k as u32 + 4 == n))))).collect();
        let x = |others: &[&Pixels]| covariance(&own, others, 1.0).map(|covariance| covariance.x_axis.x);
        assert!((x(&[]).unwrap() - 0.5).abs() < 1e-12 && (x(&[&far]).unwrap() - 0.5).abs() < 1e-12);
        let mut near = far.clone();
        near.insert(0, (0, [1.0, 0.0, 0.0, 0.0]));
        // The neighbour's x is known by its own pixel to 1: pixel 0 counts half.
        let wanted = (1.5 - 0.5f64.powi(2) / 1.5).recip();
        assert!((x(&[&near]).unwrap() - wanted).abs() < 1e-12, "{:?}, wanted {wanted}", x(&[&near]));
    }

    /// Half of the members of the only slab with particles are blind: no median is known.
    #[test]
    fn blind_particles_count() {
        let member = |n: usize, is_blind: bool| Member {
            place: DVec3::new(0.0, 0.0, 0.1 + 0.01 * n as f64),
            pixels: Vec::new(),
            counts: true,
            covariance: (!is_blind).then_some(DMat3::IDENTITY),
        };
        let experiment = Experiment {
            per_lenslet: 1.0,
            noise: Noise::Share(0.01),
            sigma_px: 0.75,
            depth_mm: [0.0, 10.0],
            window_mm: 1.0,
            seed: 0,
        };
        for (blind, wanted) in [(1, Some(1.0)), (2, None)] {
            let members = (0..4).map(|n| member(n, n < blind)).collect();
            let found = by_depth(&[Sample { members, inner_mm: 1.0 }], &experiment, 1.0);
            assert_eq!((found.count[0], found.deviations.mm[0][0]), (4, wanted));
        }
    }
}
