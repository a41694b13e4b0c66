//! What any of the chain's files is, in one screen of text.

mod camera;
mod export;
mod field;
mod image;
mod json;
mod kind;
mod particles;
mod sheet;
mod volume;

pub use camera::camera;
pub use export::{centres, picture, table, vti};
pub use field::field;
pub use image::image;
pub use json::{json, records};
pub use kind::Kind;
pub use particles::particles;
pub use sheet::Sheet;
pub use volume::volume;
