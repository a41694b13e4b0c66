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

impl Step {
    /// The word after the first of these names of an option.
    pub fn option(&self, names: [&str; 2]) -> Option<&str> {
        let at = self.arguments.iter().position(|word| names.contains(&word.as_str()))?;
        self.arguments.get(at + 1).map(String::as_str)
    }
}

/// The steps of a file, oldest first.
pub type History = Vec<Step>;

/// A line for each step, oldest first, for formats that hold a history as text: `lf-mart 0.1.0: a.lfv -i a.exr`.
/// Control characters become spaces.
pub fn lines(history: &History) -> Vec<String> {
    let plain = |letter: char| if letter.is_control() { ' ' } else { letter };
    let line = |step: &Step| format!("{} {}: {}", step.tool, step.version, step.arguments.join(" "));
    history.iter().map(|step| line(step).chars().map(plain).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_one_line() {
        let step =
            Step { tool: "lf-mart".into(), version: "0.1.0".into(), arguments: vec!["a\nb".into(), "-q".into()] };
        assert_eq!([step.option(["-i", "a\nb"]), step.option(["-q", "--quiet"])], [Some("-q"), None]);
        assert_eq!(lines(&vec![step]), ["lf-mart 0.1.0: a b -q"]);
    }
}
