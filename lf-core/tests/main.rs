//! Tests of lf-core's files: formats, streams and tiles.

mod allocation;
mod field;
mod image;
mod image_kinds;
mod io;
mod tile;
mod volume;
