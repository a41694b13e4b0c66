//! The one kind of failure that a user sees: what was used, what was found there, what was wanted.

/// A failure as the command line prints it: `subject: found; wanted`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{subject}: {found}; {wanted}")]
pub struct Error {
    /// The file, option or stream that was used.
    pub subject: String,
    /// The value or state found there.
    pub found: String,
    /// The value or state wanted instead.
    pub wanted: String,
}

/// A result whose failure is an [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A failure; each part is a phrase without a full stop, and `wanted` begins with the word "wanted".
    pub fn new(subject: impl Into<String>, found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { subject: subject.into(), found: found.into(), wanted: wanted.into() }
    }
}

/// Why an input is refused, without the name of the file or option it came from; [`Refusal::about`] adds the name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{found}; {wanted}")]
pub struct Refusal {
    /// The value or state found.
    pub found: String,
    /// The value or state wanted instead.
    pub wanted: String,
}

impl Refusal {
    /// A refusal; each part is a phrase without a full stop, and `wanted` begins with the word "wanted".
    pub fn new(found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { found: found.into(), wanted: wanted.into() }
    }

    /// Refuses if the condition does not hold. `found` is worded only then.
    pub fn unless<F: Into<String>>(
        holds: bool,
        found: impl FnOnce() -> F,
        wanted: impl Into<String>,
    ) -> std::result::Result<(), Self> {
        if holds { Ok(()) } else { Err(Self::new(found(), wanted)) }
    }

    /// The refusal as an error about a file, an option or a stream.
    pub fn about(self, subject: impl Into<String>) -> Error {
        Error::new(subject, self.found, self.wanted)
    }
}
