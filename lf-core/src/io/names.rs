//! Names of inputs and outputs, whether two of them are one file, and failures of the system in words.

use super::os::{FileId, file_id, stdin_file, stdout_file};
use crate::{Error, Refusal};
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind};
use std::path::Path;

/// Whether `path` is `-`, a standard stream.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// A path without the page that its end names, and the page: `frames.tif:3` is page 3, from 0, of `frames.tif`. A file
/// of exactly the typed name is taken as it stands, and so is a name whose file would not exist without the page.
pub fn split_page(path: &Path) -> (&Path, Option<usize>) {
    let split = || {
        let (file, digits) = path.to_str()?.rsplit_once(':')?;
        let page = digits.bytes().all(|digit| digit.is_ascii_digit()).then(|| digits.parse().ok())??;
        (!path.exists() && Path::new(file).exists()).then_some((Path::new(file), Some(page)))
    };
    split().unwrap_or((path, None))
}

/// Name of an input in messages: its path, or `standard input` for `-`.
pub fn name(path: &Path) -> String {
    if is_standard(path) { "standard input".into() } else { path.display().to_string() }
}

/// Name of an output in messages: its path, or `standard output` for `-`.
pub fn output_name(path: &Path) -> String {
    if is_standard(path) { "standard output".into() } else { path.display().to_string() }
}

/// Whether an output and an input (`-`: standard streams) are the same plain file. Devices and pipes never are.
pub fn same_file(output: &Path, input: &Path) -> bool {
    let id = |path: &Path, stream| -> Option<FileId> {
        metadata(path, stream).filter(Metadata::is_file).map(|found| file_id(path, &found))
    };
    let output = id(output, stdout_file);
    output.is_some() && output == id(input, stdin_file)
}

/// Metadata of a file, or for `-` of a standard stream that is a file.
pub(super) fn metadata(path: &Path, stream: fn() -> Option<io::Result<File>>) -> Option<Metadata> {
    let found = if is_standard(path) { stream()?.and_then(|file| file.metadata()) } else { fs::metadata(path) };
    found.ok()
}

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
