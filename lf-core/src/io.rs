//! Opening files and pipes, and writing whole files or none.
//!
//! Inputs carry bytes, not names: a plain file is mapped, by name or by `<`, anything else is read to its end, and what
//! follows cannot tell the two apart. An output appears under its name complete, or the name is left as it was.

mod draft;

use crate::{Error, Result};
use std::fs::{self, File, Metadata, OpenOptions, Permissions};
use std::io::{self, BufWriter, ErrorKind, IsTerminal, Read, Seek, SeekFrom, Write};
use std::ops::Deref;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Every [`Bytes`] starts at a multiple of this, so that a `u64` can be read in place.
const ALIGNMENT: usize = 8;

/// Bytes gathered before a write; from 64 KiB up the system call no longer shows.
const BUFFER: usize = 256 * 1024;

/// Symbolic links followed before a chain is taken for a ring; what Linux itself allows.
const LINKS: usize = 40;

/// The bytes of an input: a plain file mapped read-only, or a pipe read to its end. Starts at an 8-byte boundary or better.
pub struct Bytes {
    storage: Storage,
}

enum Storage {
    Mapped(memmap2::Mmap),
    Owned { buffer: Vec<u8>, start: usize },
}

impl Bytes {
    /// Whether the bytes are a view of the file rather than a copy.
    pub fn is_mapped(&self) -> bool {
        matches!(self.storage, Storage::Mapped(_))
    }
}

impl From<Vec<u8>> for Bytes {
    fn from(mut buffer: Vec<u8>) -> Self {
        let mut start = buffer.as_ptr().align_offset(ALIGNMENT);
        if start != 0 {
            let len = buffer.len();
            buffer.reserve_exact(ALIGNMENT);
            start = buffer.as_ptr().align_offset(ALIGNMENT);
            buffer.resize(len + start, 0);
            buffer.copy_within(..len, start);
        }
        Self { storage: Storage::Owned { buffer, start } }
    }
}

impl Deref for Bytes {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        match &self.storage {
            Storage::Mapped(map) => map,
            Storage::Owned { buffer, start } => &buffer[*start..],
        }
    }
}

/// Whether `path` is `-`, a standard stream.
pub fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// What messages call an input or output: its path, or `standard input` for `-`.
pub fn name(path: &Path) -> String {
    if is_standard(path) { "standard input".into() } else { path.display().to_string() }
}

/// What messages call an output: its path, or `standard output` for `-`.
pub fn output_name(path: &Path) -> String {
    if is_standard(path) { "standard output".into() } else { path.display().to_string() }
}

/// Opens a file, or standard input for `-`.
pub fn open(path: &Path) -> Result<Bytes> {
    let refused = |error: io::Error| reading(&name(path), &error);
    if !is_standard(path) {
        return slurp(File::open(path).map_err(refused)?).map_err(refused);
    }
    let stdin = standard(io::stdin().as_fd()).map_err(refused)?;
    if stdin.is_terminal() {
        return Err(Error::new(name(path), "a terminal", "wanted a file or a pipe"));
    }
    slurp(stdin).map_err(refused)
}

/// Reads a small text file (JSON, CSV). A byte order mark is dropped.
pub fn open_text(path: &Path) -> Result<String> {
    let bytes = open(path)?;
    let text = std::str::from_utf8(&bytes).map_err(|error| {
        let found = kind(&bytes).map_or_else(
            || format!("byte {} is not part of UTF-8 text", error.valid_up_to()),
            |kind| format!("{kind}, no text"),
        );
        Error::new(name(path), found, "wanted a text file in UTF-8")
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text).to_owned())
}

/// What a binary file is by its first bytes; none of what the tools do not know.
fn kind(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 7] = [
        (b"\x76\x2f\x31\x01", "an EXR"),
        (b"\x89PNG", "a PNG"),
        (b"II*\0", "a TIFF"),
        (b"MM\0*", "a TIFF"),
        (b"\x89LFV", "a .lfv"),
        (b"\x1f\x8b", "a gzip file"),
        (b"PK\x03\x04", "a zip file"),
    ];
    kinds.iter().find_map(|(start, kind)| bytes.starts_with(start).then_some(*kind))
}

/// Refuses an output whose folder is not there, or that is a folder itself: what is known before the work need not wait
/// until after it.
pub fn check_place(path: &Path) -> Result<()> {
    if is_standard(path) {
        return Ok(());
    }
    let refused = |kind: ErrorKind| Err(writing(&output_name(path), &kind.into()));
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    match folder.map(fs::metadata) {
        Some(Err(error)) if error.kind() == ErrorKind::NotFound => return refused(ErrorKind::NotFound),
        Some(Ok(found)) if !found.is_dir() => return refused(ErrorKind::NotFound),
        _ => {}
    }
    if fs::metadata(path).is_ok_and(|found| found.is_dir()) { refused(ErrorKind::IsADirectory) } else { Ok(()) }
}

/// Refuses a picture under a name that promises another format than SVG.
pub fn check_picture(path: &Path) -> Result<()> {
    const OTHERS: [&str; 8] = ["png", "jpg", "jpeg", "pdf", "eps", "tif", "tiff", "gif"];
    match path.extension().filter(|end| OTHERS.iter().any(|other| end.eq_ignore_ascii_case(other))) {
        Some(end) => {
            let found = format!("the name of a .{} file", end.to_string_lossy());
            Err(Error::new(output_name(path), found, "wanted FILE.svg, the format drawn"))
        }
        None => check_place(path),
    }
}

/// Writes `path` whole or not at all; `-` is standard output. A terminal is refused.
pub fn save(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    write(path, false, fill)
}

/// Writes text as [`save`] does; a terminal is welcome.
pub fn save_text(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    write(path, true, fill)
}

/// Whether an output and an input are one plain file, whatever their names; `-` stands for standard output and standard
/// input. Devices and pipes are never the same.
pub fn same_file(output: &Path, input: &Path) -> bool {
    let look = |path: &Path, stream: BorrowedFd| -> Option<(u64, u64)> {
        let found =
            if is_standard(path) { standard(stream).and_then(|file| file.metadata()) } else { fs::metadata(path) };
        found.ok().filter(Metadata::is_file).map(|found| (found.dev(), found.ino()))
    };
    let output = look(output, io::stdout().as_fd());
    output.is_some() && output == look(input, io::stdin().as_fd())
}

/// Turns a failed write into the one error a user sees; an [`Error`] carried inside is returned as it is.
pub fn writing(subject: &str, error: &io::Error) -> Error {
    if let Some(carried) = carried(error) {
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

fn reading(subject: &str, error: &io::Error) -> Error {
    if let Some(carried) = carried(error) {
        return carried;
    }
    match error.kind() {
        ErrorKind::NotFound => Error::new(subject, "no such file", "wanted a file to read"),
        ErrorKind::IsADirectory => Error::new(subject, "is a folder", "wanted a file to read"),
        _ => Error::new(subject, phrase(error), "wanted a file to read"),
    }
}

fn carried(error: &io::Error) -> Option<Error> {
    error.get_ref().and_then(|inner| inner.downcast_ref::<Error>()).cloned()
}

/// The system's own words, in the middle of a line.
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

/// A second handle on a standard stream, past the buffer of the first.
fn standard(stream: BorrowedFd) -> io::Result<File> {
    Ok(File::from(stream.try_clone_to_owned()?))
}

fn slurp(mut file: File) -> io::Result<Bytes> {
    let found = file.metadata()?;
    if found.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    // Length zero is also what the files of /proc say of themselves.
    if found.is_file() && found.len() > 0 && file.stream_position()? == 0 {
        // SAFETY: the map is read-only and lives as long as the bytes lent from it. What cannot be ruled out is another
        // program that writes into the same file meanwhile: a change shows as changed values, which no reader here
        // trusts for memory safety (numbers, not references), and a truncation ends the process with SIGBUS. Our own
        // writers never write into an existing file, they replace it.
        if let Ok(map) = unsafe { memmap2::Mmap::map(&file) } {
            return Ok(Bytes { storage: Storage::Mapped(map) });
        }
    }
    let mut buffer = Vec::new();
    file.read_to_end(&mut buffer)?;
    Ok(buffer.into())
}

/// Where an output goes once its name is understood.
enum Target {
    /// A stream, device or FIFO, written straight through.
    Through(File),
    /// A plain file to appear under this name, with the permissions of the file it replaces.
    Replace(PathBuf, Option<Permissions>),
}

fn write(path: &Path, text: bool, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let subject = output_name(path);
    let failed = |error: io::Error| writing(&subject, &error);
    match target(path).map_err(failed)? {
        Target::Through(file) => {
            if !text && file.is_terminal() {
                return Err(Error::new(subject, "a terminal", "wanted a file or a pipe for binary output (-o FILE)"));
            }
            fill_and_flush(file, fill).map_err(failed)?;
        }
        Target::Replace(place, old) => {
            let folder = match place.parent() {
                Some(folder) if folder != Path::new("") => folder,
                _ => Path::new("."),
            };
            let (file, draft) = draft::begin(folder).map_err(failed)?;
            let file = fill_and_flush(file, fill).map_err(failed)?;
            if let Some(old) = old {
                file.set_permissions(old).map_err(failed)?;
            }
            file.sync_all().map_err(failed)?;
            draft.finish(&file, &place, folder).map_err(failed)?;
        }
    }
    Ok(())
}

fn fill_and_flush(file: File, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<File> {
    let mut buffered = BufWriter::with_capacity(BUFFER, file);
    match fill(&mut buffered).and_then(|()| buffered.flush()) {
        Ok(()) => Ok(buffered.into_parts().0),
        Err(error) => {
            // What is still buffered belongs to an output that failed.
            let _ = buffered.into_parts();
            Err(error)
        }
    }
}

fn target(path: &Path) -> io::Result<Target> {
    if is_standard(path) || path == Path::new("/dev/stdout") {
        io::stdout().flush()?;
        return Ok(Target::Through(standard(io::stdout().as_fd())?));
    }
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(found) if found.is_file() && !names_a_descriptor(path) => {
            // A file that refuses writing is not replaced behind its owner's back.
            OpenOptions::new().write(true).open(path)?;
            Ok(Target::Replace(fs::canonicalize(path)?, Some(Permissions::from_mode(found.mode() & 0o7777))))
        }
        Ok(_) => {
            let mut file = OpenOptions::new().write(true).open(path)?;
            if file.metadata()?.is_file() {
                file.seek(SeekFrom::End(0))?;
            }
            Ok(Target::Through(file))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let mut place = path.to_owned();
            for _ in 0..LINKS {
                let Ok(next) = fs::read_link(&place) else {
                    return Ok(Target::Replace(place, None));
                };
                place = place.parent().unwrap_or(Path::new("")).join(next);
            }
            Err(io::Error::other("a ring of symbolic links"))
        }
        Err(error) => Err(error),
    }
}

/// A name for an open descriptor: its link leads to a file that others hold open, so replacing that would lose them.
fn names_a_descriptor(path: &Path) -> bool {
    path.starts_with("/dev/fd") || path.starts_with("/proc") || path == Path::new("/dev/stderr")
}
