//! An output before it is complete.
//!
//! With O_TMPFILE (Linux) the draft has no name, and a killed process leaves nothing behind. Elsewhere, as on NFS, it
//! is a file `.lf-*.part` in the folder of the output, which a killed process leaves there.

use std::fs::{File, Permissions};
use std::io::{self, Seek, SeekFrom};
use std::{os::unix::fs::PermissionsExt, path::Path};
use tempfile::{Builder, NamedTempFile, TempPath};

/// Permissions before the umask: everybody may read and write.
const MODE: u32 = 0o666;

pub(super) enum Draft {
    Nameless,
    Named(TempPath),
}

/// Creates an empty draft in a folder.
pub(super) fn begin(folder: &Path) -> io::Result<(File, Draft)> {
    if let Some(file) = nameless(folder) {
        return Ok((file, Draft::Nameless));
    }
    let (file, path) = named(folder)?.into_parts();
    Ok((file, Draft::Named(path)))
}

impl Draft {
    /// Gives the complete draft its final name and replaces a file that has this name.
    pub fn finish(self, file: &File, place: &Path, folder: &Path) -> io::Result<()> {
        let path = match self {
            Self::Named(path) => path,
            // A new name is given in one step. A process killed between two steps would leave the name of the first.
            Self::Nameless if link(file, place).is_ok() => return Ok(()),
            // A link cannot replace an existing name, a rename can: link the draft to a temporary name first.
            Self::Nameless => match names().make_in(folder, |path| link(file, path)) {
                Ok(named) => named.into_temp_path(),
                // Some file systems allow nameless files but do not let them be linked.
                Err(_) => copy(file, folder)?.into_temp_path(),
            },
        };
        path.persist(place).map_err(|refused| refused.error)
    }
}

fn named(folder: &Path) -> io::Result<NamedTempFile> {
    names().permissions(Permissions::from_mode(MODE)).tempfile_in(folder).map_err(without_path)
}

/// Copies a draft to a file with a temporary name.
fn copy(mut file: &File, folder: &Path) -> io::Result<NamedTempFile> {
    let mut named = named(folder)?;
    file.seek(SeekFrom::Start(0))?;
    io::copy(&mut file, named.as_file_mut())?;
    named.as_file().sync_all()?;
    Ok(named)
}

fn names() -> Builder<'static, 'static> {
    let mut names = Builder::new();
    names.prefix(".lf-").suffix(".part");
    names
}

/// Removes the temporary name that tempfile adds to its errors; it means nothing to a user.
fn without_path(error: io::Error) -> io::Error {
    let code = error.raw_os_error().or_else(|| {
        let source = std::error::Error::source(error.get_ref()?)?;
        source.downcast_ref::<io::Error>()?.raw_os_error()
    });
    code.map_or_else(|| error.kind().into(), io::Error::from_raw_os_error)
}

/// A file without a name. None if the system has no such files, or could not name one later.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
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

#[cfg(target_os = "linux")]
fn link(file: &File, path: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    use std::os::fd::AsRawFd;
    let opened = format!("{DESCRIPTORS}/{}", file.as_raw_fd());
    Ok(linkat(CWD, opened, CWD, path, AtFlags::SYMLINK_FOLLOW)?)
}

#[cfg(not(target_os = "linux"))]
fn nameless(_: &Path) -> Option<File> {
    None
}

#[cfg(not(target_os = "linux"))]
fn link(_: &File, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}
