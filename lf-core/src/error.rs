//! The one kind of failure a user sees: what was touched, what was found, what was wanted.

/// A failure in the words of the front door: `subject: found; wanted`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{subject}: {found}; {wanted}")]
pub struct Error {
    /// The file, option or stream that was being used.
    pub subject: String,
    /// What was found there.
    pub found: String,
    /// What was wanted instead.
    pub wanted: String,
}

/// A result whose failure is an [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// `subject: found; wanted`, each a phrase without a full stop.
    pub fn new(subject: impl Into<String>, found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { subject: subject.into(), found: found.into(), wanted: wanted.into() }
    }
}

/// Why a computation is refused: what was found and what was wanted. It knows no file; the caller says which one it was.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{found}; {wanted}")]
pub struct Refusal {
    /// What was found.
    pub found: String,
    /// What was wanted instead.
    pub wanted: String,
}

/// For callers that still fail with a text.
impl From<Refusal> for String {
    fn from(refusal: Refusal) -> Self {
        refusal.to_string()
    }
}

impl Refusal {
    /// `found; wanted`, each a phrase without a full stop.
    pub fn new(found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { found: found.into(), wanted: wanted.into() }
    }

    /// The refusal as an error about a file, an option or a stream.
    pub fn about(self, subject: impl Into<String>) -> Error {
        Error::new(subject, self.found, self.wanted)
    }
}
