//! Tests of lf-core's files: formats, streams and tiles.

mod allocation;
mod field;
mod image;
mod io;
mod tile;
mod volume;
