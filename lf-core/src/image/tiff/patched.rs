//! A file in memory in which a few bytes are replaced as they are read.

use std::io::{Cursor, Read, Result, Seek, SeekFrom};

pub(super) struct Patched<'a> {
    file: Cursor<&'a [u8]>,
    /// Places in the file, and the bytes to read there.
    patches: Vec<(usize, Vec<u8>)>,
}

impl<'a> Patched<'a> {
    pub(super) fn new(bytes: &'a [u8], patches: Vec<(usize, Vec<u8>)>) -> Self {
        Self { file: Cursor::new(bytes), patches }
    }
}

impl Read for Patched<'_> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let start = self.file.position() as usize;
        let length = self.file.read(out)?;
        for (place, bytes) in &self.patches {
            let (from, to) = ((*place).max(start), (place + bytes.len()).min(start.saturating_add(length)));
            if from < to {
                out[from - start..to - start].copy_from_slice(&bytes[from - place..to - place]);
            }
        }
        Ok(length)
    }
}

impl Seek for Patched<'_> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.file.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_to_read_sees_the_patches() {
        let file = b"0123456789";
        let wanted = b"01ab4567c9";
        for start in 0..10 {
            for length in 1..=10 - start {
                let mut patched = Patched::new(file, vec![(2, b"ab".to_vec()), (8, b"c".to_vec())]);
                patched.seek(SeekFrom::Start(start as u64)).unwrap();
                let mut read = vec![0; length];
                patched.read_exact(&mut read).unwrap();
                assert_eq!(read, wanted[start..start + length]);
            }
        }
    }
}
