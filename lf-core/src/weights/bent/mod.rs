//! In: a voxel. Out: its pixels and their weights, where a medium bends the rays or the sensor is tilted.
//! First file to open: `path.rs`; `rays.rs` is the map from the aperture to the array, `shares.rs` a cell's share of a
//! beam.

mod path;
mod rays;
mod shares;

pub(super) use path::Bent;
