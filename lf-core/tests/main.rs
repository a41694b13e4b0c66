//! Tests of lf-core's files: formats, streams, tiles and charts.

mod allocation;
mod field;
mod image;
mod image_kinds;
mod io;
mod plot;
mod tile;
mod volume;
