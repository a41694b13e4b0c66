//! In: a `scene.json`, or the name of a ready scene.
//! Out: a checked scene; the target of dots that it asks for.
//! Open `keys.rs` first.

mod check;
mod dots;
mod keys;
mod posed;
pub mod ready;

pub use check::check;
pub use dots::Dots;
pub use keys::{Particles, Scene, Truth, White};
pub use posed::seen;
