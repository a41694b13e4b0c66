//! Writes an output whole or not at all.

use super::names::{is_standard, output_name, writing};
use super::{draft, os, watched::check_inputs};
use crate::{Error, Result};
use std::fs::{self, OpenOptions, Permissions};
use std::io::{self, BufWriter, ErrorKind, IsTerminal, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Bytes gathered before a write. From 64 KiB up, the cost of the system call is negligible.
const BUFFER: usize = 256 * 1024;

/// Symbolic links that are followed before a chain counts as a ring. Linux has the same limit.
const LINKS: usize = 40;

/// Checks before the work that an output can be created: a file can be made in its folder, it is not a folder and not
/// protected, and standard output is open. Leaves nothing behind.
pub fn check_place(path: &Path) -> Result<()> {
    let refused = |error: io::Error| writing(&output_name(path), &error);
    match place(path).map_err(refused)? {
        OutputPlace::Replace(place, _) => draft::begin(folder_of(&place)).map(drop).map_err(refused),
        OutputPlace::Standard | OutputPlace::Through => Ok(()),
    }
}

/// Checks the place of a picture, and that its name does not promise another format than SVG, PNG and PDF.
pub fn check_picture(path: &Path) -> Result<()> {
    const OTHERS: [&str; 6] = ["jpg", "jpeg", "eps", "tif", "tiff", "gif"];
    let other = path.extension().filter(|end| OTHERS.iter().any(|other| end.eq_ignore_ascii_case(other)));
    let Some(end) = other else { return check_place(path) };
    let found = format!("the name of a .{} file", end.to_string_lossy());
    Err(Error::new(output_name(path), found, "wanted FILE.svg, FILE.png or FILE.pdf, the formats drawn"))
}

/// Writes `path` whole or not at all; `-` is standard output. Refuses a terminal, which cannot show binary output.
pub fn save(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    write(path, false, fill)
}

/// Writes text as [`save`] does; a terminal is allowed.
pub fn save_text(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    write(path, true, fill)
}

fn folder_of(place: &Path) -> &Path {
    place.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

fn write(path: &Path, text: bool, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let subject = output_name(path);
    let failed = |error: io::Error| writing(&subject, &error);
    match place(path).map_err(failed)? {
        OutputPlace::Replace(place, old) => {
            let folder = folder_of(&place);
            let (file, draft) = draft::begin(folder).map_err(failed)?;
            let file = fill_and_flush(file, fill).map_err(failed)?;
            if let Some(old) = old {
                file.set_permissions(old).map_err(failed)?;
            }
            file.sync_all().map_err(failed)?;
            check_inputs()?;
            draft.finish(&file, &place, folder).map_err(failed)?;
        }
        stream => {
            let (file, is_terminal) = open_stream(&stream, path).map_err(failed)?;
            if !text && is_terminal {
                return Err(Error::new(subject, "a terminal", "wanted a file or a pipe for binary output (-o FILE)"));
            }
            fill_and_flush(file, fill).map_err(failed)?;
        }
    }
    Ok(())
}

fn fill_and_flush<W: Write>(file: W, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<W> {
    let mut buffered = BufWriter::with_capacity(BUFFER, file);
    let outcome = fill(&mut buffered).and_then(|()| buffered.flush());
    // After a failure the rest of the buffer is dropped, not written.
    let (file, _) = buffered.into_parts();
    outcome.map(|()| file)
}

/// The kind of output that a path names.
enum OutputPlace {
    /// Standard output.
    Standard,
    /// A device, a FIFO or an open descriptor, which is written directly.
    Through,
    /// A plain file: its path without symbolic links, and the permissions of the file that it replaces. The new file
    /// appears there when it is complete.
    Replace(PathBuf, Option<Permissions>),
}

/// Determines the kind of output that a path names. Opens no device or FIFO, since that may wait for a reader.
fn place(path: &Path) -> io::Result<OutputPlace> {
    if is_standard(path) || path == Path::new("/dev/stdout") {
        return if os::stdout_was_closed() { Err(io::Error::other("closed")) } else { Ok(OutputPlace::Standard) };
    }
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(found) if found.is_file() && !names_a_descriptor(path) => {
            // Do not replace a file that its owner has made read-only.
            OpenOptions::new().write(true).open(path)?;
            Ok(OutputPlace::Replace(fs::canonicalize(path)?, Some(found.permissions())))
        }
        Ok(_) => Ok(OutputPlace::Through),
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            let mut place = path.to_owned();
            for _ in 0..LINKS {
                let Ok(next) = fs::read_link(&place) else {
                    let has_folder = folder_of(&place).is_dir();
                    return if has_folder {
                        Ok(OutputPlace::Replace(place, None))
                    } else {
                        Err(ErrorKind::NotFound.into())
                    };
                };
                place = place.parent().unwrap_or(Path::new("")).join(next);
            }
            Err(io::Error::other("a ring of symbolic links"))
        }
        Err(error) => Err(error),
    }
}

/// Opens standard output, a device, a FIFO or a descriptor; whether it is a terminal.
fn open_stream(place: &OutputPlace, path: &Path) -> io::Result<(Box<dyn Write>, bool)> {
    if let OutputPlace::Standard = place {
        io::stdout().flush()?;
        let stream: Box<dyn Write> = match os::stdout_file() {
            Some(file) => Box::new(file?),
            None => Box::new(io::stdout()),
        };
        return Ok((stream, io::stdout().is_terminal()));
    }
    let mut file = OpenOptions::new().write(true).open(path)?;
    if file.metadata()?.is_file() {
        file.seek(SeekFrom::End(0))?;
    }
    let is_terminal = file.is_terminal();
    Ok((Box::new(file), is_terminal))
}

/// Whether a path names an open descriptor. Replacing its file would cut off others that hold it open.
fn names_a_descriptor(path: &Path) -> bool {
    path.starts_with("/dev/fd") || path.starts_with("/proc") || path == Path::new("/dev/stderr")
}
