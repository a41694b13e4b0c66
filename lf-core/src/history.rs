//! How a file came to be: the steps written into every header.

use serde::{Deserialize, Serialize};

/// One run of one tool.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Step {
    /// The tool, `lf-mart`.
    pub tool: String,
    /// Its version.
    pub version: String,
    /// What was typed after its name.
    pub arguments: Vec<String>,
}

/// Oldest step first.
pub type History = Vec<Step>;
