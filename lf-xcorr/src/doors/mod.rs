//! What the command reads and tells.

pub mod arguments;
pub mod preset;
pub mod report;
