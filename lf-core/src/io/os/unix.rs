//! Drafts, identities and standard input on Unix.

use std::fs::{File, Metadata};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::{fs::Permissions, io, os::fd::AsFd, path::Path};

/// Permissions before the umask: everybody may read and write.
const MODE: u32 = 0o666;

/// A plain file, by whatever path: device and inode.
pub type FileId = (u64, u64);

/// The identity of the file with these metadata. The path does not matter.
pub fn file_id(_: &Path, found: &Metadata) -> FileId {
    (found.dev(), found.ino())
}

/// Standard input as a file, without the buffer of the standard library. None if the system has no such thing.
pub fn stdin_file() -> Option<io::Result<File>> {
    Some(io::stdin().as_fd().try_clone_to_owned().map(File::from))
}

/// Standard output as a file; see [`stdin_file`].
pub fn stdout_file() -> Option<io::Result<File>> {
    Some(io::stdout().as_fd().try_clone_to_owned().map(File::from))
}

/// Permissions of a new file; None: as the system gives them.
pub fn new_permissions() -> Option<Permissions> {
    Some(Permissions::from_mode(MODE))
}

/// A file without a name. None if the system has no such files, or could not name one later.
#[cfg(target_os = "linux")]
pub fn nameless(folder: &Path) -> Option<File> {
    use std::os::unix::fs::OpenOptionsExt;
    if !Path::new(DESCRIPTORS).is_dir() {
        return None;
    }
    let flags = rustix::fs::OFlags::TMPFILE.bits() as i32;
    File::options().read(true).write(true).mode(MODE).custom_flags(flags).open(folder).ok()
}

/// The folder in which Linux lists the open files of this process.
#[cfg(target_os = "linux")]
const DESCRIPTORS: &str = "/proc/self/fd";

/// Gives a nameless file a name.
#[cfg(target_os = "linux")]
pub fn link(file: &File, path: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    use std::os::fd::AsRawFd;
    let opened = format!("{DESCRIPTORS}/{}", file.as_raw_fd());
    Ok(linkat(CWD, opened, CWD, path, AtFlags::SYMLINK_FOLLOW)?)
}

/// A file without a name: this system has none.
#[cfg(not(target_os = "linux"))]
pub fn nameless(_: &Path) -> Option<File> {
    None
}

/// Gives a nameless file a name.
#[cfg(not(target_os = "linux"))]
pub fn link(_: &File, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}
