//! Files of one image or many, read one image at a time.

use super::channel::Channel;
use super::decode::{Image, finite, guarded};
use super::{exr, light_field, png, tiff};
use crate::io::{self, Bytes, Signature};
use crate::{Error, Refusal, Result, history::History};
use std::path::Path;

/// The images of a file: every page of a TIFF or the one that was named, or the one image of another format. Holds the
/// bytes and no pixels.
pub struct Stack {
    name: String,
    /// The file as typed on the command line.
    typed: String,
    bytes: Bytes,
    /// Places of the pages in the file.
    pages: Vec<usize>,
    /// Number in the file of the first page here; None if the file has one page and none was named.
    first: Option<usize>,
}

impl Stack {
    /// Opens a file and finds its images; `-` is standard input, and `file.tif:3` is page 3, counted from 0. Refuses a
    /// TIFF with a damaged list of pages, and a page that does not exist.
    pub fn open(path: &Path) -> Result<Self> {
        let (file, page) = io::split_page(path);
        let mut stack = Self::from_bytes(io::open(file)?, &io::name(file))?;
        if io::is_standard(file) {
            stack.typed = "FILE".to_owned();
        }
        if let Some(number) = page {
            let pages = stack.pages.len();
            let Some(&place) = stack.pages.get(number) else {
                let found = format!("no page {number}, the file has {}", pages_are(pages));
                return Err(Error::new(io::name(path), found, format!("wanted a page from 0 to {}", pages - 1)));
            };
            (stack.pages, stack.first) = (vec![place], Some(number));
        }
        Ok(stack)
    }

    /// Finds the images in memory; `name` stands for the file in messages.
    pub fn from_bytes(bytes: Bytes, name: &str) -> Result<Self> {
        let pages = guarded(|| pages(&bytes)).map_err(|refusal| refusal.about(name))?;
        let first = (pages.len() > 1).then_some(0);
        Ok(Self { name: name.to_owned(), typed: name.to_owned(), bytes, pages, first })
    }

    /// Whether the file is mapped. Such a file can be opened again, a pipe cannot.
    pub fn is_mapped(&self) -> bool {
        self.bytes.is_mapped()
    }

    /// Number of images, at least one.
    pub fn images(&self) -> usize {
        self.pages.len()
    }

    /// Name of an image in messages: the file, and its page from 0 if it has several.
    pub fn name(&self, number: usize) -> String {
        self.first.map_or_else(|| self.name.clone(), |first| format!("{}:{}", self.name, first + number))
    }

    /// Decodes the only image like [`super::open`]. Refuses several images.
    pub fn only(&self, channel: Option<Channel>) -> Result<Image> {
        let (pages, typed) = (self.images(), &self.typed);
        let wanted = format!("wanted one of them, {typed}:0 to {typed}:{}", pages - 1);
        let is_one = Refusal::unless(pages == 1, || pages_are(pages), wanted);
        is_one.map_err(|refusal| refusal.about(&self.name))?;
        self.decode(0, channel)
    }

    /// Decodes image `number`, from 0, as [`super::open_counts`] does. Panics if there is no such image.
    pub fn read(&self, number: usize, channel: Option<Channel>) -> Result<Image> {
        finite(self.decode(number, channel)?, &self.name(number))
    }

    /// Decodes image `number`, from 0; pixels may be negative or not finite. Panics if there is no such image.
    pub fn decode(&self, number: usize, channel: Option<Channel>) -> Result<Image> {
        let image = guarded(|| decode(&self.bytes, self.pages[number], channel));
        image.map_err(|refusal| refusal.about(self.name(number)))
    }

    /// Width and height of image `number`, from 0, by its header; nothing is decoded. Panics if there is no such image.
    pub fn size_px(&self, number: usize) -> Result<[usize; 2]> {
        let size = guarded(|| size(&self.bytes, self.pages[number]));
        size.map_err(|refusal| refusal.about(self.name(number)))
    }

    /// Size and samples of every page of a TIFF in words, or why it cannot be read; nothing is decoded. Empty for other
    /// formats.
    pub fn about(&self) -> Vec<String> {
        let pages = if Signature::of(&self.bytes) == Some(Signature::Tiff) { self.pages.as_slice() } else { &[] };
        pages.iter().map(|&page| tiff::about(&self.bytes, page)).collect()
    }
}

fn pages_are(pages: usize) -> String {
    if pages == 1 { "1 page".to_owned() } else { format!("{pages} pages") }
}

/// Places of the pages of a TIFF. The one image of another format has no place of its own.
fn pages(bytes: &[u8]) -> std::result::Result<Vec<usize>, Refusal> {
    if Signature::of(bytes) == Some(Signature::Tiff) { tiff::pages(bytes) } else { Ok(vec![0]) }
}

/// Width and height of the image at one of the places that [`pages`] gives.
fn size(bytes: &[u8], page: usize) -> std::result::Result<[usize; 2], Refusal> {
    match Signature::of(bytes) {
        Some(Signature::Exr) => exr::ExrHeader::read(bytes).map(|header| [header.width, header.height]),
        Some(Signature::Tiff) => tiff::size(bytes, page),
        Some(Signature::Png) => png::size(bytes),
        _ => Err(no_image(bytes)),
    }
}

fn no_image(bytes: &[u8]) -> Refusal {
    match bytes {
        [] => Refusal::new("empty", "wanted an EXR, TIFF or PNG image"),
        _ => Refusal::new("not an image by its first bytes", "wanted EXR, TIFF or PNG"),
    }
}

/// Decodes the image at one of the places that [`pages`] gives. The first bytes determine the format.
fn decode(bytes: &[u8], page: usize, channel: Option<Channel>) -> std::result::Result<Image, Refusal> {
    match Signature::of(bytes) {
        Some(Signature::Exr) => light_field::read(bytes, channel),
        Some(Signature::Tiff) => tiff::page(bytes, page, channel),
        Some(Signature::Png) => png::read(bytes, channel).map(|pixels| Image { pixels, history: History::new() }),
        _ => Err(no_image(bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{picture, tiff};
    use ndarray::Array2;

    #[test]
    fn the_header_gives_the_size_of_the_pixels() {
        let pixels = Array2::from_elem((3, 5), 7.0);
        let files =
            [light_field::write(&pixels, None), tiff::write(&pixels, None), picture(&Array2::from_elem((3, 5), 7))];
        for bytes in files {
            let stack = Stack::from_bytes(Bytes::from(bytes.unwrap()), "file").unwrap();
            assert_eq!(stack.size_px(0).unwrap(), [5, 3]);
            assert_eq!(stack.decode(0, None).unwrap().pixels.dim(), (3, 5));
        }
        let text = Stack::from_bytes(Bytes::from(b"text".to_vec()), "text").unwrap();
        let refusals = [text.size_px(0).err(), text.decode(0, None).err()].map(|error| error.unwrap().to_string());
        assert_eq!(refusals[0], refusals[1]);
    }
}
