//! Vector fields: EXR, `.vti`, NetCDF, `.csv`.
//!
//! In: the bytes of an EXR or NetCDF field. Out: a [`Field`], and files in any of these formats.
//! Open first: `vectors.rs`, then `vector_grid.rs` for what else the EXR holds.
//!
//! **EXR** is the format that stages exchange. It has one part with the `f32` channels
//!
//! | channel | meaning | unit |
//! | --- | --- | --- |
//! | `u`, `v`, `w` | displacement along x, y, z in the object frame of [`crate::optics`] | mm |
//! | `peak` | normalised correlation at the peak, 0 to 1 | 1 |
//! | `ratio` | first to second correlation peak | 1 |
//! | `su`, `sv`, `sw` | standard uncertainty of u, v, w; NaN if not estimated | mm |
//! | `flag` | 0 measured, 1 replaced from its neighbours, 2 no data | 1 |
//! | `count` | particle images in the window; NaN if not counted; a file may lack this channel | 1 |
//!
//! and one text attribute `lf:field`: the JSON of [`VectorGrid`], and `units`, an object with the unit of every
//! channel, which readers ignore, and `frame`, which must be `right-handed` (see
//! [`mod@crate::frame`]). A field of nx x ny x nz vectors is an image nx wide and ny nz high; vector (i, j, k)
//! is the pixel in column i of row k ny + j. A displacement must be finite unless its flag is 2.
//!
//! A file may hold more channels, such as the vorticity: [`Field::save_with`] writes them and readers ignore them.
//!
//! **`.nc`** is NetCDF for xarray and other readers of the CF conventions. It is read too, in the classic format and
//! without the dimension t, also from other programs. The others are only written: **`.vti`** is VTK image data for
//! ParaView, **`.csv`** is text for a spreadsheet. They also hold the velocity, mm/s, if the time between the volumes
//! is known.

mod cut;
mod export;
mod file;
mod interpolation;
mod netcdf;
mod vector_grid;
mod vectors;

pub use cut::{AXES, COMPONENTS, Cut};
pub use export::{Array, ImageData, Time, save_arrays, save_series, write_field_data};
pub use interpolation::{Cell, Difference, Interpolated};
pub use vector_grid::VectorGrid;
pub use vectors::{Field, MEASURED, NO_DATA, REPLACED};
