//! In: the content of any file that the tools read or write.
//! Out: a description that fits a screen.
//! Open first: `kind.rs`, which finds the kind of a file.

mod camera;
mod description;
mod exports;
mod field;
mod image;
mod kind;
mod numbers;
mod objects;
mod particles;
mod summary;
mod volume;

pub use camera::camera;
pub use description::Description;
pub use exports::{centres, picture, table, vti};
pub use field::field;
pub use image::image;
pub use kind::FileKind;
pub use objects::json;
pub use particles::particles;
pub use summary::Summary;
pub use volume::volume;
