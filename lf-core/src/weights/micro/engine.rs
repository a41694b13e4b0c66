//! Projection and back-projection of voxels by exact weights.

use super::array::LensletArray;
use super::bend::{Bend, alike_mm};
use super::images::{self, MicroImages, MicroLayout};
use super::kernel::{Count, Gather, RunningSums, Spread};
use super::patches::Patches;
use super::slices::{Light, SliceLight};
use super::stop::Stop;
use super::walk::{Segment, SliceBeam, WalkBuffers, walk};
use super::wanted::Wanted;
use crate::simd::fastest;
use crate::weights::{bent::Bent, geometry::Geometry, lenslets::Lenslets, model::RowSet};
use glam::{DVec2, Vec4};
use rayon::prelude::*;
use std::{
    ops::Range,
    sync::{Arc, OnceLock},
};

/// Lenslet rows are processed in about this many bands, so that there is work for all threads; a band has at least
/// `MIN_ROWS`.
const BANDS: usize = 16;
const MIN_ROWS: usize = 4;
/// Voxels of a block of a line, where rays are not straight.
const MIN_BLOCK: usize = 8;
const MAX_BLOCK: usize = 96;
/// Voxels of a parallel task of the back-projection.
const RUN: usize = 4096;
/// Lines whose weights are counted to estimate those of all.
const SAMPLE: usize = 64;
/// Bytes of a line, see [`Lines`].
const LINE_BYTES: usize = 12;

/// Exact weights of any camera, made where they are used.
#[derive(Debug, Clone)]
pub struct Micro {
    pub(crate) geometry: Geometry,
    pub(crate) array: LensletArray,
    pub(super) stop: Stop,
    /// Voxels of a block of a line. Within a block the chief rays' places are taken as linear in x.
    block: usize,
    slices: Vec<OnceLock<SliceLight>>,
    /// How rays bend in each slice, found when first used.
    bends: Vec<OnceLock<Arc<Bend>>>,
    pub(crate) one_by_one: OneByOne,
}

/// How a voxel's weights are made one by one, to store them.
#[derive(Debug, Clone)]
pub(crate) enum OneByOne {
    /// For straight rays.
    Lenslets(Lenslets),
    /// For bent rays or a tilted sensor.
    Bent(Bent),
}

/// The voxels of a support, line after line.
#[derive(Debug, Clone)]
pub struct Lines {
    /// Voxels of line (y, z) are `starts[y + ny z] .. starts[y + ny z + 1]`.
    starts: Vec<u32>,
    /// Their places along x.
    x: Vec<u32>,
    /// Range of y of the chief rays of each line, mm.
    y_mm: Vec<[f32; 2]>,
}

impl Lines {
    /// Drops the voxels that are not held.
    pub fn retain(&mut self, held: &[bool]) {
        let mut each = held.iter();
        self.x.retain(|_| *each.next().expect("one for each"));
        let (mut kept, mut n) = (0, 0);
        for end in &mut self.starts {
            kept += held[n..*end as usize].iter().filter(|held| **held).count() as u32;
            n = *end as usize;
            *end = kept;
        }
    }

    fn voxels(&self, line: usize) -> Range<usize> {
        self.starts[line] as usize..self.starts[line + 1] as usize
    }
}

/// Buffers of a thread.
struct ThreadBuffers {
    segment: Segment,
    found: WalkBuffers,
}

impl ThreadBuffers {
    fn new(side: usize) -> Self {
        Self { segment: Segment::default(), found: WalkBuffers::new(side) }
    }
}

impl Micro {
    /// Upper bound of the bytes of a slice before its tables are made.
    pub(crate) const LIST_BYTES: usize = size_of::<OnceLock<SliceLight>>()
        + size_of::<OnceLock<Arc<Bend>>>()
        + if Lenslets::LIST_BYTES > Bent::LIST_BYTES { Lenslets::LIST_BYTES } else { Bent::LIST_BYTES };

    pub(crate) fn new(geometry: Geometry) -> Self {
        let stop = Stop { half_mm: geometry.optics.half_aperture_mm as f32, is_round: geometry.has_round_stop };
        let slices = vec![OnceLock::new(); geometry.grid.shape[2]];
        let array = LensletArray::new(&geometry.optics);
        // Straight rays on a lattice along x without distortion need no blocks.
        let is_straight = !geometry.optics.bends_rays()
            && array.along.y.abs() < 1e-6 * array.along.x
            && geometry.optics.distortion_mm(DVec2::ONE, 0.0) == DVec2::ZERO;
        let voxel_mm = geometry.optics.beta(0.0) * geometry.grid.spacing_mm[0];
        let alike_at = |z: usize| alike_mm(&geometry.optics, geometry.grid.centre_mm(2, z));
        let alike = (alike_at(0).min(alike_at(slices.len() - 1)) / voxel_mm) as usize;
        let block = if is_straight { 4096 } else { alike.clamp(MIN_BLOCK, MAX_BLOCK) };
        let one_by_one = match geometry.optics.bends_rays() || array.is_tilted() {
            true => OneByOne::Bent(Bent::new(geometry.clone())),
            false => OneByOne::Lenslets(Lenslets::new(geometry.clone())),
        };
        let bends = vec![OnceLock::new(); slices.len()];
        Self { array, stop, block, slices, bends, one_by_one, geometry }
    }

    /// Columns and rows of the sensor.
    pub fn sensor_px(&self) -> [usize; 2] {
        self.geometry.optics.sensor_px
    }

    /// Buffers for sets of every `step`-th image row.
    pub fn images(&self, step: usize) -> MicroImages {
        MicroImages::new(&self.array, step)
    }

    /// The lines of voxels `indices` (rising).
    pub fn lines(&self, indices: &[u64]) -> Lines {
        let [nx, ny, nz] = self.geometry.grid.shape;
        let start = |line: u64| indices.partition_point(|index| *index < line * nx as u64) as u32;
        let starts: Vec<u32> = (0..=ny as u64 * nz as u64).into_par_iter().map(start).collect();
        let rows = (0..ny * nz).into_par_iter().map(|line| {
            let (y, z) = (line % ny, line / ny);
            let ends = [0, nx / 2, nx - 1].map(|x| self.chief_mm([x, y, z]).y as f32);
            [ends.iter().fold(f32::INFINITY, |a, b| a.min(*b)), ends.iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b))]
        });
        Lines { y_mm: rows.collect(), starts, x: indices.iter().map(|index| (index % nx as u64) as u32).collect() }
    }

    /// How rays bend in a slice; None if they are straight.
    fn bend(&self, z: usize) -> Option<Arc<Bend>> {
        let bend = || Arc::new(Bend::new(&self.geometry, z));
        self.geometry.optics.bends_rays().then(|| self.bends[z].get_or_init(bend).clone())
    }

    pub(super) fn slice(&self, z: usize) -> &SliceLight {
        self.slices[z].get_or_init(|| SliceLight::new(&self.geometry, &self.array, self.stop, z, self.bend(z)))
    }

    /// Where a voxel's ray through the middle of the stop meets the array, mm.
    fn chief_mm(&self, [x, y, z]: [usize; 3]) -> DVec2 {
        let grid = &self.geometry.grid;
        let place = DVec2::new(grid.centre_mm(0, x), grid.centre_mm(1, y));
        self.geometry.optics.array_from_object(place, grid.centre_mm(2, z), DVec2::ZERO)
    }

    /// Calls `work(beam, segment, voxels)` for each segment of a line.
    #[inline(always)]
    fn segments(
        &self,
        lines: &Lines,
        line: usize,
        segment: &mut Segment,
        mut work: impl FnMut(&SliceBeam, &Segment, Range<usize>),
    ) {
        let voxels = lines.voxels(line);
        let ny = self.geometry.grid.shape[1];
        let (y, z) = (line % ny, line / ny);
        let slice = self.slice(z);
        let chief = |x: usize| self.chief_mm([x, y, z]);
        let size = self.block;
        let mut first = voxels.start;
        while first < voxels.end {
            // Take the voxels of the next block.
            let block = lines.x[first] as usize / size * size;
            let end = first + lines.x[first..voxels.end].iter().take_while(|x| (**x as usize) < block + size).count();
            // Interpolate where their chief rays meet the array.
            let (from, to) = (chief(block), chief(block + size));
            let step = (to - from) / size as f64;
            segment.x.clear();
            segment.y.clear();
            for x in &lines.x[first..end] {
                let place = from + f64::from(*x - block as u32) * step;
                segment.x.push(place.x as f32);
                segment.y.push(place.y as f32);
            }
            // Take the bend of the rays at the middle of the block.
            let node = slice.bend.as_ref().map(|bend| bend.near(0.5 * (from + to)));
            let beam = SliceBeam { array: &self.array, slice, node, stop: self.stop };
            work(&beam, segment, first..end);
            first = end;
        }
    }

    /// Sets the set's rows of an image of `stride` values a row to the light of the voxels: p_i = sum_j w_ij E_j.
    pub fn project(
        &self,
        lines: &Lines,
        strengths: &[f32],
        rows: RowSet,
        images: &mut MicroImages,
        (image, stride): (&mut [f32], usize),
    ) {
        let array = &self.array;
        let band = (array.rows() / BANDS).max(MIN_ROWS);
        let ny = self.geometry.grid.shape[1];
        let MicroImages { layout, values, remainders, .. } = images;
        let layout = *layout;
        values.par_chunks_mut(band * layout.stride).enumerate().for_each_init(
            || ThreadBuffers::new(array.side),
            |buffers, (n, values)| {
                values.fill(0.0);
                // Start a band of lenslet rows.
                let lenslets = n * band..n * band + values.len() / layout.stride;
                let wanted = Wanted { rows, lenslets, layout, remainders };
                for z in 0..self.slices.len() {
                    if lines.starts[z * ny] == lines.starts[(z + 1) * ny] {
                        continue;
                    }
                    // Skip slices without voxels, and lines whose light misses the band.
                    let [low, high] = self.seen_mm(&wanted.lenslets, self.slice(z));
                    for line in z * ny..(z + 1) * ny {
                        let [least, greatest] = lines.y_mm[line];
                        if greatest < low || least > high || lines.voxels(line).is_empty() {
                            continue;
                        }
                        // Spread the strengths of the line's voxels over the micro-images of the band.
                        let ThreadBuffers { segment, found } = buffers;
                        self.segments(lines, line, segment, |beam, segment, voxels| {
                            let patches = patches(beam.slice);
                            let strengths = &strengths[voxels];
                            let mut spread = Spread { layout, patches, strengths, values };
                            fastest(
                                #[inline(always)]
                                || walk::<false>(beam, segment, &wanted, found, &mut spread),
                            );
                        });
                    }
                }
            },
        );
        // Multiply by the stop and add the micro-images up to the image.
        images.add_up(array, self.stop, rows, self.sensor_px()[0], stride, image);
    }

    /// Range of y of the chief rays, mm, whose light can reach these rows of lenslets.
    fn seen_mm(&self, rows: &Range<usize>, slice: &SliceLight) -> [f32; 2] {
        let array = &self.array;
        let last = (array.length - 1) as f32 * array.along.y as f32;
        let ends = [rows.start, rows.end - 1].map(|row| array.starts[row][1]);
        let ys = [ends[0], ends[1], ends[0] + last, ends[1] + last];
        let reach = std::f32::consts::SQRT_2 * (slice.reach_mm + array.departure) as f32;
        let low = ys.iter().fold(f32::INFINITY, |a, b| a.min(*b));
        [low - reach, ys.iter().fold(f32::NEG_INFINITY, |a, b| a.max(*b)) + reach]
    }

    /// Calls `update(j, strength, sum_i w_ij v_i, sum_i w_ij)` on every voxel's value, i over the set's rows of an
    /// image of `stride` values a row. The last sum is approximate where the stop cuts.
    pub fn back_project<T: Send>(
        &self,
        lines: &Lines,
        strengths: &mut [T],
        rows: RowSet,
        images: &mut MicroImages,
        (image, stride): (&[f32], usize),
        update: impl Fn(usize, &mut T, f32, f32) + Sync,
    ) {
        let array = &self.array;
        // Multiply the image by the stop, lenslet by lenslet.
        images.look_up(array, self.stop, rows, self.sensor_px()[0], stride, image);
        let MicroImages { layout, values, remainders, .. } = &*images;
        let wanted = Wanted { rows, lenslets: 0..array.rows(), layout: *layout, remainders };
        let optics = &self.geometry.optics;
        // Weights are summed in units of the stop's area.
        let half = f64::from(self.stop.half_mm) * optics.demagnification / optics.pixel_pitch_mm;
        let per_area = (1.0 / (half * half * if self.stop.is_round { std::f64::consts::PI } else { 4.0 })) as f32;
        // Gather the sums of each voxel, a run of lines at a time.
        runs(lines, strengths).into_par_iter().for_each_init(
            || ThreadBuffers::new(array.side),
            |buffers, (run_lines, strengths)| {
                let base = lines.starts[run_lines.start] as usize;
                let (mut sums, mut weights) = (Vec::new(), Vec::new());
                let running = &mut RunningSums::new();
                for line in run_lines {
                    let ThreadBuffers { segment, found } = buffers;
                    self.segments(lines, line, segment, |beam, segment, voxels| {
                        let patches = patches(beam.slice);
                        sums.clear();
                        sums.resize(voxels.len(), Vec4::ZERO);
                        weights.clear();
                        weights.resize(voxels.len(), 0.0);
                        let (sums_out, weights_out) = (&mut sums[..], &mut weights[..]);
                        let mut gather = Gather {
                            layout: *layout,
                            patches,
                            values,
                            sums: sums_out,
                            weights: weights_out,
                            running: &mut *running,
                        };
                        fastest(
                            #[inline(always)]
                            || walk::<true>(beam, segment, &wanted, found, &mut gather),
                        );
                        for ((voxel, sum), weight) in voxels.zip(&sums).zip(&weights) {
                            update(voxel, &mut strengths[voxel - base], sum.element_sum(), *weight * per_area);
                        }
                    });
                }
            },
        );
    }

    /// Whether all light of a voxel lands on the sensor, for each voxel.
    pub fn are_whole(&self, lines: &Lines) -> Vec<bool> {
        let optics = &self.geometry.optics;
        let half = optics.middle_px() * optics.pixel_pitch_mm;
        // The image of the stop under a lenslet reaches as far from the lenslet's centre.
        let stop = f64::from(self.array.side as u32) * optics.pixel_pitch_mm;
        let ny = self.geometry.grid.shape[1];
        let whole = |line: usize| {
            let mut segment = Segment::default();
            let mut whole = Vec::with_capacity(lines.voxels(line).len());
            if lines.voxels(line).is_empty() {
                return whole;
            }
            let reach = self.slice(line / ny).reach_mm + stop + self.array.departure;
            let [most_x, most_y] = (half - reach).as_vec2().to_array();
            self.segments(lines, line, &mut segment, |_, segment, _| {
                whole.extend(segment.x.iter().zip(&segment.y).map(|(x, y)| x.abs() < most_x && y.abs() < most_y));
            });
            whole
        };
        (0..lines.starts.len() - 1).into_par_iter().flat_map_iter(whole).collect()
    }

    /// Pixels that a voxel of `lines` lights, each as often as lenslets send light there: the mean of a sample.
    pub fn weights_per_voxel(&self, lines: &Lines) -> f64 {
        // Choose lines with voxels, evenly spread.
        let lit: Vec<usize> = (0..lines.starts.len() - 1).filter(|line| !lines.voxels(*line).is_empty()).collect();
        let sample: Vec<usize> = lit.iter().step_by(lit.len().div_ceil(SAMPLE).max(1)).copied().collect();
        // Count in one set of rows, in which each micro-image has a single row.
        let step = self.array.side;
        let rows = RowSet { first: 0, step: step as u32 };
        let layout = MicroLayout::new(&self.array, step);
        let remainders = images::remainders(&self.array, step);
        let wanted = Wanted { rows, lenslets: 0..self.array.rows(), layout, remainders: &remainders };
        let count = |line: &usize| {
            let mut buffers = ThreadBuffers::new(self.array.side);
            let (mut weights, mut voxels) = (0, 0);
            self.segments(lines, *line, &mut buffers.segment, |beam, segment, _| {
                let columns = patches(beam.slice).map_or(step, |patches| patches.columns);
                let mut count = Count { columns: columns.min(step), weights: 0 };
                walk::<false>(beam, segment, &wanted, &mut buffers.found, &mut count);
                weights += count.weights * step;
                voxels += segment.x.len();
            });
            [weights, voxels]
        };
        let [weights, voxels] = sample.par_iter().map(count).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        weights as f64 / voxels.max(1) as f64
    }

    /// Predicts the bytes of the tables, the lenslets, and buffers for sets of every `step`-th image row.
    pub fn estimated_bytes(&self, step: usize) -> u64 {
        let slices = self.geometry.grid.shape[2];
        let tables: usize = (0..slices)
            .into_par_iter()
            .map(|z| SliceLight::estimated_bytes(&self.geometry, &self.array, z, self.bend(z).as_deref()))
            .sum();
        let lines = LINE_BYTES * self.geometry.grid.shape[1] * slices;
        (tables + lines + self.array.bytes() + MicroImages::estimated_bytes(&self.array, step)) as u64
    }
}

fn patches(slice: &SliceLight) -> Option<&Patches> {
    if let Light::Narrow(patches) = &slice.light { Some(patches) } else { None }
}

/// Runs of lines with at least [`RUN`] voxels each, and their strengths.
fn runs<'a, T>(lines: &Lines, strengths: &'a mut [T]) -> Vec<(Range<usize>, &'a mut [T])> {
    let mut runs = Vec::new();
    let (mut rest, mut first) = (strengths, 0);
    let count = lines.starts.len() - 1;
    for line in 0..count {
        let length = (lines.starts[line + 1] - lines.starts[first]) as usize;
        if length >= RUN || line + 1 == count {
            let (run, tail) = rest.split_at_mut(length);
            runs.push((first..line + 1, run));
            (rest, first) = (tail, line + 1);
        }
    }
    runs
}
