//! The library of the light-field tools: files, camera, rays, weights, fields. Data flows one way:
//!
//! 1. [`io`] reads an input; [`camera`], [`image`], [`volume`], [`field`], [`particles`] and [`scene`] check it.
//! 2. [`camera`] and its [`lattice`] of lenslets give the rays ([`optics`]); a [`grid`] places voxels in space.
//! 3. [`light`] checks whether a frame was taken by its camera. [`views`] and [`weights`] give the pixels that a voxel
//!    lights and [`flow`] moves particles; [`statistics`], [`normal`], [`linear`] and [`simd`] serve all.
//! 4. [`volume`], [`image`] and [`field`] encode results with their [`history`], [`io`] writes them.
//! 5. [`cli`] is what the command lines of all tools share; [`json`] names the mistakes in files that people write.
//!
//! The file formats are specified in [`volume::format`] (`.lfv`), [`field`], [`image`], [`camera`], [`particles`] and
//! [`scene`]. Lengths are millimetres, places on the image are pixels; the frame and its signs are in [`optics`], its
//! mark in files in [`mod@frame`].
//!
//! # A stage of your own
//!
//! A program that links this crate reads and writes the same files as the tools, so it can take the place of any of
//! them. This one stands in for the reconstruction: each voxel gets the count of the pixel that its chief ray meets.
//!
//! ```no_run
//! use glam::DVec2;
//! use lf_core::image::{self, FrameFiles};
//! use lf_core::{Camera, Optics, Volume, io, volume};
//!
//! fn main() -> lf_core::Result<()> {
//!     let camera = Camera::open("camera.json".as_ref())?;
//!     let file = "camera.json".as_ref();
//!     let image = image::open_frame("frame.exr".as_ref(), FrameFiles::default(), &camera, file, None)?.pixels;
//!     let support = Volume::open("support.lfv".as_ref())?;
//!     let (grid, optics) = (support.grid(), Optics::new(&camera));
//!
//!     let mut intensity = vec![0.0; support.count()];
//!     for (value, index) in intensity.iter_mut().zip(support.indices()) {
//!         let voxel = grid.voxel(*index);
//!         let [x, y, z] = [0, 1, 2].map(|axis| grid.centre_mm(axis, voxel[axis]));
//!         let hit_mm = optics.sensor_from_object(DVec2::new(x, y), z, DVec2::ZERO);
//!         if let Some((column, row)) = optics.pixel_at(hit_mm) {
//!             *value = image[[row, column]].max(0.0); // A blind pixel is NaN and becomes 0.
//!         }
//!     }
//!
//!     let columns: [(&str, &[f32]); 1] = [("intensity", &intensity)];
//!     io::save("volume.lfv".as_ref(), |out| {
//!         volume::write(out, grid, support.indices(), &columns, support.history())
//!     })
//! }
//! ```
//!
//! [`cli::run`] adds what a tool has beyond this: exit codes, errors of one line, `--threads`, `--stats`, progress, and
//! this run in the history. `scripts/examples/refocus` is a complete stage to copy.

pub mod camera;
pub mod cli;
pub mod error;
pub mod field;
pub mod flow;
pub mod fourier;
pub mod frame;
pub mod grid;
pub mod halo;
pub mod history;
pub mod image;
pub mod io;
pub mod json;
pub mod lattice;
pub mod light;
pub mod linear;
pub mod normal;
pub mod optics;
pub mod particle_image;
pub mod particles;
pub mod scene;
pub mod simd;
pub mod statistics;
pub mod views;
pub mod volume;
pub mod weights;

pub use camera::Camera;
pub use cli::{Session, Verdict};
pub use error::{Error, Refusal, Result};
pub use field::{Field, VectorGrid};
pub use grid::Grid;
pub use history::History;
pub use optics::Optics;
pub use particles::Particle;
pub use volume::{JoinedVolume, Tile, Volume};
pub use weights::Weights;
