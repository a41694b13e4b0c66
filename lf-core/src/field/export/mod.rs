//! Fields for other programs: `.vti`, `.csv`, NetCDF.
//!
//! In: a [`super::Field`], or arrays on its places. Out: files. Open first: `vti.rs`; `cf.rs` says what a NetCDF holds.

mod cf;
mod csv;
mod netcdf;
mod parts;
mod vti;

pub(super) use cf::write_cf;
pub use cf::{Time, save_series};
pub(super) use csv::write_csv;
pub(super) use vti::write_vti;
pub use vti::{Array, ImageData, save_arrays, write_field_data};
