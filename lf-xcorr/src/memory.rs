//! What a correlation will take, before it is begun.

use crate::deform::spread_count;
use crate::lattice::Lattice;
use crate::level::binned;
use crate::mask::Mask;
use crate::options::{Deform, Options, Pass, Route};
use crate::sparse::{Rows, Sparse};

/// Bytes of a lit voxel: its place in its row, and its intensity.
const LIT: f64 = 8.0;

/// The same in the lists that a deformed volume is put together from, which may have grown to twice their length.
const LISTED: f64 = 16.0;

/// Bytes of a lit voxel that is to be moved: where to, and its intensity.
const MOVED: f64 = 16.0;

/// Bytes of a voxel lit in either of two volumes laid on each other, when its particle image is sought.
const OVERLAID: f64 = 40.0;

/// Voxels lit in either of two volumes laid on each other, over those of one.
const EITHER: f64 = 1.3;

/// Voxels by which the shifts that a cell's windows ask for reach beyond the search of one of them, each about its own
/// prediction; more where no deformation takes the predictions away.
const HULL: [usize; 2] = [1, 2];

/// Bytes of a cell: the particle images in it.
const CELL: f64 = 600.0;

/// Bytes of a window: its vectors of this repeat and the last, what is known of them, and its sums' headings.
const WINDOW: f64 = 400.0;

/// Bytes that [`crate::correlate_pairs`] will have in use at most, beside the volumes themselves: an estimate by a few slices
/// of the first pair. Expects options that fit.
pub fn estimate_bytes(pairs: &[[Sparse; 2]], mask: &Mask, options: &Options) -> u64 {
    let first = Rows::new(&pairs[0][0], mask, options.floor);
    let all: f64 = pairs.iter().flatten().map(|volume| volume.indices.len() as f64).sum();
    let shape = first.shape;
    let share = first.count() as f64 / pairs[0][0].indices.len().max(1) as f64;
    let volumes = 2 * pairs.len();
    let starts = 8.0 * (shape[1] * shape[2]) as f64;
    let plain = LIT * all + volumes as f64 * starts;
    let spread = spread_count(&first) / first.count().max(1) as f64;
    // Each repeat is made while the last is still held; uncertainties take one that is deformed in any case.
    let held = if options.deform == Deform::Never { 1.0 } else { 2.0 };
    // Lit voxels of all volumes and of one.
    let lit = share * all;
    let one = lit / volumes as f64;
    let deformed = spread * LIT * lit + volumes as f64 * starts;
    let moving = one * (spread * LISTED + MOVED) + 4.0 * (shape[0] * shape[1] * rayon::current_num_threads()) as f64;
    let overlaid = OVERLAID * EITHER * one * spread.max(1.0);
    let of_pass = |(number, pass): (usize, &Pass)| {
        let (shape, pass, _) = binned(shape, pass, number + 1 < options.passes.len());
        let lattice = Lattice::new(shape, &pass);
        let hull = if number == 0 { 0 } else { HULL[usize::from(options.deform == Deform::Never)] };
        let wide = Pass { search: pass.search.map(|radius| radius + hull), ..pass };
        let sums = wide.direct_bytes(&lattice, pairs.len());
        // What is too much is done by transforms.
        let sums = if options.route != Route::Transform && sums <= Pass::MOST_BYTES { sums } else { 0.0 };
        let cells: usize = lattice.axes.iter().map(|axis| axis.cells.len()).product();
        sums + transform_bytes(&pass) + WINDOW * lattice.count() as f64 + CELL * cells as f64
    };
    let sums = options.passes.iter().enumerate().map(of_pass).fold(0.0, f64::max);
    (plain + held * deformed + moving.max(overlaid) + sums) as u64
}

/// Bytes of the transforms of one window, for all threads.
fn transform_bytes(pass: &Pass) -> f64 {
    let size = [0, 1, 2].map(|axis| (pass.window[axis] + 2 * pass.search[axis]) as f64);
    // Two spectra of half as many complex numbers of 16 bytes, and what they are made in.
    24.0 * size.iter().product::<f64>() * rayon::current_num_threads() as f64
}
