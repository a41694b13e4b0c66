//! In: the particles of a frame, a camera, a seed.
//! Out: the light on the sensor, counts for each pixel.
//! Open `render.rs` first.

mod aberrations;
mod coherent;
mod diffraction;
mod instrument;
mod render;
mod samples;
mod second_stop;
mod sources;
mod tally;
mod thick_lens;

pub use diffraction::Diffraction;
pub use instrument::Instrument;
pub use render::{NOISE_SAMPLE, Rendered, frame, frame_bytes, measure_noise, white, white_bytes};
pub use samples::Shape;
pub use second_stop::SecondStop;
pub use sources::{Glow, RayCount, WhiteCells};
pub use thick_lens::{Surface, ThickLens};
