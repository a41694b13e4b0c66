//! Images: written images are read back, and damage never panics.

use crate::allocation;
use image::{ExtendedColorType, ImageEncoder};
use lf_core::image::{
    Channel, FrameFiles, Image, Stack, open, open_counts, open_frame, open_signed_frame, outside_u16, save,
};
use lf_core::{History, history::Step};
use ndarray::{Array2, array};
use std::io::Cursor;
use std::path::Path;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

fn steps() -> History {
    let arguments = ["frames", "scène 𝄞 \"1\".json", "\\"].map(str::to_owned).to_vec();
    vec![Step { tool: "lf-synth".into(), version: "0.1.0".into(), arguments }]
}

fn ramp(height: usize, width: usize) -> Array2<f32> {
    Array2::from_shape_fn((height, width), |(y, x)| (y * width + x) as f32 * 0.37)
}

/// The bytes that [`save`] leaves.
fn exr(pixels: &Array2<f32>, history: &History) -> Vec<u8> {
    saved("image.exr", pixels, history)
}

fn saved(name: &str, pixels: &Array2<f32>, history: &History) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    save(&path, pixels, history).unwrap();
    std::fs::read(path).unwrap()
}

pub fn read(bytes: &[u8]) -> lf_core::Result<Image> {
    Stack::from_bytes(bytes.to_vec().into(), "frame")?.only(None)
}

pub fn read_channel(bytes: &[u8], channel: Channel) -> Image {
    Stack::from_bytes(bytes.to_vec().into(), "frame").unwrap().only(Some(channel)).unwrap()
}

pub fn refusal(bytes: &[u8]) -> String {
    match read(bytes) {
        Ok(_) => panic!("should be refused"),
        Err(error) => error.to_string(),
    }
}

pub fn grey_tiff<C: colortype::ColorType>(width: u32, height: u32, samples: &[C::Inner]) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut file = Cursor::new(Vec::new());
    TiffEncoder::new(&mut file).unwrap().write_image::<C>(width, height, samples).unwrap();
    file.into_inner()
}

pub fn png(width: u32, height: u32, samples: &[u8], colour: ExtendedColorType) -> Vec<u8> {
    let mut file = Vec::new();
    image::codecs::png::PngEncoder::new(&mut file).write_image(samples, width, height, colour).unwrap();
    file
}

#[test]
fn an_exr_comes_back_with_its_history() {
    for (height, width) in [(1, 1), (3, 5), (70, 33)] {
        let pixels = ramp(height, width);
        let image = read(&exr(&pixels, &steps())).unwrap();
        assert_eq!(image.pixels, pixels);
        assert_eq!(image.history, steps());
        assert!(read(&exr(&pixels, &History::new())).unwrap().history.is_empty());
    }
}

#[test]
fn every_bit_of_a_float_survives() {
    let odd = [f32::NAN, f32::INFINITY, -0.0, 1e-45, f32::MAX, -7.25];
    let pixels = Array2::from_shape_vec((2, 3), odd.to_vec()).unwrap();
    let image = read(&exr(&pixels, &History::new())).unwrap();
    assert!(image.pixels.iter().zip(odd).all(|(found, wanted)| found.to_bits() == wanted.to_bits()));
}

/// Scar: the order of lines and of attributes made equal images differ.
#[test]
fn equal_images_are_equal_bytes() {
    let pixels = ramp(257, 130);
    let first = exr(&pixels, &steps());
    for _ in 0..20 {
        assert!(exr(&pixels, &steps()) == first);
    }
    // A transposed view has other strides and the same pixels.
    let turned = pixels.t().as_standard_layout().into_owned().reversed_axes();
    assert!(exr(&turned, &steps()) == first);
}

#[test]
fn other_exr_samples_are_read_and_other_channels_refused() {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, ImageAttributes, IntegerBounds, Layer, LayerAttributes,
        WritableImage, f16,
    };
    let file = |channels: Vec<(&str, FlatSamples)>| {
        let list = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
        let mut file = Cursor::new(Vec::new());
        let image = exr::image::Image::from_channels((2, 1), AnyChannels::sort(list));
        image.write().to_buffered(&mut file).unwrap();
        file.into_inner()
    };
    let one = || FlatSamples::F32(vec![1.0, 2.5]);
    let half = FlatSamples::F16(vec![f16::from_f32(1.0), f16::from_f32(2.5)]);
    assert_eq!(read(&file(vec![("Y", half)])).unwrap().pixels, array![[1.0, 2.5]]);
    assert_eq!(read(&file(vec![("Y", FlatSamples::U32(vec![7, 8]))])).unwrap().pixels, array![[7.0, 8.0]]);
    let rgb = |blue: FlatSamples| file(vec![("R", one()), ("G", one()), ("B", blue)]);
    assert_eq!(read(&rgb(one())).unwrap().pixels, array![[1.0, 2.5]]);
    let blue = || FlatSamples::F32(vec![1.0, 7.0]);
    assert!(refusal(&rgb(blue())).starts_with("frame: colour, 1 pixel is not grey, the first at x 1, y 0 (red 2.5, "));
    assert_eq!(read_channel(&rgb(blue()), Channel::Blue).pixels, array![[1.0, 7.0]]);
    let alpha = |alpha: [f32; 2]| file(vec![("Y", one()), ("A", FlatSamples::F32(alpha.to_vec()))]);
    assert_eq!(read(&alpha([1.0, 1.0])).unwrap().pixels, array![[1.0, 2.5]]);
    assert!(refusal(&alpha([1.0, 0.5])).starts_with("frame: 1 pixel is not opaque, the first at x 1, y 0"));
    let wanted = "; wanted one channel Y, or R, G and B, linear counts";
    assert_eq!(refusal(&file(vec![("R", one()), ("G", one())])), format!("frame: colour, channels G, R{wanted}"));
    assert_eq!(refusal(&file(vec![("Z", one())])), format!("frame: channel Z{wanted}"));
    assert_eq!(
        refusal(&file(vec![("u", one()), ("v", one()), ("w", one())])),
        format!("frame: a vector field{wanted}")
    );

    let layer = |name: &str| {
        let list = [AnyChannel::new("Y", one())].into_iter().collect();
        Layer::new((2, 1), LayerAttributes::named(name), Encoding::UNCOMPRESSED, AnyChannels::sort(list))
    };
    let mut two = Cursor::new(Vec::new());
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((2, 1)));
    let image = exr::image::Image::from_layers(attributes, vec![layer("a"), layer("b")]);
    image.write().to_buffered(&mut two).unwrap();
    assert_eq!(refusal(&two.into_inner()), "frame: 2 parts; wanted one part");
}

#[test]
fn tiff_grey_is_read_as_it_stands() {
    let wanted = array![[0.0, 1.0, 255.0], [7.0, 128.0, 3.0]];
    assert_eq!(read(&grey_tiff::<colortype::Gray8>(3, 2, &[0, 1, 255, 7, 128, 3])).unwrap().pixels, wanted);
    assert_eq!(read(&grey_tiff::<colortype::Gray16>(3, 2, &[0, 1, 255, 7, 128, 3])).unwrap().pixels, wanted);
    let sixteen = read(&grey_tiff::<colortype::Gray16>(1, 1, &[65535])).unwrap();
    assert_eq!(sixteen.pixels, array![[65535.0]]);
    let float = read(&grey_tiff::<colortype::Gray32Float>(3, 1, &[0.25, 1e6, -3.5])).unwrap();
    assert_eq!(float.pixels, array![[0.25, 1e6, -3.5]]);
    assert!(float.history.is_empty());
}

#[test]
fn packed_tiff_is_read() {
    use tiff::encoder::{Compression, DeflateLevel};
    let samples: Vec<u16> = (0..400 * 300).map(|i| (i % 4096) as u16).collect();
    for compression in [Compression::Lzw, Compression::Deflate(DeflateLevel::Best), Compression::Packbits] {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap().with_compression(compression);
        encoder.write_image::<colortype::Gray16>(400, 300, &samples).unwrap();
        let image = read(&file.into_inner()).unwrap();
        assert!(image.pixels.iter().zip(&samples).all(|(&found, &wanted)| found == f32::from(wanted)));
    }
}

#[test]
fn other_files_are_named() {
    assert_eq!(refusal(b""), "frame: empty; wanted an EXR, TIFF or PNG image");
    assert_eq!(refusal(b"{\"a\": 1}"), "frame: not an image by its first bytes; wanted EXR, TIFF or PNG");
}

#[test]
fn the_name_does_not_decide_what_is_read_but_may_not_lie_about_what_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.png");
    let refused = save(&path, &ramp(2, 2), &steps()).unwrap_err();
    assert!(
        refused.to_string().ends_with("the name of a .png file; wanted .exr or .tif, the formats written"),
        "{refused}"
    );
    assert!(!path.exists());
    std::fs::write(&path, exr(&ramp(2, 2), &steps())).unwrap();
    assert_eq!(open(&path).unwrap().pixels, ramp(2, 2));
}

#[test]
fn a_tiff_comes_back_in_whole_counts_with_its_history() {
    // One strip and many, of odd and even length.
    for (height, width) in [(1, 1), (3, 5), (1201, 1033)] {
        let pixels = Array2::from_shape_fn((height, width), |(y, x)| ((y * width + x) % 65536) as f32);
        for name in ["frame.tif", "frame.TIFF"] {
            let bytes = saved(name, &pixels, &steps());
            assert!(bytes.starts_with(b"II") || bytes.starts_with(b"MM"));
            let image = read(&bytes).unwrap();
            assert_eq!(image.pixels, pixels);
            assert_eq!(image.history, steps());
        }
        assert!(read(&saved("frame.tif", &pixels, &History::new())).unwrap().history.is_empty());
        let turned = pixels.t().as_standard_layout().into_owned().reversed_axes();
        assert!(saved("a.tif", &turned, &steps()) == saved("b.tif", &pixels, &steps()));
    }
}

#[test]
fn a_tiff_is_what_other_readers_expect() {
    let bytes = saved("frame.tif", &array![[0.0, 65535.0, 258.0], [1.0, 2.0, 3.0]], &steps());
    let mut decoder = tiff::decoder::Decoder::new(Cursor::new(bytes)).unwrap();
    assert_eq!(decoder.colortype().unwrap(), tiff::ColorType::Gray(16));
    assert_eq!(decoder.get_tag_unsigned::<u16>(Tag::PhotometricInterpretation).unwrap(), 1);
    let text = decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap();
    assert!(text.is_ascii() && text.contains("\"tool\":\"lf-synth\""), "{text}");
    assert_eq!(serde_json::from_str::<History>(&text).unwrap(), steps());
    let tiff::decoder::DecodingResult::U16(samples) = decoder.read_image().unwrap() else { panic!("16-bit") };
    assert_eq!(samples, [0, 65535, 258, 1, 2, 3]);
}

#[test]
fn a_tiff_rounds_clips_and_refuses_nan() {
    let mut pixels =
        array![[0.49, 0.5, 1.4999, -0.49, 65535.49], [-0.5, -3.0, 65535.5, f32::INFINITY, f32::NEG_INFINITY]];
    assert_eq!(outside_u16(&pixels), 5);
    let image = read(&saved("frame.tif", &pixels, &History::new())).unwrap();
    assert_eq!(image.pixels, array![[0.0, 1.0, 1.0, 0.0, 65535.0], [0.0, 0.0, 65535.0, 65535.0, 0.0]]);
    assert_eq!(outside_u16(&image.pixels), 0);

    pixels[[1, 2]] = f32::NAN;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.tif");
    let refused = save(&path, &pixels, &steps()).unwrap_err().to_string();
    assert!(refused.contains("frame.tif: 1 pixel is NaN, the first at x 2, y 1; wanted numbers"), "{refused}");
    assert!(!path.exists());
    assert_eq!(outside_u16(&pixels), 5);
    let refused = save(&path, &Array2::zeros((0, 5)), &History::new()).unwrap_err().to_string();
    assert!(refused.ends_with("5 x 0 pixels; wanted an image with pixels"), "{refused}");
}

#[test]
fn a_description_that_is_not_ours_is_no_history() {
    for text in ["ImageJ=1.54f\nunit=um\n", "{\"tool\": 1}", "[1, 2]", ""] {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        let mut page = encoder.new_image::<colortype::Gray16>(2, 1).unwrap();
        page.encoder().write_tag(Tag::ImageDescription, text).unwrap();
        page.write_data(&[1, 2]).unwrap();
        let image = read(&file.into_inner()).unwrap();
        assert!(image.history.is_empty());
        assert_eq!(image.pixels, array![[1.0, 2.0]]);
    }
}

/// A frame of 29 megapixels is written while another is in memory, so writing takes one buffer only.
#[test]
fn a_tiff_takes_one_buffer_of_its_size() {
    let pixels = ramp(500, 400);
    let folder = tempfile::tempdir().unwrap();
    let (_, largest) = allocation::largest(|| save(&folder.path().join("frame.tif"), &pixels, &steps()).unwrap());
    assert!(largest < 2 * 500 * 400 + (300 << 10), "{largest}");
}

#[test]
fn pixels_that_are_not_finite_are_counted_and_placed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    let mut pixels = ramp(4, 6);
    save(&path, &pixels, &steps()).unwrap();
    assert_eq!(open_counts(&path, None).unwrap().pixels, pixels);
    pixels[[2, 5]] = -1.5;
    save(&path, &pixels, &steps()).unwrap();
    assert_eq!(open_counts(&path, None).unwrap().pixels, pixels);
    pixels[[1, 3]] = f32::NAN;
    save(&path, &pixels, &steps()).unwrap();
    let refusal = |path: &Path| open_counts(path, None).map(|_| ()).unwrap_err().to_string();
    assert!(refusal(&path).contains("1 pixel is not finite, the first NaN at x 3, y 1; wanted finite values"));
    pixels[[3, 0]] = f32::INFINITY;
    save(&path, &pixels, &steps()).unwrap();
    assert!(refusal(&path).contains("2 pixels are not finite, the first NaN at x 3, y 1"));
    assert!(open(&path).is_ok());
}

/// A frame from which the user has subtracted the background: a fit keeps what is negative, the others see 0.
#[test]
fn a_frame_may_be_negative() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    let mut pixels = Array2::from_elem((8, 8), 4.0f32);
    pixels[[2, 5]] = -1.5;
    save(&path, &pixels, &History::new()).unwrap();
    let json = r#"{"sensor": {"width": 8, "height": 8, "pixel_pitch_mm": 0.0055},
        "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": "square"},
        "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308,
                        "rotation_rad": 0.0, "offset_mm": [0.0, 0.0]}}"#;
    let camera = lf_core::Camera::from_json(json).unwrap();
    let file = Path::new("camera.json");
    assert_eq!(open_signed_frame(&path, FrameFiles::default(), &camera, file, None).unwrap().pixels, pixels);
    pixels[[2, 5]] = 0.0;
    assert_eq!(open_frame(&path, FrameFiles::default(), &camera, file, None).unwrap().pixels, pixels);
    pixels[[1, 3]] = f32::NAN;
    save(&path, &pixels, &History::new()).unwrap();
    let refused = open_frame(&path, FrameFiles::default(), &camera, file, None).err().unwrap().to_string();
    assert!(refused.contains("1 pixel is not finite, the first NaN at x 3, y 1; wanted finite values"), "{refused}");
}

#[test]
fn an_image_without_pixels_is_not_written() {
    let refused = save(Path::new("/dev/null"), &Array2::zeros((0, 5)), &History::new()).unwrap_err();
    assert_eq!(refused.to_string(), "/dev/null: 5 x 0 pixels; wanted an image with pixels");
}

/// Replaces the first place where `from` stands.
pub fn replace(bytes: &mut [u8], from: &[u8], to: &[u8]) {
    let at = bytes.windows(from.len()).position(|window| window == from).unwrap();
    bytes[at..at + to.len()].copy_from_slice(to);
}

#[test]
fn sizes_that_the_file_cannot_hold_allocate_nothing() {
    let side = 60_000u32;
    // The windows of a 5 x 3 EXR become 60000 x 60000.
    let mut bytes = exr(&ramp(3, 5), &steps());
    let window = |x: u32, y: u32| [0, 0, x - 1, y - 1].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    replace(&mut bytes, &window(5, 3), &window(side, side));
    replace(&mut bytes, &window(5, 3), &window(side, side));
    check_hostile("exr", &bytes);
    // Width and height of a PNG, whose header then needs a new checksum, and of a TIFF.
    let mut bytes = png(5, 3, &[1; 15], ExtendedColorType::L8);
    bytes[16..20].copy_from_slice(&side.to_be_bytes());
    bytes[20..24].copy_from_slice(&side.to_be_bytes());
    let sum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    check_hostile("png", &bytes);
    let mut bytes = grey_tiff::<colortype::Gray16>(5, 3, &[1; 15]);
    for (tag, old) in [(256u16, 5u32), (257, 3)] {
        let entry = |value: u32| {
            let words = [tag.to_le_bytes(), 4u16.to_le_bytes()].concat();
            [words, 1u32.to_le_bytes().to_vec(), value.to_le_bytes().to_vec()].concat()
        };
        replace(&mut bytes, &entry(old), &entry(side));
    }
    check_hostile("tiff", &bytes);
}

fn check_hostile(kind: &str, bytes: &[u8]) {
    let (message, largest) = allocation::largest(|| refusal(bytes));
    assert!(message.contains("60000 x 60000 pixels in a file of"), "{kind}: {message}");
    assert!(largest < 1 << 20, "{kind}: allocated {largest}");
}

/// The checksum of a PNG's chunk.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg()))
    })
}

#[test]
fn damage_never_panics_and_never_takes_much_memory() {
    let samples: Vec<u16> = (0..35).map(|i| i * 1000).collect();
    let files = [
        ("exr", exr(&ramp(5, 7), &steps())),
        ("tiff", grey_tiff::<colortype::Gray16>(7, 5, &samples)),
        ("ours", saved("frame.tif", &ramp(5, 7), &steps())),
        ("float", grey_tiff::<colortype::Gray32Float>(7, 5, &[0.5; 35])),
        ("png", png(7, 5, &[3; 35], ExtendedColorType::L8)),
    ];
    for (kind, file) in &files {
        for length in 0..file.len() {
            let (_, largest) = allocation::largest(|| read(&file[..length]).is_err());
            assert!(largest < 4 << 20, "{kind} cut to {length} of {}: allocated {largest}", file.len());
        }
        for at in 0..file.len() {
            for change in [1u8, 2, 4, 8, 16, 32, 64, 128, 255] {
                let mut bytes = file.clone();
                bytes[at] ^= change;
                let (outcome, largest) = allocation::largest(|| read(&bytes));
                assert!(largest < 4 << 20, "{kind} byte {at} changed by {change}: allocated {largest}");
                if let Ok(image) = outcome {
                    assert!(!image.pixels.is_empty());
                }
            }
        }
    }
}
