//! Helpers that the tests of all crates share.
//!
//! In: the names of tools, or the program of one tool. Out: folders, calls and their checked ends, small sample inputs,
//! and a table of ways to use the tools. Open `folder.rs` first.

pub mod call;
pub mod folder;
pub mod samples;
pub mod scripts;
pub mod tools;
pub mod uses;

pub use call::{Call, Ended};
pub use folder::{Folder, Workbench};
