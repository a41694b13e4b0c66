//! The directories of a TIFF, and the whole numbers in their tags. Classic and BigTIFF, in both byte orders.

/// Maximum number of directories that are followed; also ends a cyclic chain.
pub(super) const MAX_DIRECTORIES: usize = 100_000;

/// A TIFF in memory. Every place is an offset from its first byte.
#[derive(Clone, Copy)]
pub(super) struct Tiff<'a> {
    bytes: &'a [u8],
    is_big: bool,
    is_little: bool,
}

impl<'a> Tiff<'a> {
    /// Bytes that begin as a TIFF does; None for others.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let is_little = *bytes.first()? == b'I';
        let mut tiff = Self { bytes, is_big: false, is_little };
        tiff.is_big = tiff.number(2, 2)? == 43;
        Some(tiff)
    }

    /// Bytes of the number of entries, of a value or an offset, and of an entry.
    fn widths(&self) -> (usize, usize, usize) {
        if self.is_big { (8, 8, 20) } else { (2, 4, 12) }
    }

    fn number(&self, at: usize, width: usize) -> Option<usize> {
        let field = self.bytes.get(at..at.checked_add(width)?)?;
        let push = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        let value = if self.is_little { field.iter().rev().fold(0, push) } else { field.iter().fold(0, push) };
        usize::try_from(value).ok()
    }

    /// Place of the offset of the first directory.
    fn first(&self) -> usize {
        if self.is_big { 8 } else { 4 }
    }

    /// Places of the directories, at most [`MAX_DIRECTORIES`]. None if the chain leaves the file, or if a tag claims
    /// more bytes than the file has: the library would allocate them before it checks.
    pub(super) fn directories(&self) -> Option<Vec<usize>> {
        let (counter, word, entry) = self.widths();
        let mut directory = self.number(self.first(), word)?;
        let mut all = Vec::new();
        while directory != 0 && all.len() < MAX_DIRECTORIES {
            let entries = self.number(directory, counter)?;
            let start = directory.checked_add(counter)?;
            for i in 0..entries {
                let at = start.checked_add(i.checked_mul(entry)?)?;
                let size = size_of_kind(self.number(at.checked_add(2)?, 2)?);
                let length = self.number(at.checked_add(4)?, word)?.checked_mul(size)?;
                if length > self.bytes.len() {
                    return None;
                }
            }
            all.push(directory);
            directory = self.number(start.checked_add(entries.checked_mul(entry)?)?, word)?;
        }
        Some(all)
    }

    /// Place of an entry in a directory.
    fn entry(&self, directory: usize, tag: u16) -> Option<usize> {
        let (counter, _, entry) = self.widths();
        let entries = self.number(directory, counter)?;
        let places = (0..entries).map(|i| directory + counter + i * entry);
        places.into_iter().find(|&at| self.number(at, 2) == Some(tag.into()))
    }

    /// The whole numbers of a tag; None if it is absent, holds others, or leaves the file.
    pub(super) fn numbers(&self, directory: usize, tag: u16) -> Option<Vec<u64>> {
        let (at, (_, word, _)) = (self.entry(directory, tag)?, self.widths());
        let kind = self.number(at + 2, 2)?;
        let size = size_of_kind(kind);
        if !matches!(kind, 1 | 3 | 4 | 13 | 16 | 18) {
            return None;
        }
        let count = self.number(at + 4, word)?;
        let inside = at + 4 + word;
        let start = if count.checked_mul(size)? <= word { inside } else { self.number(inside, word)? };
        (0..count).map(|i| Some(self.number(start.checked_add(i * size)?, size)? as u64)).collect()
    }

    /// The text of a tag; empty if it is absent.
    pub(super) fn text(&self, directory: usize, tag: u16) -> &'a [u8] {
        let text = || {
            let (at, (_, word, _)) = (self.entry(directory, tag)?, self.widths());
            let count = self.number(at + 4, word)?;
            let inside = at + 4 + word;
            let start = if count <= word { inside } else { self.number(inside, word)? };
            self.bytes.get(start..start.checked_add(count)?)
        };
        text().unwrap_or_default()
    }

    /// The place and the bytes that make `directory` the first one.
    pub(super) fn as_first(&self, directory: usize) -> (usize, Vec<u8>) {
        let (_, word, _) = self.widths();
        (self.first(), self.encoded(directory as u64, word))
    }

    /// The place and the bytes that give a tag of a directory one number. None if it does not have the tag.
    pub(super) fn with_number(&self, directory: usize, tag: u16, value: u64) -> Option<(usize, Vec<u8>)> {
        let (at, (_, word, _)) = (self.entry(directory, tag)?, self.widths());
        let (kind, size) = match value {
            0..=0xffff => (3, 2),
            0x1_0000..=0xffff_ffff => (4, 4),
            _ if self.is_big => (16, 8),
            _ => return None,
        };
        let mut bytes = [self.encoded(kind, 2), self.encoded(1, word), self.encoded(value, size)].concat();
        bytes.resize(2 + 2 * word, 0);
        Some((at + 2, bytes))
    }

    fn encoded(&self, value: u64, width: usize) -> Vec<u8> {
        let mut bytes = value.to_le_bytes()[..width].to_vec();
        if !self.is_little {
            bytes.reverse();
        }
        bytes
    }
}

/// Bytes of a value by the type in its entry.
fn size_of_kind(kind: usize) -> usize {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16..=18 => 8,
        _ => 1,
    }
}
