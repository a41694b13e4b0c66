//! Estimate of the memory that a correlation takes.

use super::deform::spread_count;
use super::options::{Deform, Options};
use crate::correlate::shared_sums;
use crate::volumes::{Mask, Rows, Sparse};

/// Bytes of a lit voxel in [`Rows`]: x and intensity.
const LIT: f64 = 8.0;
/// Bytes of a lit voxel in the lists that make a deformed volume; they may grow to twice their length.
const LISTED: f64 = 16.0;
/// Bytes of a lit voxel before it is moved: target and intensity.
const MOVED: f64 = 16.0;
/// Bytes of a voxel lit in either of two matched volumes, during the search for particle images.
const OVERLAID: f64 = 40.0;
/// Number of voxels lit in either of two matched volumes, over the number lit in one.
const EITHER: f64 = 1.3;

/// Bytes of a window along one axis: its start, cuts, cells and users.
pub(crate) const AXIS_BYTES: f64 = 100.0;
/// Bytes of a cell: the particle images in it.
const CELL: f64 = 600.0;
/// Bytes of a window: its vectors of this repeat and the last, their statistics, and the headers of its sums.
const WINDOW: f64 = 400.0;

/// Estimate of the peak bytes of a correlation, without the volumes themselves, from a few slices of the first pair.
/// Expects input that has been checked.
pub(crate) fn bytes(pairs: &[[Sparse; 2]], mask: &Mask, options: &Options) -> u64 {
    let first = Rows::new(&pairs[0][0], mask, options.floor);
    let [nx, ny, nz] = first.shape;
    let volumes = (2 * pairs.len()) as f64;
    let row_starts = 8.0 * (ny * nz) as f64;
    let all: f64 = pairs.iter().flatten().map(|volume| volume.indices.len() as f64).sum();
    // A support masks a copy.
    let copies = if let Mask::Support(_) = mask { 2.0 } else { 1.0 };
    let plain = copies * (LIT * all + volumes * row_starts);

    // Lit voxels of all volumes, of one, and of one deformed over one.
    let lit = first.count() as f64 / pairs[0][0].indices.len().max(1) as f64 * all;
    let one = lit / volumes;
    let spread = spread_count(&first) / first.count().max(1) as f64;
    let deformed = spread * LIT * lit + volumes * row_starts;
    let moving = one * (spread * LISTED + MOVED) + 4.0 * (nx * ny * rayon::current_num_threads()) as f64;
    let overlaid = OVERLAID * EITHER * one * spread.max(1.0);

    // Take the maximum over three phases: volumes are moved, volumes are correlated, particle images are sought.
    let held = if options.deform == Deform::Never { 0.0 } else { deformed };
    let peak = |of_pass: &dyn Fn(usize) -> f64| (0..options.passes.len()).map(of_pass).fold(0.0, f64::max);
    let grid = |number: usize| options.passes[number].binned(first.shape, options.is_last(number)).windows();
    let sums = peak(&|number| pass_bytes(options, number, first.shape, pairs.len(), lit));
    let windows = peak(&|number| WINDOW * grid(number).count() as f64);
    let cells = peak(&|number| CELL * grid(number).cell_count() as f64);
    let phases = [deformed + moving, held + sums, deformed + overlaid + cells];
    (plain + windows + phases.into_iter().fold(0.0, f64::max)) as u64
}

/// Bytes of the sums of a pass, and of `lit` voxels in its bins.
fn pass_bytes(options: &Options, number: usize, shape: [usize; 3], pairs: usize, lit: f64) -> f64 {
    let binned = options.passes[number].binned(shape, options.is_last(number));
    let in_bins = if binned.bin == [1; 3] { 0.0 } else { LIT * lit };
    shared_sums::budget(&binned.windows(), binned.pass.search, pairs) + in_bins
}
