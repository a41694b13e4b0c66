//! Frames as the pages of TIFFs: the pipeline makes of them what it makes of single files.

use crate::swapped::{done as ran, python};
use crate::weather::{campaign, pipeline, said, undisturbed};
use lf_core::image::Stack;
use lf_tests::Call;
use lf_tests::scripts::has_programs;
use lf_tests::tools::workspace;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A TIFF of 16-bit grey pages, byte by byte: header, then for each page its pixels and its directory.
fn write_pages(path: &Path, frames: &[&str]) {
    let mut file = b"II\x2a\0\0\0\0\0".to_vec();
    let mut link = 4;
    for frame in frames {
        let image = Stack::open(&campaign().join("raw").join(frame)).unwrap().read(0, None).unwrap().pixels;
        let (height, width) = image.dim();
        let pixels = file.len() as u32;
        file.extend(image.iter().flat_map(|&value| (value as u16).to_le_bytes()));
        let directory = file.len() as u32;
        file[link..link + 4].copy_from_slice(&directory.to_le_bytes());
        let bytes = 2 * (width * height) as u32;
        let tags = [(256, width as u32), (257, height as u32), (258, 16), (262, 1), (273, pixels), (279, bytes)];
        file.extend((tags.len() as u16).to_le_bytes());
        for (tag, value) in tags {
            let entry = [&u16::to_le_bytes(tag)[..], &4u16.to_le_bytes(), &1u32.to_le_bytes(), &value.to_le_bytes()];
            file.extend(entry.concat());
        }
        link = file.len();
        file.extend([0; 4]);
    }
    fs::write(path, file).unwrap();
}

/// Runs the pipeline up to the fields, and compares volumes and fields with those of single files.
fn compare(place: &TempDir, settings: &[&str], names: &[(&str, &str)]) {
    let out = place.path().join("out");
    let words: Vec<&str> = settings.iter().copied().chain(["-j2", "correlate"]).collect();
    let ended = pipeline(place.path(), &out, &words).output().unwrap();
    assert!(ended.status.success(), "{}", said(&ended));
    for (name, single) in names {
        let made = fs::read(out.join(name)).unwrap();
        assert!(made == undisturbed()[*single], "{name} differs from {single}");
    }
}

#[test]
fn double_frames_are_pairs() {
    if !has_programs(&["make"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    fs::create_dir(place.path().join("raw")).unwrap();
    for n in 1..=4 {
        let frames = [format!("000{n}a.tif"), format!("000{n}b.tif")];
        write_pages(&place.path().join(format!("raw/000{n}.tif")), &[&frames[0], &frames[1]]);
    }
    let names = [
        ("background-first.exr", "background-a.exr"),
        ("background-second.exr", "background-b.exr"),
        ("volume-0003.1.lfv", "volume-0003b.lfv"),
        ("field-0002.0-0002.1.exr", "field-0002a-0002b.exr"),
    ];
    compare(&place, &["PAGES=0-1"], &names);
}

#[test]
fn one_file_holds_all_pairs_or_a_series() {
    if !has_programs(&["make", "sed"]) {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    fs::create_dir(place.path().join("raw")).unwrap();
    let frames: Vec<String> = (1..=4).flat_map(|n| ["a", "b"].map(|end| format!("000{n}{end}.tif"))).collect();
    let frames: Vec<&str> = frames.iter().map(String::as_str).collect();
    write_pages(&place.path().join("raw/run.tif"), &frames);
    let names = [
        ("background-second.exr", "background-b.exr"),
        ("field-run.0-run.1.exr", "field-0001a-0001b.exr"),
        ("field-run.6-run.7.exr", "field-0004a-0004b.exr"),
    ];
    compare(&place, &["PAGES=pairs"], &names);
    let info = |file: &str| {
        let call = Call::new("lf-validate").words(["info", file]).within(&place.path().join("raw"));
        call.run().done().text()
    };
    let pages = info("run.tif");
    assert!(pages.contains("8, each a frame") && pages.contains("run.tif:0 to run.tif:7: 168 x 168 px, 16-bit grey"));
    assert!(!info("run.tif:3").contains("each a frame"), "{pages}");
    let dry = pipeline(place.path(), &place.path().join("new"), &["-n", "PAGES=series", "correlate"]).output().unwrap();
    let text = String::from_utf8(dry.stdout).unwrap();
    let fields = (0..8).filter(|n| text.contains(&format!("field-run.{n}-run.{}.exr", n + 1))).count();
    assert!(fields == 7 && text.contains("raw/run.tif:7 -c") && text.contains("background-all.exr"), "{text}");
}

/// Packed samples of 12 bits by the vendor's layout: AB CD EF holds ABC and DEF.
#[test]
fn frames_of_a_vendor_become_pages() {
    let Some(mut python) = python(&["numpy", "PIL"]) else { return };
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    let header = |bits: usize| {
        format!(
            "#Camera Information Header\nTotal Frame : 2\nImage Width : 4\nImage Height : 1\nColor Type : Mono\n\
             Color Bit : {bits}\nFile Format : MRaw\nComment Text : \n\n#Again:\nTotal Frame : 9\nEND\n"
        )
    };
    fs::write(path("run.cih"), header(12)).unwrap();
    fs::write(path("run.mraw"), [0xab, 0xcd, 0xef, 0x00, 0x1f, 0xff, 0x12, 0x34, 0x56, 0x78, 0x9a, 0xbc]).unwrap();
    python.arg(workspace().join("scripts/examples/mraw_to_tiff.py")).args([path("run.cih"), path("run.tif")]);
    ran(python);
    let stack = Stack::open(&path("run.tif")).unwrap();
    let pages: Vec<Vec<f32>> = (0..2).map(|n| stack.read(n, None).unwrap().pixels.into_iter().collect()).collect();
    assert_eq!(pages, [[0xabc, 0xdef, 0x001, 0xfff], [0x123, 0x456, 0x789, 0xabc]].map(|p| p.map(|v| v as f32)));
}
