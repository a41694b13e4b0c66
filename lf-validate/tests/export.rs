//! `lf-validate export`: other programs' forms, read back here; tests/exports.rs reads them with Python's libraries.

use crate::workbench::{field, save_field, workbench};
use lf_core::Grid;
use lf_core::image::Stack;
use lf_core::io::Bytes;
use lf_tests::Workbench;
use serde_json::Value;

const GRID: Grid = Grid { shape: [4, 3, 2], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [-0.15, -0.1, -0.5] };

/// A volume of 4 x 3 x 2 voxels with three of them lit.
fn volume(bench: &Workbench) {
    bench.volume("a.lfv", &GRID, &[0, 7, 17], &[("intensity", &[1.0, 2.5, 4.0])]);
}

fn page(bench: &Workbench, name: &str, n: usize) -> Vec<f32> {
    let stack = Stack::from_bytes(Bytes::from(bench.bytes(name)), name).unwrap();
    stack.decode(n, None).unwrap().pixels.into_iter().collect()
}

#[test]
fn a_stack_shows_the_volume_as_the_camera_sees_it() {
    let bench = workbench();
    volume(&bench);
    bench.done(&["export", "a.lfv", "-o", "a.tif"]);
    // Voxel 0 is the lower left corner of the deepest slice, 7 is voxel (3, 1, 0), 17 is (1, 1, 1).
    assert_eq!(page(&bench, "a.tif", 0), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.5, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!(page(&bench, "a.tif", 1), [0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    bench.done(&["export", "a.lfv", "-o", "b.tif", "--bits", "16", "--slab", "0,1"]);
    assert_eq!(page(&bench, "b.tif", 0)[5], 65535.0);
    let text = bench.bytes("b.tif");
    let has = |word: &[u8]| text.windows(word.len()).any(|window| window == word);
    assert!(has(b"images=1\n") && has(b"unit=mm\nspacing=1\n") && has(b"lf_history=["), "the description");
}

#[test]
fn a_box_cuts_and_places() {
    let bench = workbench();
    volume(&bench);
    bench.done(&["export", "a.lfv", "-o", "a.csv", "--box", "-0.06,0.2,-0.01,0.1,-1,1"]);
    let text = bench.text("a.csv");
    let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(
        rows,
        ["x_mm,y_mm,z_mm,intensity", "0.1500000,0.0000000,-0.5000000,2.5", "-0.0500000,0.0000000,0.5000000,4"]
    );
    assert!(text.starts_with("# frame: right-handed\n"), "{text}");
    bench.done(&["export", "a.lfv", "-o", "a.vti", "--box", "-0.06,0.2,-0.01,0.1,-1,1"]);
    let bytes = bench.bytes("a.vti");
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains(r#"WholeExtent="0 2 0 1 0 1""#) && text.contains(r#"Name="intensity""#), "{text}");
    let start = bytes.windows(2).position(|pair| pair == b"\n_").unwrap() + 2;
    let value = |n: usize| f32::from_le_bytes(bytes[start + 8 + 4 * n..][..4].try_into().unwrap());
    let values: Vec<f32> = (0..12).map(value).collect();
    assert_eq!(values, [0.0, 0.0, 2.5, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    bench.refused(
        &["export", "a.lfv", "-o", "c.vti", "--slab", "3,4"],
        &["no voxel has its centre in z from 3 to 4 mm"],
    );
    assert!(!bench.path("c.vti").exists());
}

/// Scar: only some tasks knew a NetCDF by its bytes.
#[test]
fn a_netcdf_is_a_field_for_every_task() {
    let bench = workbench();
    save_field(&bench, "a.exr", &field([3, 2, 2], |[x, _, _]| [0.1 * x as f32, 0.0, 0.0]));
    for line in [["a.exr", "a.nc"], ["a.exr", "from-exr.csv"], ["a.nc", "from-nc.csv"]] {
        bench.done(&["export", line[0], "-o", line[1]]);
    }
    assert_eq!(bench.text("from-nc.csv"), bench.text("from-exr.csv"));
    bench.done(&["export", "a.nc", "a.exr", "-o", "run.vti.series"]);
    bench.done(&["info", "a.nc"]);
    bench.done(&["displacement", "a.nc", "a.exr"]);
}

#[test]
fn a_series_is_listed_with_its_times() {
    let bench = workbench();
    for (n, name) in ["a.exr", "b.exr"].into_iter().enumerate() {
        save_field(&bench, name, &field([3, 2, 2], |_| [n as f32, 0.0, 0.0]));
    }
    bench.done(&["export", "a.exr", "b.exr", "-o", "run.vti.series", "--every", "0.5"]);
    let list: Value = serde_json::from_str(&bench.text("run.vti.series")).unwrap();
    assert_eq!(list["files"][1], serde_json::json!({"name": "run-0001.vti", "time": 0.5}));
    assert!(bench.path("run-0000.vti").exists() && bench.path("run-0001.vti").exists());

    // Two records of one NetCDF: the time of the second, then its u.
    bench.done(&["export", "a.exr", "b.exr", "-o", "run.nc", "--every", "0.5"]);
    let bytes = bench.bytes("run.nc");
    assert_eq!(bytes[..8], *b"CDF\x02\0\0\0\x02");
    let record = 8 + 12 * (9 * 4 + 1);
    let second = &bytes[bytes.len() - record..];
    assert_eq!(f64::from_be_bytes(second[..8].try_into().unwrap()), 0.5);
    assert_eq!(f32::from_be_bytes(second[8..12].try_into().unwrap()), 1.0);
    save_field(&bench, "c.exr", &field([4, 2, 2], |_| [0.0; 3]));
    bench.refused(
        &["export", "a.exr", "c.exr", "-o", "no.nc"],
        &["field 2 of the series has its vectors at other places"],
    );
    let mut timed = field([3, 2, 2], |_| [0.0; 3]);
    timed.layout.dt_s = Some(0.1);
    save_field(&bench, "d.exr", &timed);
    let wanted = "field 2 of the series has 0.1 s between its volumes; wanted no time like the first";
    bench.refused(&["export", "a.exr", "d.exr", "-o", "no.nc"], &[wanted]);
    assert!(!bench.path("no.nc").exists());
}

#[test]
fn a_series_with_a_wrong_field_writes_nothing() {
    let bench = workbench();
    save_field(&bench, "a.exr", &field([3, 2, 2], |_| [0.0; 3]));
    std::fs::write(bench.path("b.exr"), "cut").unwrap();
    bench.refused(&["export", "a.exr", "b.exr", "-o", "run.vti.series"], &["b.exr: not an EXR by its first bytes"]);
    std::fs::create_dir(bench.path("run-0001.vti")).unwrap();
    bench.refused(&["export", "a.exr", "a.exr", "-o", "run.vti.series"], &["run-0001.vti: is a folder"]);
    assert!(!bench.path("run-0000.vti").exists());
}

#[test]
fn a_huge_sparse_volume_is_written_by_its_voxels_or_refused() {
    let bench = workbench();
    let grid = Grid { shape: [2, 2, 1 << 40], ..GRID };
    bench.volume("deep.lfv", &grid, &[1, 4 << 30, (4 << 40) - 1], &[("intensity", &[1.0, 2.0, 3.0])]);
    bench.done(&["export", "deep.lfv", "-o", "deep.csv"]);
    let text = bench.text("deep.csv");
    let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).skip(1).collect();
    assert_eq!((rows.len(), rows[0], rows[1].ends_with(",2")), (3, "-0.0500000,-0.1000000,-0.5000000,1", true));
    let limit = ["--max-memory", "0.5"];
    let wanted = |name: &str| format!("{name}: slices of a grid of");
    bench.refused(&[&["export", "deep.lfv", "-o", "deep.tif"], &limit[..]].concat(), &[&wanted("deep.lfv")]);
    let grid = Grid { shape: [1 << 20, 1 << 20, 2], ..GRID };
    bench.volume("wide.lfv", &grid, &[1], &[("intensity", &[1.0])]);
    for end in ["vti", "tif"] {
        let output = format!("wide.{end}");
        let words = [&["export", "wide.lfv", "-o", &output], &limit[..]].concat();
        bench.refused(&words, &[&wanted("wide.lfv"), "wanted 0.5 GB at most, as --max-memory allows"]);
    }
}

#[test]
fn tracks_join_particles_of_one_number() {
    let bench = workbench();
    let rows = "0,5,1,2,3,10\n0,6,0,0,0,10\n1,5,1.5,2,3,11\n";
    let text = format!("# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n{rows}");
    std::fs::write(bench.path("p.csv"), text).unwrap();
    bench.done(&["export", "p.csv", "-o", "p.vtp", "--dt", "0.001"]);
    let bytes = bench.bytes("p.vtp");
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains(r#"NumberOfPoints="3" NumberOfVerts="3" NumberOfLines="1""#), "{text}");
    assert!(text.contains("0.001</DataArray>"), "{text}");
    let start = bytes.windows(2).position(|pair| pair == b"\n_").unwrap() + 2;
    let first = f64::from_le_bytes(bytes[start + 8..][..8].try_into().unwrap());
    assert_eq!(first, 0.5, "the displacement of the first particle along x");
}

#[test]
fn pictures_have_the_format_of_their_name() {
    let bench = workbench();
    save_field(&bench, "a.exr", &field([6, 5, 3], |[x, y, z]| [(0.1 * y) as f32, (-0.1 * x) as f32, z as f32]));
    bench.done(&["export", "a.exr", "-o", "a.svg", "--slice", "z=0.5", "--scalar", "vorticity", "--range", "-0.3,0.3"]);
    assert!(bench.text("a.svg").contains("vorticity about z, 1"));
    bench.done(&["export", "a.exr", "-o", "a.pdf"]);
    assert!(bench.bytes("a.pdf").starts_with(b"%PDF-1.4"));
    bench.done(&["export", "a.exr", "-o", "a.png"]);
    let grey = Stack::from_bytes(Bytes::from(bench.bytes("a.png")), "a.png").unwrap();
    let pixels = grey.decode(0, Some(lf_core::image::Channel::Luma)).unwrap().pixels;
    let dark = pixels.iter().filter(|value| **value < 100.0).count();
    assert!(pixels.len() > 1_000_000 && dark > 3000, "{dark} dark pixels of {}", pixels.len());
    bench.refused(&["export", "a.exr", "-o", "a.nc", "--scalar", "u"], &["--scalar: changes nothing here"]);
}

#[test]
fn options_that_change_nothing_and_unknown_forms_are_refused() {
    let bench = workbench();
    volume(&bench);
    save_field(&bench, "a.exr", &field([3, 2, 2], |_| [0.0; 3]));
    let refused = |words: &[&str], lines: &[&str]| bench.refused(words, lines);
    refused(
        &["export", "a.exr", "-o", "a.nc", "--slab", "0,1"],
        &["--slab: changes nothing here; wanted it for a volume"],
    );
    refused(&["export", "a.lfv", "-o", "a.nc"], &["a.nc: the extension .nc; wanted the name of a .vti, .tif"]);
    refused(&["export", "a.exr", "-o", "a.tif"], &["a.tif: the extension .tif; wanted the name of a .nc"]);
    refused(&["export", "a.lfv", "-o", "a.vti", "--column", "score"], &["only the column `intensity`"]);
    refused(&["export", "a.lfv", "-o", "a.vti", "--bits", "16"], &["--bits: changes nothing here"]);
    refused(&["export", "a.exr", "-o", "a.nc", "--column", "score"], &["--column: changes nothing here"]);
    for end in ["vti", "csv", "svg"] {
        let output = format!("a.{end}");
        let wanted = "--every: changes nothing here; wanted it for fields in a .nc or a .vti.series only";
        refused(&["export", "a.exr", "-o", &output, "--every", "1"], &[wanted]);
    }
}
