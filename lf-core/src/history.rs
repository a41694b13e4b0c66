//! The history of a file: the runs of tools that led to it, written into every header.

use serde::{Deserialize, Serialize};

/// One run of one tool.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Step {
    /// Name of the tool, such as `lf-mart`.
    pub tool: String,
    /// Version of the tool.
    pub version: String,
    /// Command line after the name of the tool.
    pub arguments: Vec<String>,
}

/// The steps of a file, oldest first.
pub type History = Vec<Step>;
