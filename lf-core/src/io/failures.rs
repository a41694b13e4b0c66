//! Errors of the system in the words of [`Error`].

use crate::{Error, Refusal};
use std::io::{self, ErrorKind};

/// The error of a failed write. An [`Error`] carried inside is returned as it is, a [`Refusal`] as one about `subject`.
pub fn writing(subject: &str, error: &io::Error) -> Error {
    if let Some(carried) = carried(subject, error) {
        return carried;
    }
    match error.kind() {
        ErrorKind::BrokenPipe => {
            Error::new(subject, "closed by its reader before the end", "wanted a reader that takes everything")
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            Error::new(subject, phrase(error), "wanted room for the whole output")
        }
        ErrorKind::NotFound => Error::new(subject, "its folder does not exist", "wanted an existing folder"),
        ErrorKind::IsADirectory => Error::new(subject, "is a folder", "wanted a file to write"),
        _ => Error::new(subject, phrase(error), "wanted a place to write"),
    }
}

/// The error of a failed read. An [`Error`] carried inside is returned as it is, a [`Refusal`] as one about `subject`.
pub(super) fn reading(subject: &str, error: &io::Error) -> Error {
    if let Some(carried) = carried(subject, error) {
        return carried;
    }
    match error.kind() {
        ErrorKind::NotFound => Error::new(subject, "no such file", "wanted a file to read"),
        ErrorKind::IsADirectory => Error::new(subject, "is a folder", "wanted a file to read"),
        _ => Error::new(subject, phrase(error), "wanted a file to read"),
    }
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
