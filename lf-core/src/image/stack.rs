//! Files of one image or many, read one image at a time.

use super::decode::{Image, guarded};
use super::files::{counts, from_bytes};
use super::tiff;
use crate::Result;
use crate::io::{self, Bytes, Signature};
use std::path::Path;

/// The images of a file: every page of a TIFF, or the one image of another format. Holds the bytes and no pixels.
pub struct Stack {
    name: String,
    bytes: Bytes,
    images: usize,
    is_tiff: bool,
}

impl Stack {
    /// Opens a file and counts its images; `-` is standard input. Refuses a TIFF without a whole list of pages.
    pub fn open(path: &Path) -> Result<Self> {
        Self::from_bytes(io::open(path)?, &io::name(path))
    }

    /// Counts the images in memory; `name` stands for the file in messages.
    pub fn from_bytes(bytes: Bytes, name: &str) -> Result<Self> {
        let name = name.to_owned();
        let is_tiff = Signature::of(&bytes) == Some(Signature::Tiff);
        let images = if is_tiff { guarded(|| tiff::count(&bytes)) } else { Ok(1) };
        let images = images.map_err(|refusal| refusal.about(&name))?;
        Ok(Self { name, bytes, images, is_tiff })
    }

    /// The file itself.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Whether the file is mapped. Such a file can be opened again, a pipe cannot.
    pub fn is_mapped(&self) -> bool {
        self.bytes.is_mapped()
    }

    /// Number of images, at least one.
    pub fn images(&self) -> usize {
        self.images
    }

    /// Name of an image in messages: the file, and its page from 1 if there are several.
    pub fn name(&self, number: usize) -> String {
        if self.images == 1 { self.name.clone() } else { format!("{}, page {}", self.name, number + 1) }
    }

    /// Decodes image `number`, from 0, as [`super::open_counts`] does. Panics if there is no such image.
    pub fn read(&self, number: usize) -> Result<Image> {
        assert!(number < self.images, "image {number} of {}", self.images);
        let name = self.name(number);
        let image = match self.is_tiff {
            true => guarded(|| tiff::page(&self.bytes, number)).map_err(|refusal| refusal.about(&name)),
            false => from_bytes(&self.bytes, &name),
        };
        counts(image?, &name)
    }
}
