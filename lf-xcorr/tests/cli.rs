//! The command line: inputs, outputs and refusals.

use crate::scene;
use crate::workbench::{SMALL, workbench};
use lf_core::{Field, field::MEASURED};
use std::path::Path;

#[test]
fn file_pipe_and_redirect_give_the_same_bytes_on_any_number_of_threads() {
    let bench = workbench();
    bench.done(&[&["a.lfv", "b.lfv", "-o", "file.exr", "--threads", "1"], &SMALL[..]].concat());
    let wanted = bench.bytes("file.exr");
    for threads in ["2", "4"] {
        bench.done(&[&["a.lfv", "b.lfv", "-o", "again.exr", "--threads", threads], &SMALL[..]].concat());
        assert!(bench.bytes("again.exr") == wanted, "{threads} threads");
    }

    let arguments = [&["-", "b.lfv"], &SMALL[..]].concat();
    assert!(bench.call(&arguments).redirect(&bench.path("a.lfv")).run().done().stdout == wanted);
    assert!(bench.feed(&arguments, bench.bytes("a.lfv")).done().stdout == wanted);

    let swapped = [&["a.lfv", "-", "-o", "-"], &SMALL[..]].concat();
    assert!(bench.call(&swapped).redirect(&bench.path("b.lfv")).run().done().stdout == wanted);
}

#[test]
fn the_field_is_the_displacement_in_millimetres() {
    let bench = workbench();
    let said = bench.done(&[&["a.lfv", "b.lfv", "-o", "field.exr", "--stats", "s.json"], &SMALL[..]].concat()).stderr;
    assert!(said.is_empty(), "a typed window is no reason to warn: {said}");
    let field = Field::open(&bench.path("field.exr")).unwrap();
    assert_eq!((field.layout.shape, field.layout.window, field.layout.overlap), ([5, 3, 5], [24, 24, 12], 0.75));
    for i in (0..field.len()).filter(|&i| field.flag[i] == MEASURED) {
        for (found, wanted) in [(field.u[i], 0.13), (field.v[i], -0.07), (field.w[i], 0.2)] {
            assert!((found - wanted).abs() < 0.03, "{found} for {wanted}");
        }
    }
    let stats = bench.text("s.json");
    ["vectors", "measured", "replaced", "no_data"].iter().for_each(|key| assert!(stats.contains(key)));
}

#[test]
fn other_formats_and_the_picture() {
    let bench = workbench();
    bench.done(&[&["a.lfv", "b.lfv", "-o", "f.csv", "--plot", "f.svg", "-q"], &SMALL[..]].concat());
    bench.done(&[&["a.lfv", "b.lfv", "-o", "f.vti", "-q"], &SMALL[..]].concat());
    assert_eq!(bench.bytes("f.csv").iter().filter(|&&byte| byte == b'\n').count(), 1 + 5 * 3 * 5);
    assert!(bench.bytes("f.csv").starts_with(b"x_mm,y_mm,z_mm,u_mm,v_mm,w_mm,"));
    assert!(bench.bytes("f.svg").starts_with(b"<svg") && bench.bytes("f.vti").starts_with(b"<?xml"));
}

#[test]
fn the_picture_is_of_the_slice_that_was_asked_for() {
    let bench = workbench();
    for (slice, title) in [
        // Without a place, the layer that shows the largest signal. All show the same, so it is the middle one.
        (&[][..], "z = 5.75 mm (layer 3 of 5)"),
        (&["--slice", "z"], "z = 5.75 mm (layer 3 of 5)"),
        (&["--slice", "z=4"], "z = 4.25 mm (layer 2 of 5)"),
        (&["--slice", "y=1.2"], "y = 1.35 mm (layer 1 of 3)"),
        (&["--slice=x=2.6"], "x = 2.35 mm (layer 3 of 5)"),
    ] {
        bench.done(&[&["a.lfv", "b.lfv", "-o", "f.exr", "--plot", "f.svg", "-q"], slice, &SMALL[..]].concat());
        let svg = bench.text("f.svg");
        assert!(svg.contains(&format!("Displacement at {title}")), "{slice:?}: {svg:.3000}");
    }
}

#[test]
fn the_colours_show_what_was_asked_for() {
    let bench = workbench();
    let with = |words: &[&'static str]| {
        [&["a.lfv", "b.lfv", "-o", "f.exr", "--plot", "f.svg", "-q", "--slice", "z=4"], words, &SMALL[..]].concat()
    };
    for (scalar, name) in [("u", "u, mm"), ("speed", "length, mm"), ("vorticity", "vorticity about z, 1")] {
        bench.done(&with(&["--scalar", scalar]));
        assert!(bench.text("f.svg").contains(name), "{scalar}");
    }
    bench.done(&with(&["--range", "-0.5,1.5"]));
    assert!(bench.text("f.svg").contains("1.5"));
    bench.refused(&with(&["--scalar", "curl"]), &["wanted u, v, w, speed, vorticity or uncertainty"]);
    bench.refused(&with(&["--range", "2,1"]), &["wanted LOW,HIGH"]);
}

#[test]
fn an_invalid_slice_is_refused_in_one_line() {
    let bench = workbench();
    let with = |slice: &'static str| {
        [&["a.lfv", "b.lfv", "-o", "f.exr", "-q", "--plot", "f.svg", "--slice", slice], &SMALL[..]].concat()
    };
    for slice in ["", "q", "q=1", "z=", "z=here", "z=nan", "z=1,2", "3"] {
        bench.refused(&with(slice), &["--slice", "z=0.5"]);
    }
    bench.refused(&with("z=12.3"), &["a.lfv: slice z = 12.3 mm is outside the volume; wanted -0.25 to 11.75 mm"]);
    bench.refused(&with("y=-1"), &["a.lfv: slice y = -1 mm is outside the volume; wanted -0.05 to 3.95 mm"]);
    bench.refused(&[&["a.lfv", "b.lfv", "-o", "f.exr", "-q", "--slice", "z"], &SMALL[..]].concat(), &["--plot"]);
    assert!(!bench.path("f.exr").exists() && !bench.path("f.svg").exists(), "refused before the work");

    // In the volume, but beyond the outermost windows. This is known only after the correlation, which is kept.
    bench.refused(&with("x=0.2"), &["f.svg: slice x = 0.2 mm is outside the field; wanted 0.85 to 3.85 mm"]);
    assert!(bench.path("f.exr").exists() && !bench.path("f.svg").exists());
}

#[test]
fn verbose_reports_every_decision() {
    let bench = workbench();
    let said = bench.done(&[&["a.lfv", "b.lfv", "-o", "f.exr", "-v"], &SMALL[..]].concat()).stderr;
    for words in
        ["pass 1: windows of 48 x 40 x 24", "pass 2: windows of 24 x 24 x 12", "search to 6 x 6 x 4", "outliers"]
    {
        assert!(said.contains(words), "{words:?} not in {said}");
    }
}

#[test]
fn windows_larger_than_the_volume_are_refused() {
    let bench = workbench();
    bench.refused(&["a.lfv", "b.lfv", "-o", "f.exr", "--window", "49,40,16"], &["49 x 40 x 16", "48 x 40 x 24"]);
    let first = ["--pass", "48,41,16", "--pass", "24,24,12"];
    bench.refused(&[&["a.lfv", "b.lfv", "-o", "f.exr", "-q"], &first[..]].concat(), &["48 x 41 x 16"]);
}

#[test]
fn bad_input_gets_one_line() {
    let bench = workbench();
    let grid = scene::grid([48, 40, 24]);
    bench.volume("grid.lfv", &grid, &[1, 2], &[("intensity", &[1.0, 2.0])]);
    bench.volume("score.lfv", &grid, &[1, 2], &[("score", &[1.0, 2.0]), ("depth", &[1.0, 2.0])]);
    bench.volume("empty.lfv", &grid, &[], &[("intensity", &[])]);
    bench.volume("negative.lfv", &grid, &[1, 2], &[("intensity", &[1.0, -2.0])]);
    std::fs::write(bench.path("text.lfv"), "not a volume").unwrap();
    let small = |more: &[&'static str]| [more, &["-o", "f.exr", "-q"], &SMALL[..]].concat();

    bench.refused(&small(&["missing.lfv", "b.lfv"]), &["missing.lfv"]);
    bench.refused(&small(&["a.lfv", "text.lfv"]), &["text.lfv"]);
    bench.refused(
        &small(&["a.lfv", "grid.lfv"]),
        &["grid.lfv: grid of 48 x 40 x 24", "0.1 x 0.1 x 0.5 mm", "1 x 1 x 1 mm"],
    );
    bench.refused(&small(&["grid.lfv", "score.lfv"]), &["score.lfv", "score", "depth", "intensity"]);
    bench.refused(&small(&["grid.lfv", "empty.lfv"]), &["empty.lfv", "0 voxels"]);
    bench.refused(&small(&["negative.lfv", "grid.lfv"]), &["negative.lfv", "-2", "[2, 0, 0]"]);
    bench.refused(&small(&["-", "-"]), &["standard input"]);

    for (option, value) in [
        ("--overlap", "1"),
        ("--overlap", "-0.1"),
        ("--overlap", "nan"),
        ("--window", "10,10"),
        ("--window", "10,0,10"),
        ("--window", "10,x,10"),
        ("--search", "99,1,1"),
        ("--floor", "1"),
    ] {
        bench.refused(&["a.lfv", "b.lfv", "-o", "f.exr", "-q", &format!("{option}={value}")], &[&option[2..]]);
    }
    bench.refused(&small(&["a.lfv"]), &["<B>"]);
    bench.refused(&["a.lfv", "b.lfv", "-o", "a.lfv", "-q"], &["input"]);
    bench.refused(&["a.lfv", "b.lfv", "-o", "f.exr", "--plot", "b.lfv", "-q"], &["input"]);
    bench.refused(&["a.lfv", "b.lfv", "-o", "f.exr", "--plot", "f.exr", "-q"], &["--plot"]);
    bench.refused(&[&["a.lfv", "b.lfv", "-o", "f.png", "-q"], &SMALL[..]].concat(), &[".png"]);
    bench.refused(&[&["a.lfv", "b.lfv", "-o", "nowhere/f.exr", "-q"], &SMALL[..]].concat(), &["nowhere"]);
    if Path::new("/dev/full").exists() {
        bench.refused(&[&["a.lfv", "b.lfv", "-o", "/dev/full", "-q"], &SMALL[..]].concat(), &["/dev/full"]);
    }
    assert!(!bench.path("f.exr").exists(), "no half file");
}
