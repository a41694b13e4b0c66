//! In: the content of any file that the tools read or write.
//! Out: a description that fits a screen.
//! Open first: `kind.rs`, which finds the kind of a file.

mod camera;
mod data;
mod description;
mod kind;
mod numbers;
mod objects;
mod tables;

pub use camera::camera;
pub use data::{field, image, volume};
pub use description::Description;
pub use kind::FileKind;
pub use objects::json;
pub use tables::{centres, particles, picture, table, vti};
