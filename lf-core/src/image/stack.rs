//! Files of one image or many, one at a time.

use super::{Image, counts, from_bytes, guarded, tiff};
use crate::io::{self, Bytes};
use crate::{Error, Result};
use std::path::Path;

/// The images of a file: every page of a TIFF, the one image of anything else. Holds the file's bytes, mapped where it is
/// a plain file, and no pixels.
pub struct Stack {
    name: String,
    bytes: Bytes,
    images: usize,
    is_tiff: bool,
}

impl Stack {
    /// Opens a file and counts its images; `-` is standard input. A TIFF whose list of pages is cut is refused here, what a
    /// page holds when it is read.
    ///
    /// # Errors
    /// No such file, and a TIFF without a whole list of pages.
    pub fn open(path: &Path) -> Result<Self> {
        Self::from_bytes(io::open(path)?, &io::name(path))
    }

    /// The same of bytes that are there already; `name` is what messages call them.
    ///
    /// # Errors
    /// A TIFF without a whole list of pages.
    pub fn from_bytes(bytes: Bytes, name: &str) -> Result<Self> {
        let name = name.to_owned();
        let is_tiff = matches!(&bytes[..], [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..]);
        let images = if is_tiff { guarded(|| tiff::count(&bytes)) } else { Ok(1) };
        let images = images.map_err(|(found, wanted)| Error::new(&name, found, wanted))?;
        Ok(Self { name, bytes, images, is_tiff })
    }

    /// The file itself.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Whether the file can be opened again, being mapped and no pipe.
    pub fn is_mapped(&self) -> bool {
        self.bytes.is_mapped()
    }

    /// How many images there are, at least one.
    pub fn images(&self) -> usize {
        self.images
    }

    /// What messages call an image: the file, and the page where there are several, counted from 1.
    pub fn name(&self, number: usize) -> String {
        if self.images == 1 { self.name.clone() } else { format!("{}, page {}", self.name, number + 1) }
    }

    /// Decodes an image, counted from 0, and refuses pixels that are NaN, infinite or negative.
    ///
    /// # Errors
    /// Those of [`super::open_counts`].
    ///
    /// # Panics
    /// If there is no such image.
    pub fn read(&self, number: usize) -> Result<Image> {
        assert!(number < self.images, "image {number} of {}", self.images);
        let name = self.name(number);
        if !self.is_tiff {
            return counts(from_bytes(&self.bytes, &name)?, &name);
        }
        let image = guarded(|| tiff::page(&self.bytes, number));
        counts(image.map_err(|(found, wanted)| Error::new(&name, found, wanted))?, &name)
    }
}
