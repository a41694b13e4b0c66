//! Why an image cannot be used, in the words of the front door but without a file's name.

/// What was found in an image and what was wanted; the door adds which file it was.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// What was found.
    pub found: String,
    /// What was wanted instead.
    pub wanted: String,
}

impl Refusal {
    /// `found; wanted`, each a phrase without a full stop.
    pub fn new(found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { found: found.into(), wanted: wanted.into() }
    }

    /// The refusal as an error about a file.
    pub fn about(self, subject: impl Into<String>) -> lf_core::Error {
        lf_core::Error::new(subject, self.found, self.wanted)
    }
}
