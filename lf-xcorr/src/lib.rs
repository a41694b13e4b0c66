//! Sparse volumes in pairs to a velocity field: multigrid cross-correlation of the lit voxels.
//!
//! Each pass lays interrogation windows over the volume, sums the products of the two volumes over every trial shift, and
//! fits the peak of the normalised correlation; its validated vectors predict the shift for the next, finer pass. The last
//! pass is repeated on volumes deformed by what is known, until the vectors stand still.
//!
//! - The work is done on the lit voxels, and once: windows that overlap share the sums of the cells they have in common
//!   (a sparse direct correlation after Discetti & Astarita, Exp. Fluids 53, 2012; 64 windows share a cell at 75 % overlap).
//!   Where Fourier transforms of each window should be faster they find the peak, and direct sums its place.
//! - Both windows move: a trial shift is taken half from each volume, so a vector stands where it was measured, and on the
//!   direct path exchanging the volumes negates the field exactly.
//! - The correlation is zero-mean and normalised by the energy of what each shift pairs, so that window edges, gain and
//!   long particles do not pull the peak; the fit is a three-dimensional Gaussian, tilt included.
//! - Deformation sends the light to the midpoints of a predicted field, voxel by lit voxel, and spreads it with a spline that
//!   moves five moments of a particle image exactly. The predictor follows gradients where there is evidence of them.
//! - Vectors pass the normalised median test (Westerweel & Scarano, Exp. Fluids 39, 2005), are searched again, or are
//!   replaced and say so. A window without light gives no data, never a silent zero.
//! - Standard uncertainties come from how the particle images of a window disagree (after Wieneke, Meas. Sci. Technol. 26,
//!   2015), and from what of the field the windows are too large for.
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

mod cost;
mod deform;
mod energy;
mod error;
mod evidence;
mod fill;
mod fit;
mod kernel;
mod lattice;
mod level;
mod mask;
mod memory;
mod multigrid;
mod neighbours;
mod options;
#[cfg(test)]
mod oracle;
mod outcome;
mod overlap;
mod overlay;
mod pass;
mod peak;
pub mod plot;
mod predictor;
mod response;
mod run;
mod score;
mod shifts;
mod smooth;
mod sparse;
mod transform;
mod uncertainty;
mod validation;

pub use error::{Error, Side};
pub use level::Counts;
pub use mask::Mask;
pub use memory::estimate_bytes;
pub use multigrid::{correlate, correlate_pairs, windows};
pub use options::{Deform, MedianTest, Options, Pass, Route, triple};
pub use outcome::{Outcome, PassReport, Repeat};
#[doc(hidden)]
pub use pass::one_pass;
pub use sparse::Sparse;
