//! An output before it is complete.
//!
//! With O_TMPFILE (Linux) the draft has no name, and a killed process leaves nothing behind. Elsewhere, as on NFS, it
//! is a file `.lf-*.part` in the folder of the output, which a killed process leaves there.

use super::os::{link, nameless, new_permissions};
use std::io::{self, Seek, SeekFrom};
use std::{fs::File, path::Path};
use tempfile::{Builder, NamedTempFile, TempPath};

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
    let mut names = names();
    if let Some(permissions) = new_permissions() {
        names.permissions(permissions);
    }
    names.tempfile_in(folder).map_err(without_path)
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
