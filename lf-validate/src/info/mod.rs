//! In: the content of any file that the tools read or write.
//! Out: a description that fits a screen.
//! Open first: `kind.rs`, which tells what a file is.

mod camera;
mod description;
mod export;
mod field;
mod image;
mod kind;
mod objects;
mod particles;
mod summary;
mod volume;

pub use camera::camera;
pub use description::Sheet;
pub use export::{centres, picture, table, vti};
pub use field::field;
pub use image::image;
pub use kind::Kind;
pub use objects::{json, records};
pub use particles::particles;
pub use summary::Summary;
pub use volume::volume;
