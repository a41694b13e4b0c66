//! Opens an input; knows binary formats by their first bytes.

use super::bytes::Bytes;
use super::names::{is_standard, name, reading};
use super::os::stdin_file;
use crate::{Error, Result};
use std::io::{self, IsTerminal, Read};
use std::{fs::File, path::Path};

/// Opens a file, or standard input for `-`. Refuses a folder and a terminal.
pub fn open(path: &Path) -> Result<Bytes> {
    let refused = |error: io::Error| reading(&name(path), &error);
    if !is_standard(path) {
        return Bytes::read(File::open(path).map_err(refused)?, path).map_err(refused);
    }
    if io::stdin().is_terminal() {
        return Err(Error::new(name(path), "a terminal", "wanted a file or a pipe"));
    }
    let mut buffer = Vec::new();
    let bytes = match stdin_file() {
        Some(file) => file.and_then(|file| Bytes::read(file, path)),
        None => io::stdin().read_to_end(&mut buffer).map(|_| buffer.into()),
    };
    bytes.map_err(refused)
}

/// Reads a small text file in UTF-8 (JSON, CSV). Drops a byte order mark; an error names a known binary format.
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

/// A binary format that a user may give to a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Signature {
    Exr,
    Png,
    Tiff,
    Lfv,
    NetCdf,
    Gzip,
    Zip,
}

impl Signature {
    /// The format of a file with these first bytes; None for others. TIFF includes BigTIFF, NetCDF
    /// every HDF5.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Self::Exr),
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Self::Tiff),
            [0x89, b'L', b'F', b'V', ..] => Some(Self::Lfv),
            [b'C', b'D', b'F', ..] | [0x89, b'H', b'D', b'F', ..] => Some(Self::NetCdf),
            [0x1f, 0x8b, ..] => Some(Self::Gzip),
            [b'P', b'K', 3, 4, ..] => Some(Self::Zip),
            _ => None,
        }
    }

    /// The format in words, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exr => "an EXR",
            Self::Png => "a PNG",
            Self::Tiff => "a TIFF",
            Self::Lfv => "a .lfv",
            Self::NetCdf => "a NetCDF",
            Self::Gzip => "a gzip file",
            Self::Zip => "a zip file",
        }
    }
}
