//! Names of inputs and outputs, and whether two of them are one file.

use std::fs::{self, File, Metadata};
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Whether `path` is `-`, a standard stream.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Name of an input in messages: its path, or `standard input` for `-`.
pub fn name(path: &Path) -> String {
    if is_standard(path) { "standard input".into() } else { path.display().to_string() }
}

/// Name of an output in messages: its path, or `standard output` for `-`.
pub fn output_name(path: &Path) -> String {
    if is_standard(path) { "standard output".into() } else { path.display().to_string() }
}

/// Whether an output and an input are the same plain file, also under different names; `-` is standard output and
/// standard input. Devices and pipes are never the same.
pub fn same_file(output: &Path, input: &Path) -> bool {
    let look = |path: &Path, stream: BorrowedFd| -> Option<(u64, u64)> {
        let found =
            if is_standard(path) { standard(stream).and_then(|file| file.metadata()) } else { fs::metadata(path) };
        found.ok().filter(Metadata::is_file).map(|found| (found.dev(), found.ino()))
    };
    let output = look(output, io::stdout().as_fd());
    output.is_some() && output == look(input, io::stdin().as_fd())
}

/// A second handle on a standard stream, without the buffer of the first.
pub(super) fn standard(stream: BorrowedFd) -> io::Result<File> {
    Ok(File::from(stream.try_clone_to_owned()?))
}
