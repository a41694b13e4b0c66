//! The bytes of an input: mapped, or read into memory.

use super::{names, os::Named, watched::Used};
use std::io::{self, ErrorKind, Read, Seek};
use std::{fs::File, ops::Deref, path::Path};

/// Every [`Bytes`] starts at a multiple of this address, so that a `u64` can be read in place.
const ALIGNMENT: usize = 8;

/// The bytes of an input: a plain file mapped read-only, or a pipe read to its end. They start at a multiple of 8.
pub struct Bytes {
    storage: Storage,
}

enum Storage {
    Mapped { map: memmap2::Mmap, _guards: (Named, Used) },
    Owned { buffer: Vec<u8>, start: usize },
}

impl Bytes {
    /// Takes the bytes of a file that was opened as `path`. A plain file that is read from its start is mapped,
    /// everything else is copied.
    pub(super) fn read(mut file: File, path: &Path) -> io::Result<Self> {
        let found = file.metadata()?;
        if found.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        // The files of /proc also claim a length of zero; they are read.
        if found.is_file() && found.len() > 0 && file.stream_position()? == 0 {
            // SAFETY: the map is read-only and outlives every slice lent from it. If another program writes into the
            // file, a number changes, and no reader here bases memory safety on numbers; if it cuts the file short, the
            // process ends (see [`super::guard`]). Our own writers replace a file and never write into it.
            if let Ok(map) = unsafe { memmap2::Mmap::map(&file) } {
                let guards = (Named::new(&map, &names::name(path)), Used::new(path, &found));
                return Ok(Self { storage: Storage::Mapped { map, _guards: guards } });
            }
        }
        let mut buffer = Vec::new();
        file.read_to_end(&mut buffer)?;
        Ok(buffer.into())
    }

    /// Whether the bytes are mapped from the file, not copied.
    pub fn is_mapped(&self) -> bool {
        matches!(self.storage, Storage::Mapped { .. })
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
            Storage::Mapped { map, .. } => map,
            Storage::Owned { buffer, start } => &buffer[*start..],
        }
    }
}
