//! `particles.csv`: a table of particles in the object frame of [`crate::optics`].
//!
//! In: the text of a table. Out: a list of [`Particle`], and tables. Open first: `particle.rs`, then `reader.rs`.
//!
//! A text file in UTF-8. Lines that begin with `#` may come first; then comes a header, [`HEADER`] or
//! [`FITTED_HEADER`]; every other line is one particle, numbers between commas. Blank lines and spaces about a number
//! are ignored. Any order of lines is allowed.
//!
//! The tools write [`FRAME_LINE`] first. A table without it is read as if it had it, and tools warn of it, because in a
//! table of lf 0.1.0 x has the other sign: [`mod@crate::frame`]. Add the line to a table of your own.
//!
//! Columns are found by their names, in any order, and others are not read. The three of the place are enough: without
//! the others the frame is 0, particles are numbered from 0, and each has one count of light. `x_um` and `x_m` are in
//! micrometres and metres, and so on for y, z and their uncertainties. The tools write these columns, [`HEADER`]:
//!
//! | column | unit | meaning |
//! | --- | --- | --- |
//! | `frame` | | number of the frame, a whole number from 0 |
//! | `id` | | number of the particle, a whole number, the same in every frame where it is known |
//! | `x_mm`, `y_mm`, `z_mm` | mm | its centre, finite |
//! | `intensity` | counts | light that it sends through the aperture, finite, 0 or more |
//!
//! A table of measured particles has [`FITTED_HEADER`], which adds how uncertain they are:
//!
//! | column | unit | meaning |
//! | --- | --- | --- |
//! | `sx_mm`, `sy_mm`, `sz_mm` | mm | standard uncertainty of the centre, 0 or more |
//! | `s_intensity` | counts | standard uncertainty of the light, 0 or more |
//! | `cxx_mm2`, `cxy_mm2`, `cxz_mm2`, `cyy_mm2`, `cyz_mm2`, `czz_mm2` | mm² | covariance of the centre |
//!
//! The covariance must be positive semidefinite, and `sx_mm` the square root of `cxx_mm2` to 1 %, and so on: the first
//! three columns are for readers that need no correlations. Near the focal plane x or y and z correlate by up to 0.99.
//! A table with the first three only says that they do not correlate.

mod columns;
mod covariance;
mod draw;
mod particle;
mod reader;
mod writer;

pub use columns::{FITTED_HEADER, HEADER};
pub use draw::{BATCH, REACH_SIGMA, draw};
pub use particle::{Particle, Uncertainty};
pub use reader::{CORRECTED, FRAME_LINE, corrected, frame, history, open, read, warn_unmarked};
pub use writer::write;
