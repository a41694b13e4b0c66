//! Images of other programs: colour, alpha, packed samples, tiles, planes, pages; and words for the kinds not read.

use crate::image::{crc32, grey_tiff, png, read, read_channel, refusal, replace};
use image::ExtendedColorType;
use lf_core::image::{Channel, FrameFiles, Stack, frames, open, open_frame};
use ndarray::{Array2, array};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype};
use tiff::tags::Tag;

/// Where and how a TIFF is written.
#[derive(Clone, Copy, Debug)]
struct Form {
    is_big: bool,
    is_little: bool,
}

const PLAIN: Form = Form { is_big: false, is_little: true };
const FORMS: [Form; 4] = [
    PLAIN,
    Form { is_big: false, is_little: false },
    Form { is_big: true, is_little: true },
    Form { is_big: true, is_little: false },
];

/// Tags with whole numbers, and strips or tiles.
type Page = (Vec<(u16, Vec<u64>)>, Vec<Vec<u8>>);

impl Form {
    fn number(self, value: u64, width: usize) -> Vec<u8> {
        let mut bytes = value.to_le_bytes()[..width].to_vec();
        if !self.is_little {
            bytes.reverse();
        }
        bytes
    }

    fn word(self) -> usize {
        if self.is_big { 8 } else { 4 }
    }

    /// A file of pages, each of tags with whole numbers and of strips, or tiles if it has the tag `TileWidth`.
    fn file(self, pages: &[Page]) -> Vec<u8> {
        let word = self.word();
        let mut file = if self.is_little { b"II".to_vec() } else { b"MM".to_vec() };
        file.extend(self.number(if self.is_big { 43 } else { 42 }, 2));
        if self.is_big {
            file.extend([self.number(8, 2), self.number(0, 2)].concat());
        }
        let mut link = file.len();
        file.extend(self.number(0, word));
        for (tags, chunks) in pages {
            let places = chunks.iter().map(|chunk| {
                let place = file.len() as u64;
                file.extend(chunk);
                place
            });
            let places: Vec<u64> = places.collect();
            let is_tiled = tags.iter().any(|(tag, _)| *tag == 322);
            let mut tags = tags.clone();
            tags.push((if is_tiled { 324 } else { 273 }, places));
            tags.push((if is_tiled { 325 } else { 279 }, chunks.iter().map(|chunk| chunk.len() as u64).collect()));
            tags.sort();
            let mut entries = Vec::new();
            for (tag, values) in &tags {
                let mut bytes: Vec<u8> = values.iter().flat_map(|&value| self.number(value, 4)).collect();
                if bytes.len() > word {
                    let place = self.number(file.len() as u64, word);
                    file.extend(std::mem::replace(&mut bytes, place));
                }
                bytes.resize(word, 0);
                let head = [self.number((*tag).into(), 2), self.number(4, 2), self.number(values.len() as u64, word)];
                entries.extend([head.concat(), bytes].concat());
            }
            let directory = self.number(file.len() as u64, word);
            file[link..link + word].copy_from_slice(&directory);
            file.extend(self.number(tags.len() as u64, if self.is_big { 8 } else { 2 }));
            file.extend(entries);
            link = file.len();
            file.extend(self.number(0, word));
        }
        file
    }

    /// A page of `width` x `height` with samples of these bits, in strips.
    fn page(self, size: [u64; 2], bits: &[u64], more: &[(u16, u64)], chunks: Vec<Vec<u8>>) -> Vec<u8> {
        self.file(&[(tags(size, bits, more), chunks)])
    }
}

fn tags([width, height]: [u64; 2], bits: &[u64], more: &[(u16, u64)]) -> Vec<(u16, Vec<u64>)> {
    let mut tags = vec![(256, vec![width]), (257, vec![height]), (258, bits.to_vec()), (277, vec![bits.len() as u64])];
    tags.extend(more.iter().map(|&(tag, value)| (tag, vec![value])));
    if more.iter().all(|&(tag, _)| tag != 262) {
        tags.push((262, vec![if bits.len() > 2 { 2 } else { 1 }]));
    }
    tags
}

/// Rows of samples, bit after bit, each row to a whole byte.
fn packed(samples: &[u32], width: usize, bits: usize) -> Vec<u8> {
    let row = |row: &[u32]| {
        let bits: Vec<u8> = row.iter().flat_map(|v| (0..bits).rev().map(move |bit| (v >> bit & 1) as u8)).collect();
        let byte = |bits: &[u8]| (0..8).fold(0, |byte, i| byte << 1 | bits.get(i).copied().unwrap_or(0));
        bits.chunks(8).map(byte).collect::<Vec<u8>>()
    };
    samples.chunks(width).flat_map(row).collect()
}

fn counts(width: usize, height: usize, bits: usize) -> (Vec<u32>, Array2<f32>) {
    let samples: Vec<u32> =
        (0..(width * height) as u32).map(|n| n.wrapping_mul(40_503) >> 3 & ((1 << bits) - 1)).collect();
    let pixels = samples.iter().map(|&sample| sample as f32).collect();
    (samples, Array2::from_shape_vec((height, width), pixels).unwrap())
}

#[test]
fn packed_samples_are_read_in_strips_and_tiles_of_every_form() {
    let (width, height) = (37, 23);
    for bits in [10, 12, 14] {
        let (samples, wanted) = counts(width, height, bits);
        for form in FORMS {
            let strips = samples.chunks(5 * width).map(|rows| packed(rows, width, bits)).collect();
            let file = form.page([37, 23], &[bits as u64], &[(278, 5)], strips);
            assert_eq!(read(&file).unwrap().pixels, wanted, "{bits} bits, {form:?}");
            let padded = |y: usize, x: usize| if y < height && x < width { samples[y * width + x] } else { 0 };
            let tile = |at: usize| {
                let (top, left) = (at / 3 * 16, at % 3 * 16);
                let tile: Vec<u32> = (0..256).map(|i| padded(top + i / 16, left + i % 16)).collect();
                packed(&tile, 16, bits)
            };
            let file = form.page([37, 23], &[bits as u64], &[(322, 16), (323, 16)], (0..6).map(tile).collect());
            assert_eq!(read(&file).unwrap().pixels, wanted, "tiles, {bits} bits, {form:?}");
        }
    }
}

/// The encoder writes bytes; then the tags say that they are packed samples.
#[test]
fn packed_samples_may_be_compressed() {
    let (samples, wanted) = counts(40, 30, 12);
    for compression in [Compression::Lzw, Compression::Deflate(DeflateLevel::Best), Compression::Packbits] {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap().with_compression(compression);
        encoder.write_image::<colortype::Gray8>(60, 30, &packed(&samples, 40, 12)).unwrap();
        let mut file = file.into_inner();
        let entry = |tag: u16, kind: u16, value: u32| {
            [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &1u32.to_le_bytes(), &value.to_le_bytes()].concat()
        };
        replace(&mut file, &entry(256, 4, 60), &entry(256, 4, 40));
        replace(&mut file, &entry(258, 3, 8), &entry(258, 3, 12));
        assert_eq!(read(&file).unwrap().pixels, wanted);
    }
}

/// Bytes compressed by LZW, taken from a file of one strip.
fn lzw(bytes: &[u8]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap().with_compression(Compression::Lzw);
    encoder.write_image::<colortype::Gray8>(bytes.len() as u32, 1, bytes).unwrap();
    let file = file.into_inner();
    let mut decoder = tiff::decoder::Decoder::new(Cursor::new(&file)).unwrap();
    let [start, length] =
        [Tag::StripOffsets, Tag::StripByteCounts].map(|tag| decoder.get_tag_u32(tag).unwrap() as usize);
    file[start..start + length].to_vec()
}

/// Scar: the library reads tiles row by row, and its LZW decoder took the short rows at the image's edge for an early
/// end.
#[test]
fn tiles_beyond_the_edge_may_be_compressed_and_planar() {
    let wanted = Array2::from_shape_fn((37, 53), |(y, x)| if x < 30 { 7.0 } else { ((y * 53 + x) * 31 % 256) as f32 });
    let at = |y: usize, x: usize| wanted.get((y, x)).map_or(0, |&value| value as u8);
    let tile = |number: usize| {
        let (top, left) = (number / 4 * 16, number % 4 * 16);
        lzw(&(0..256).map(|i| at(top + i / 16, left + i % 16)).collect::<Vec<u8>>())
    };
    let tiles: Vec<Vec<u8>> = (0..12).map(tile).collect();
    let form = [(259, 5), (322, 16), (323, 16)];
    assert_eq!(read(&PLAIN.page([53, 37], &[8], &form, tiles.clone())).unwrap().pixels, wanted);
    let planes = [tiles.clone(), tiles.clone(), tiles].concat();
    let form = [&form[..], &[(284, 2)]].concat();
    assert_eq!(read(&PLAIN.page([53, 37], &[8; 3], &form, planes)).unwrap().pixels, wanted);
}

/// Rows of 43 691 packed samples have more bytes than a tag of 16 bits can say.
#[test]
fn packed_rows_may_be_long() {
    let (samples, wanted) = counts(50_000, 2, 12);
    let file = PLAIN.page([50_000, 2], &[12], &[(278, 2)], vec![packed(&samples, 50_000, 12)]);
    assert_eq!(read(&file).unwrap().pixels, wanted);
}

#[test]
fn equal_channels_are_grey_in_every_layout() {
    let wanted = array![[1.0, 200.0], [3.0, 77.0]];
    let grey: Vec<u64> = wanted.iter().map(|&value| value as u64).collect();
    for form in FORMS {
        for (bits, full) in [(8, 255), (16, 65535)] {
            let width = bits as usize / 8;
            let bytes = |samples: &[u64]| samples.iter().flat_map(|&v| form.number(v, width)).collect::<Vec<u8>>();
            let rgb: Vec<u64> = grey.iter().flat_map(|&v| [v; 3]).collect();
            let rgba: Vec<u64> = grey.iter().flat_map(|&v| [v, v, v, full]).collect();
            let grey_alpha: Vec<u64> = grey.iter().flat_map(|&v| [v, full]).collect();
            let file = form.page([2, 2], &[bits; 3], &[], vec![bytes(&rgb)]);
            assert_eq!(read(&file).unwrap().pixels, wanted, "{form:?} {bits}");
            let planes = vec![bytes(&grey); 3];
            assert_eq!(read(&form.page([2, 2], &[bits; 3], &[(284, 2)], planes)).unwrap().pixels, wanted);
            let file = form.page([2, 2], &[bits; 4], &[(338, 2)], vec![bytes(&rgba)]);
            assert_eq!(read(&file).unwrap().pixels, wanted);
            let file = form.page([2, 2], &[bits; 2], &[(338, 1)], vec![bytes(&grey_alpha)]);
            assert_eq!(read(&file).unwrap().pixels, wanted);
        }
    }
}

#[test]
fn one_channel_of_colour_can_be_chosen() {
    let colour = PLAIN.page([2, 1], &[8; 4], &[(338, 2)], vec![vec![9, 9, 9, 255, 10, 20, 30, 0]]);
    let planes = PLAIN.page([2, 1], &[8; 3], &[(284, 2)], vec![vec![9, 10], vec![9, 20], vec![9, 30]]);
    let picture = png(2, 1, &[9, 9, 9, 10, 20, 30], ExtendedColorType::Rgb8);
    for file in [&colour, &planes, &picture] {
        let of = |channel| read_channel(file, channel).pixels;
        assert_eq!(of(Channel::Red), array![[9.0, 10.0]]);
        assert_eq!(of(Channel::Green), array![[9.0, 20.0]]);
        assert_eq!(of(Channel::Blue), array![[9.0, 30.0]]);
        assert!((of(Channel::Luma) - array![[9.0, 18.596]]).iter().all(|error| error.abs() < 1e-4));
    }
    let refused = "frame: colour, 1 pixel is not grey, the first at x 1, y 0 (red 10, green 20, blue 30); wanted equal \
                   channels, or --channel r, g, b or luma";
    assert_eq!(refusal(&planes), refused);
    assert_eq!(refusal(&picture), refused);
    let refused = "frame: 1 pixel is not opaque, the first at x 1, y 0; wanted full alpha everywhere, or --channel, which \
                   ignores alpha";
    assert_eq!(refusal(&colour), refused);
}

#[test]
fn png_of_every_colour_is_read() {
    assert_eq!(read(&png(3, 1, &[0, 9, 255], ExtendedColorType::L8)).unwrap().pixels, array![[0.0, 9.0, 255.0]]);
    let wide = |samples: &[u16]| samples.iter().flat_map(|value| value.to_ne_bytes()).collect::<Vec<u8>>();
    let file = png(1, 2, &wide(&[300, 65535]), ExtendedColorType::L16);
    assert_eq!(read(&file).unwrap().pixels, array![[300.0], [65535.0]]);
    let file = png(1, 1, &wide(&[300, 300, 300, 65535]), ExtendedColorType::Rgba16);
    assert_eq!(read(&file).unwrap().pixels, array![[300.0]]);
    assert_eq!(read(&png(2, 1, &[5, 255, 6, 255], ExtendedColorType::La8)).unwrap().pixels, array![[5.0, 6.0]]);
    assert!(refusal(&png(1, 1, &[5, 254], ExtendedColorType::La8)).starts_with("frame: 1 pixel is not opaque"));
    // The library would stretch these samples to 255.
    let mut few = png(2, 1, &[1, 2], ExtendedColorType::L8);
    few[24] = 4;
    let sum = crc32(&few[12..29]);
    few[29..33].copy_from_slice(&sum.to_be_bytes());
    assert_eq!(refusal(&few), "frame: 4-bit grey; wanted 8-bit or 16-bit grey or RGB");
}

#[test]
fn valid_kinds_that_are_not_read_are_named() {
    let grey = |bits: u64, more: &[(u16, u64)]| PLAIN.page([2, 1], &[bits], more, vec![vec![0; 16]]);
    let kinds: [(Vec<u8>, &str); 22] = [
        (grey(8, &[(259, 7)]), "JPEG-compressed TIFF"),
        (grey(8, &[(259, 34712)]), "JPEG 2000-compressed TIFF"),
        (grey(8, &[(259, 50000)]), "Zstandard-compressed TIFF"),
        (grey(1, &[(259, 4)]), "fax-compressed TIFF"),
        (grey(8, &[(259, 60000)]), "TIFF of compression 60000"),
        (grey(8, &[(266, 2)]), "bits in reversed order (FillOrder 2)"),
        (grey(8, &[(317, 34892)]), "TIFF of predictor 34892 on 8-bit samples"),
        (grey(8, &[(262, 0)]), "inverted grey, 0 is white"),
        (grey(8, &[(262, 3)]), "a colour palette"),
        (grey(16, &[(262, 32803)]), "a colour filter mosaic (Bayer)"),
        (grey(8, &[(262, 6)]), "YCbCr colour"),
        (grey(4, &[]), "4-bit grey"),
        (grey(16, &[(339, 2)]), "signed samples"),
        (grey(16, &[(339, 3)]), "16-bit float"),
        (grey(64, &[]), "64-bit grey"),
        (grey(64, &[(339, 6)]), "complex numbers"),
        (grey(32, &[]), "32-bit whole numbers"),
        (PLAIN.page([2, 1], &[8, 8], &[], vec![vec![0; 4]]), "2 channels"),
        (PLAIN.page([2, 1], &[8, 8, 8, 8], &[(338, 0)], vec![vec![0; 8]]), "4 channels"),
        (PLAIN.page([2, 1], &[12; 3], &[], vec![vec![0; 9]]), "12-bit colour"),
        (PLAIN.page([2, 1], &[8, 16, 8], &[], vec![vec![0; 9]]), "channels of different depths"),
        (PLAIN.page([2, 1], &[8], &[(284, 7)], vec![vec![0; 2]]), "planar configuration 7"),
    ];
    for (file, found) in kinds {
        let refused = refusal(&file);
        assert!(refused.starts_with(&format!("frame: {found}; wanted ")), "{refused}");
        assert!(!refused.contains("decoded") && !refused.contains("valid"), "{refused}");
    }
}

/// Three pages of 2 x 1 px with values that show their page; the second is of a kind that is not read.
fn stack(folder: &Path, name: &str) -> PathBuf {
    let page = |n: u8, kind: u64| (tags([2, 1], &[8], &[(262, kind)]), vec![vec![10 * n, 10 * n + 1]]);
    let path = folder.join(name);
    std::fs::write(&path, PLAIN.file(&[page(0, 1), page(1, 3), page(2, 1)])).unwrap();
    path
}

#[test]
fn pages_are_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = stack(folder.path(), "run.tif");
    let page = |n: &str| PathBuf::from(format!("{}:{n}", path.display()));
    assert_eq!(open(&page("0")).unwrap().pixels, array![[0.0, 1.0]]);
    assert_eq!(open(&page("2")).unwrap().pixels, array![[20.0, 21.0]]);
    let refused = |path: &Path| open(path).err().unwrap().to_string();
    assert!(refused(&page("1")).ends_with(
        "run.tif:1: a colour palette; wanted 8-bit to 16-bit or 32-bit float grey, or \
                                           8-bit, 16-bit or 32-bit float RGB"
    ));
    assert!(refused(&page("3")).ends_with("run.tif:3: no page 3, the file has 3 pages; wanted a page from 0 to 2"));
    let many = refused(&path);
    assert!(many.contains("run.tif: 3 pages; wanted one of them, ") && many.ends_with("run.tif:2"), "{many}");
    assert_eq!(frames(std::slice::from_ref(&path)), [page("0"), page("1"), page("2")]);
    let kept = [page("2"), folder.path().join("none.tif")];
    assert_eq!(frames(&kept), kept);
    let stack = Stack::open(&path).unwrap();
    assert_eq!(stack.about(), ["2 x 1 px, 8-bit grey", "a colour palette", "2 x 1 px, 8-bit grey"]);
    assert_eq!(stack.name(2), page("2").display().to_string());
}

#[test]
fn a_file_of_exactly_that_name_comes_first() {
    let folder = tempfile::tempdir().unwrap();
    let path = stack(folder.path(), "run.tif");
    let own = folder.path().join("run.tif:2");
    std::fs::write(&own, grey_tiff::<colortype::Gray8>(1, 1, &[99])).unwrap();
    assert_eq!(open(&own).unwrap().pixels, array![[99.0]]);
    std::fs::remove_file(&own).unwrap();
    assert_eq!(open(&own).unwrap().pixels, array![[20.0, 21.0]]);
    for missing in ["none.tif:2", "run.tif:", "run.tif:x", "run.tif:-1", "run.tif:99999999999999999999"] {
        let refused = open(&folder.path().join(missing)).err().unwrap().to_string();
        assert!(refused.ends_with(&format!("{missing}: no such file; wanted a file to read")), "{refused}");
    }
    assert_eq!(lf_core::io::split_page(&path), (path.as_path(), None));
}

/// ImageJ writes large stacks with one directory; only the first image could be read.
#[test]
fn an_imagej_stack_without_pages_is_named() {
    let file = |text: &str| {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        let mut page = encoder.new_image::<colortype::Gray8>(2, 1).unwrap();
        page.encoder().write_tag(Tag::ImageDescription, text).unwrap();
        page.write_data(&[1, 2]).unwrap();
        file.into_inner()
    };
    let refused = refusal(&file("ImageJ=1.54f\nimages=300\nslices=300\n"));
    assert_eq!(refused, "frame: an ImageJ stack of 300 images in one page; wanted a page for each image");
    assert!(read(&file("ImageJ=1.54f\nimages=1\n")).is_ok());
}

/// A tile is as believable as the image.
#[test]
fn a_huge_tile_allocates_nothing() {
    let file = PLAIN.page([2, 1], &[32], &[(339, 3), (322, 1 << 28), (323, 16)], vec![vec![0; 64]]);
    let (message, largest) = crate::allocation::largest(|| refusal(&file));
    assert!(message.contains("268435456 x 16 pixels in a file of"), "{message}");
    assert!(largest < 1 << 20, "{largest}");
}

#[test]
fn damage_to_packed_and_coloured_files_never_panics() {
    let (samples, _) = counts(7, 5, 12);
    let tile = packed(&counts(16, 16, 12).0, 16, 12);
    let files = [
        ("packed", PLAIN.page([7, 5], &[12], &[(278, 5)], vec![packed(&samples, 7, 12)])),
        ("tiled", FORMS[3].page([7, 5], &[12], &[(322, 16), (323, 16)], vec![tile])),
        ("planes", FORMS[1].page([7, 5], &[16; 3], &[(284, 2)], vec![vec![1; 70]; 3])),
        ("alpha", FORMS[2].page([7, 5], &[8; 4], &[(338, 2)], vec![vec![255; 140]])),
    ];
    for (kind, file) in &files {
        for length in 0..file.len() {
            let (_, largest) = crate::allocation::largest(|| read(&file[..length]).is_err());
            assert!(largest < 4 << 20, "{kind} cut to {length}: allocated {largest}");
        }
        for at in 0..file.len() {
            for change in [1u8, 2, 4, 8, 16, 32, 64, 128, 255] {
                let mut bytes = file.clone();
                bytes[at] ^= change;
                let (outcome, largest) = crate::allocation::largest(|| read(&bytes));
                assert!(largest < 4 << 20, "{kind} byte {at} changed by {change}: allocated {largest}");
                if let Ok(image) = outcome {
                    assert!(!image.pixels.is_empty());
                }
            }
        }
    }
}

#[test]
fn a_frame_its_background_and_its_flat_field_may_be_coloured_pages() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.tif");
    let page = |values: [u8; 2]| {
        let rgb: Vec<u8> = values.iter().flat_map(|&v| [0, v, 0]).collect();
        (tags([2, 1], &[8; 3], &[]), vec![rgb])
    };
    std::fs::write(&path, PLAIN.file(&[page([50, 60]), page([1, 2])])).unwrap();
    let json = r#"{"sensor": {"width": 2, "height": 1, "pixel_pitch_mm": 0.0055},
        "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": "square"},
        "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308,
                        "rotation_rad": 0.0, "offset_mm": [0.0, 0.0]}}"#;
    let camera = lf_core::Camera::from_json(json).unwrap();
    let page = |n: usize| folder.path().join(format!("run.tif:{n}"));
    let (dark, file) = (page(1), Path::new("camera.json"));
    let files = FrameFiles { background: Some(&dark), mask: None };
    let read = |channel| open_frame(&page(0), files, &camera, file, channel);
    assert_eq!(read(Some(Channel::Green)).unwrap().pixels, array![[49.0, 58.0]]);
    assert!(read(None).err().unwrap().to_string().contains("run.tif:0: colour, "));
}
