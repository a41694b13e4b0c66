//! The options of the command line beyond windows and files.

use crate::scene;
use crate::workbench::{SMALL, grid, save_pair, workbench};
use lf_core::{Field, field::MEASURED};
use lf_tests::Workbench;

fn field(bench: &Workbench, name: &str) -> Field {
    Field::open(&bench.path(name)).unwrap()
}

#[test]
fn passes_can_be_listed() {
    let bench = workbench();
    let passes = "--pass 48,40,24:0.5:6,6,4 --pass 32,32,16 --pass 24,24,12:0.75";
    let said = bench.done(&format!("a.lfv b.lfv -o f.exr -v {passes}")).stderr;
    for words in
        ["pass 1: windows of 48 x 40 x 24", "search to 6 x 6 x 4", "pass 2: windows of 32 x 32 x 16", "pass 3.2: "]
    {
        assert!(said.contains(words), "{words:?} not in {said}");
    }
    let layout = field(&bench, "f.exr").layout;
    assert_eq!((layout.window, layout.overlap), ([24, 24, 12], 0.75));
    for wrong in ["24,24", "24,24,12:x", "24,24,12:0.5:1,1", "24,24,12::", ""] {
        bench.refused(&["a.lfv", "b.lfv", "-o", "g.exr", "--pass", wrong], &["pass"]);
    }
    bench.refused(&["a.lfv", "b.lfv", "-o", "g.exr", "--pass", "24,24,12:nan"], &["overlap NaN"]);
    bench.refused(&["a.lfv", "b.lfv", "--pass", "24,24,12", "--window", "24,24,12"], &["--pass"]);
    assert!(!bench.path("g.exr").exists());
}

#[test]
fn windows_in_millimetres_are_windows_in_voxels() {
    let bench = workbench();
    let given = |more: &[&'static str]| {
        let said = bench.done(&[&["a.lfv", "b.lfv", "-o", "f.exr", "-v"], more].concat()).stderr;
        (bench.bytes("f.exr"), said)
    };
    // Voxels of 0.1 x 0.1 x 0.5 mm.
    let last = given(&["--window", "24,24,12"]).0;
    for near in ["2.4,2.4,6", "2.44,2.36,6.2"] {
        let (bytes, said) = given(&["--window-mm", near]);
        assert!(bytes == last, "{near}");
        let became = format!("window of {} mm is 24 x 24 x 12 voxels\n", near.replace(',', " x "));
        assert!(said.contains(&became), "{became} not in {said}");
    }
    let (bytes, said) = given(&["--initial-mm", "3,3,8", "--window-mm", "2.4,2.4,6"]);
    assert!(bytes == given(&["--pass", "30,30,16", "--pass", "24,24,12"]).0);
    assert!(said.contains("initial window of 3 x 3 x 8 mm is 30 x 30 x 16 voxels\n"), "{said}");
    let (bytes, said) = given(&["--window-mm", "2.4,9,0.4"]);
    assert!(bytes == given(&["--window", "24,40,4"]).0);
    assert!(said.contains("warning: window of 2.4 x 9 x 0.4 mm is 24 x 90 x 1 voxels; used 24 x 40 x 4"), "{said}");

    for option in ["--window", "--pass"] {
        for mm in ["--window-mm", "--initial-mm"] {
            bench.refused(&["a.lfv", "b.lfv", "-o", "g.exr", option, "24,24,12", mm, "2.4,2.4,6"], &[option, mm]);
        }
    }
    for wrong in ["2.4,2.4", "0,2.4,6", "-1,2.4,6", "nan,2.4,6", "2.4,2.4,inf", ""] {
        bench.refused(
            &["a.lfv", "b.lfv", "-o", "g.exr", &format!("--window-mm={wrong}")],
            &["window-mm", "in mm above 0"],
        );
    }
    assert!(!bench.path("g.exr").exists());
}

#[test]
fn passes_with_their_own_overlap_keep_it() {
    let bench = workbench();
    let given = |more: &[&'static str]| {
        bench.done(&[&["a.lfv", "b.lfv", "-o", "f.exr", "-q"], more].concat());
        field(&bench, "f.exr").layout.overlap
    };
    assert_eq!(given(&["--pass", "24,24,12:0.25"]), 0.25);
    assert_eq!(given(&["--overlap", "0.5", "--pass", "32,32,16:0.25", "--pass", "24,24,12"]), 0.5);
    assert_eq!(given(&["--window", "24,24,12"]), 0.75);
}

#[test]
fn an_option_without_effect_is_refused() {
    let bench = workbench();
    let one = ["--pass", "24,24,12:0.5:3,3,3"];
    for (more, option) in [
        (&["--search", "2,2,2"][..], "--search"),
        (&["--overlap", "0.5"], "--overlap"),
        (&["--repeats", "3", "--deform", "never"], "--repeats"),
    ] {
        bench.refused(&[&["a.lfv", "b.lfv", "-o", "f.exr"], &one[..], more].concat(), &[option, "changes nothing"]);
    }
    assert!(!bench.path("f.exr").exists());
}

#[test]
fn velocities_need_a_time() {
    let bench = workbench();
    bench.done(&[&["a.lfv", "b.lfv", "-o", "f.csv", "-q", "--dt", "0.002"], &SMALL[..]].concat());
    let text = bench.text("f.csv");
    let mut lines = text.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    for line in lines {
        let value = |name: &str| line.split(',').nth(column(name)).unwrap().parse::<f64>().unwrap();
        assert!((value("u_mm_s") * 0.002 - value("u_mm")).abs() < 1e-6 * value("u_mm").abs() + 1e-9);
        assert!(value("count") >= 0.0 && (value("flag") != 0.0 || value("su_mm") > 0.0 || value("su_mm").is_nan()));
    }
    bench.done(&[&["a.lfv", "b.lfv", "-o", "f.exr", "-q", "--dt", "0.002"], &SMALL[..]].concat());
    assert_eq!(field(&bench, "f.exr").layout.dt_s, Some(0.002));
    for wrong in ["0", "-1", "nan", "inf", "x"] {
        bench.refused(&["a.lfv", "b.lfv", &format!("--dt={wrong}")], &["dt"]);
    }
}

#[test]
fn a_mask_is_a_box_or_a_file() {
    let bench = workbench();
    // 48 x 40 x 24 voxels of 0.1 x 0.1 x 0.5 mm, from 0 on. The box holds voxels 8 to 40 along x.
    bench.done(&["a.lfv", "b.lfv", "-o", "f.exr", "-q", "--mask", "0.8,4.0,-9,9,-9,99", "--window", "24,24,12"]);
    let boxed = field(&bench, "f.exr");
    // Windows of 24 voxels, 6 apart: two fit into 33 voxels, and the first begins after 1 voxel.
    assert_eq!(boxed.layout.shape[0], 2);
    assert!((boxed.layout.origin_mm[0] - (0.8 + 0.1 + 1.15)).abs() < 1e-9, "{:?}", boxed.layout.origin_mm);

    let grid = grid();
    let left: Vec<u64> = (0..grid.len()).filter(|&index| grid.voxel(index)[0] < 24).collect();
    bench.volume("left.lfv", &grid, &left, &[]);
    bench.done(&[&["a.lfv", "b.lfv", "-o", "g.exr", "-q", "--mask", "left.lfv"], &SMALL[..]].concat());
    let masked = field(&bench, "g.exr");
    // The last windows hold no light.
    assert!((0..masked.len()).filter(|i| i % 5 == 4).all(|i| masked.flag[i] != MEASURED));
    assert!(masked.flag.iter().filter(|&&flag| flag == MEASURED).count() * 2 > masked.len());

    bench.volume("other.lfv", &scene::grid([48, 40, 24]), &[1], &[]);
    bench.refused(&["a.lfv", "b.lfv", "--mask", "other.lfv", "-q"], &["other.lfv: a grid of", "a.lfv"]);
    bench.refused(&["a.lfv", "b.lfv", "--mask", "missing.lfv", "-q"], &["missing.lfv"]);
    bench.refused(&["a.lfv", "b.lfv", "--mask", "90,99,0,9,0,9", "-q"], &["--mask", "48 x 40 x 24"]);
    for wrong in ["1,0,0,9,0,9", "0,1,2", "0,1,0,1,0,x", "-q"] {
        bench.refused(&["a.lfv", "b.lfv", "--mask", wrong], &["x0,x1,y0,y1,z0,z1"]);
    }
    bench.refused(&["-", "b.lfv", "--mask", "-"], &["standard input"]);
    let slice = ["a.lfv", "b.lfv", "-o", "h.exr", "--plot", "h.svg", "--slice", "z=11", "--mask", "0,4.8,0,4,0,6"];
    bench.refused(&[&slice[..], &["-q", "--window", "24,24,12"]].concat(), &["slice z = 11 mm is outside the mask"]);
    assert!(!bench.path("h.exr").exists());
}

#[test]
fn further_pairs_are_counted_with_the_first() {
    let bench = workbench();
    save_pair(&bench, ["c.lfv", "d.lfv"], 2);
    bench.done(&[&["a.lfv", "b.lfv", "-o", "one.exr", "-q"], &SMALL[..]].concat());
    bench.done(&[&["a.lfv", "b.lfv", "-o", "two.exr", "-q", "--and", "c.lfv", "d.lfv"], &SMALL[..]].concat());
    let [one, two] = ["one.exr", "two.exr"].map(|name| field(&bench, name).count.iter().sum::<f32>());
    assert!(two > 1.6 * one && two < 2.6 * one, "{one} {two}");
    bench.refused(&["a.lfv", "b.lfv", "--and", "c.lfv"], &["--and"]);
    bench.volume("grid.lfv", &scene::grid([48, 40, 24]), &[1, 2], &[("intensity", &[1.0, 2.0])]);
    bench.refused(
        &["a.lfv", "b.lfv", "-q", "--and", "c.lfv", "grid.lfv"],
        &["grid.lfv", "wanted the grid of the first"],
    );
    bench.refused(&["a.lfv", "b.lfv", "-o", "d.lfv", "--and", "c.lfv", "d.lfv"], &["d.lfv", "input"]);
}

#[test]
fn the_method_follows_its_options() {
    let bench = workbench();
    let said = |more: &[&'static str]| {
        bench.done(&[&["a.lfv", "b.lfv", "-o", "f.exr", "-v"], &SMALL[..], more].concat()).stderr
    };
    assert!(!said(&["--deform", "never"]).contains("deformed"));
    assert!(said(&["--deform", "always"]).contains("pass 2.1: deformed"));
    assert!(!said(&["--repeats", "2"]).contains("pass 2.3"));
    for (option, value) in [("--deform", "sometimes"), ("--repeats", "0"), ("--repeats", "101")] {
        bench.refused(&["a.lfv", "b.lfv", "-o", "g.exr", "-q", &format!("{option}={value}")], &[&option[2..]]);
    }
    let wide = ["--pass", "8,8,8:0.9:40,40,24"];
    bench.refused(&[&["a.lfv", "b.lfv", "-o", "g.exr", "-q"], &wide[..]].concat(), &["GB", "less overlap"]);
}
