//! Opens an input.

use super::names::{is_standard, name, standard};
use super::{bytes::Bytes, failures::reading, signature::Signature};
use crate::{Error, Result};
use std::fs::File;
use std::io::{self, IsTerminal};
use std::os::fd::AsFd;
use std::path::Path;

/// Opens a file, or standard input for `-`. Refuses a folder and a terminal.
pub fn open(path: &Path) -> Result<Bytes> {
    let refused = |error: io::Error| reading(&name(path), &error);
    if !is_standard(path) {
        return Bytes::read(File::open(path).map_err(refused)?).map_err(refused);
    }
    let stdin = standard(io::stdin().as_fd()).map_err(refused)?;
    if stdin.is_terminal() {
        return Err(Error::new(name(path), "a terminal", "wanted a file or a pipe"));
    }
    Bytes::read(stdin).map_err(refused)
}

/// Reads a small text file (JSON, CSV). A byte order mark is dropped. Refuses bytes that are not UTF-8 and names known
/// binary formats.
pub fn open_text(path: &Path) -> Result<String> {
    let bytes = open(path)?;
    let text = std::str::from_utf8(&bytes).map_err(|error| {
        let found = Signature::of(&bytes).map_or_else(
            || format!("byte {} is not part of UTF-8 text", error.valid_up_to()),
            |format| format!("{}, no text", format.name()),
        );
        Error::new(name(path), found, "wanted a text file in UTF-8")
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text).to_owned())
}
