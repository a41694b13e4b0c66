//! The functions of `unix.rs` and `faults.rs` by the standard library alone.

use std::fs::{self, File, Metadata, Permissions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::SystemTime;

static IS_GUARDED: AtomicBool = AtomicBool::new(false);

/// A plain file: its path without links, and when it was created. A file that takes the place of another is new.
pub type FileId = (PathBuf, Option<SystemTime>);

/// The identity of the file at a path, with these metadata.
pub fn file_id(path: &Path, found: &Metadata) -> FileId {
    (fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()), found.created().ok())
}

/// Standard input as a file: the standard library reads it as a stream only.
pub fn stdin_file() -> Option<io::Result<File>> {
    None
}

/// Standard output as a file; see [`stdin_file`].
pub fn stdout_file() -> Option<io::Result<File>> {
    None
}

/// Permissions of a new file; None: as the system gives them.
pub fn new_permissions() -> Option<Permissions> {
    None
}

/// A file without a name: every draft has a name here.
pub fn nameless(_: &Path) -> Option<File> {
    None
}

/// Gives a nameless file a name.
pub fn link(_: &File, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Marks this process as a tool. The system's own messages report its faults.
pub fn guard(_: &'static str) {
    IS_GUARDED.store(true, Relaxed);
}

/// Whether [`guard`] was called: this process is a tool and not a test.
pub fn is_guarded() -> bool {
    IS_GUARDED.load(Relaxed)
}

/// Gives memory that was freed back to the system, where it can be asked to.
pub fn release_memory() {}

/// Name of a mapped input, for the line about its loss, which no other system than Unix reports.
pub struct Named;

impl Named {
    /// Names the mapped bytes.
    pub fn new(_: &[u8], _: &str) -> Self {
        Self
    }
}

/// Whether standard output was closed when the program began; unknown here.
pub fn stdout_was_closed() -> bool {
    false
}
