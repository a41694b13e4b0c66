//! Errors of the system in the words of [`Error`].

use crate::{Error, Refusal};
use std::io::{self, ErrorKind};

/// The error of a failed write. An [`Error`] carried inside is returned as it is, a [`Refusal`] as one about `subject`.
pub fn writing(subject: &str, error: &io::Error) -> Error {
    use ErrorKind::{BrokenPipe, FileTooLarge, IsADirectory, NotFound, QuotaExceeded, StorageFull};
    let (found, wanted) = match error.kind() {
        BrokenPipe => ("closed by its reader before the end".to_owned(), "wanted a reader that takes everything"),
        StorageFull | QuotaExceeded | FileTooLarge => (phrase(error), "wanted room for the whole output"),
        NotFound => ("its folder does not exist".to_owned(), "wanted an existing folder"),
        IsADirectory => ("is a folder".to_owned(), "wanted a file to write"),
        _ => (phrase(error), "wanted a place to write"),
    };
    carried(subject, error).unwrap_or_else(|| Error::new(subject, found, wanted))
}

/// The error of a failed read; see [`writing`].
pub(super) fn reading(subject: &str, error: &io::Error) -> Error {
    let found = match error.kind() {
        ErrorKind::NotFound => "no such file".to_owned(),
        ErrorKind::IsADirectory => "is a folder".to_owned(),
        _ => phrase(error),
    };
    carried(subject, error).unwrap_or_else(|| Error::new(subject, found, "wanted a file to read"))
}

fn carried(subject: &str, error: &io::Error) -> Option<Error> {
    let inner = error.get_ref()?;
    let refusal = || inner.downcast_ref::<Refusal>().map(|refusal| refusal.clone().about(subject));
    inner.downcast_ref::<Error>().cloned().or_else(refusal)
}

/// The system's own words, fit for the middle of a line.
fn phrase(error: &io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or_default();
    let mut letters = text.chars();
    match letters.next() {
        Some(first) if letters.as_str().starts_with(char::is_lowercase) => {
            first.to_lowercase().chain(letters).collect()
        }
        _ => text.to_owned(),
    }
}
