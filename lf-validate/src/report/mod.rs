//! A page that shows a run: one HTML file without any other.
//!
//! In: the folder of `scripts/pipeline.mk`, or any folder with files of the tools. Out: the text of a page with its
//! script, its styles and its pictures inside. Open first: `page.rs`, which puts the sections together; `folder.rs`
//! says which files are looked for, and a [`Source`] gives them. A file that cannot be read is named on the page and
//! does not stop it.

mod camera;
mod fields;
mod folder;
mod frames;
mod html;
mod motion;
mod packed;
mod page;
mod particles;
mod source;
mod space;
mod stages;
mod verdict;
mod volumes;
mod warnings;

pub use folder::inputs;
pub use page::{PageOptions, Report, report};
pub use source::Source;
