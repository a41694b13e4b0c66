//! What the command reads and tells.

pub mod arguments;
pub mod report;
