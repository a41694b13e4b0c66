//! Pairs of sparse volumes to a velocity field, by multigrid cross-correlation of the lit voxels.
//!
//! ```text
//! seeding/    volumes  ->  the particle images in them, and windows that suit them
//! volumes/    lit voxels and a mask  ->  rows of lit voxels
//! correlate/  rows, windows, boxes of trial shifts  ->  the correlation peak of every window
//! vectors/    peaks  ->  outliers replaced, a smooth field, uncertainties
//! passes/     coarse to fine: correlate, predict, deform the volumes, correlate again  ->  the field
//! tracks/     the field, particles of both frames  ->  pairs, and the field that they decide
//! plan.rs     checks the input, estimates memory, runs the passes; open it first
//! ```
//!
//! Each pass lays interrogation windows over the volume, sums the products of the two volumes over every trial shift,
//! and fits the peak of the normalised correlation. Its vectors predict the shift for the next, finer pass. The last
//! pass is repeated on volumes deformed by the known field, until the vectors stop changing.
//!
//! - Only lit voxels cost time, and each only once: windows that overlap share the sums of their common cells (after
//!   Discetti & Astarita, Exp. Fluids, 2012).
//! - Both windows move: each volume takes half of a trial shift, so a vector stands where it was measured, and
//!   exchanging the volumes negates the field exactly.
//! - The correlation is zero-mean and normalised by the energy of the voxels that each shift pairs, so that window
//!   edges, gain and long particles do not pull the peak. The fit is a three-dimensional Gaussian that may be tilted.
//! - Deformation sends each lit voxel to the midpoint of the predicted displacement, spread with a quintic spline. The
//!   predictor follows gradients where there is evidence of them.
//! - Vectors that fail the normalised median test (Westerweel & Scarano, Exp. Fluids, 2005) are searched again;
//!   those that still fail are replaced and flagged. A window without light gives no data, never a silent zero.
//! - Standard uncertainties come from the disagreement of the particle images in a window (after Wieneke, Meas. Sci.
//!   Technol., 2015), and from how much the flow bends inside windows, by the places of the images.
//! - Windows can be chosen from the particles found: [`Seeding`].
//!
//! ```
//! use lf_core::grid::Grid;
//! use lf_xcorr::{Options, Sparse, correlate};
//!
//! let grid = Grid { shape: [16, 16, 16], spacing_mm: [0.1, 0.1, 0.5], origin_mm: [0.0; 3] };
//! let at = |x: usize, z: usize| grid.index([x, 8, z]);
//! let intensity = [1.0, 2.0];
//! let (before, after) = ([at(5, 7), at(9, 8)], [at(7, 8), at(11, 9)]);
//! let options = Options::coarse_to_fine([16; 3], [16; 3], 0.75, [4; 3], [3; 3]);
//! let first = Sparse { grid: &grid, indices: &before, intensity: &intensity };
//! let second = Sparse { grid: &grid, indices: &after, intensity: &intensity };
//! let field = correlate(&first, &second, &options).unwrap().field;
//! assert_eq!((field.u[0], field.v[0], field.w[0]), (0.2, 0.0, 0.5));
//! ```

mod correlate;
mod error;
mod passes;
mod plan;
mod seeding;
mod tracks;
mod vectors;
mod volumes;

pub use error::{Refused, Side};
pub use passes::{Counts, Deform, Options, Outcome, Pass, PassReport, Repeat, triple};
pub use plan::{Plan, correlate};
pub use seeding::{Seeding, WANTED_PARTICLES, near_cube, sides_mm};
pub use tracks::{Pair, Tracks, TracksReport, decide};
pub use vectors::MedianTest;
pub use volumes::{Mask, Sparse};
