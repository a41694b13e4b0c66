//! Matched particles decide the vectors.

use crate::coverage::Flow;
use crate::tracked::{Lab, errors};
use crate::workbench::{SMALL, workbench};
use glam::DVec3;
use lf_core::field::{MEASURED, NO_DATA, REPLACED};
use lf_core::history::Step;
use lf_core::particles::{self, CORRECTED, FRAME_LINE, HEADER};
use lf_core::{Field, Particle};
use lf_tests::Workbench;
use lf_xcorr::{Tracks, decide};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::json;
use std::collections::HashSet;

fn decided(lab: &Lab) -> (Tracks, Field, [Vec<Particle>; 2]) {
    let (field, tables) = (lab.field(), lab.tables());
    let tracks = decide(&field, &[[&tables[0], &tables[1]]], &|_| true).unwrap();
    (tracks, field, tables)
}

/// The correlation's w is off by 4 px near the focal plane. Uniform motion at 0.5 particles per lenslet must come to
/// 0.25 px, also there, and stated uncertainties must cover 68 % of the errors.
#[test]
fn particles_are_right_where_the_correlation_is_not() {
    let lab = Lab::new(Flow::Shear(0.0), 0.5, 11);
    let (tracks, field, _) = decided(&lab);
    let (before, after) = (errors(&lab, &field), errors(&lab, &tracks.field));
    assert!(before.near_px > 3.0 && after.rms_px[2] < 0.25, "{} {:?}", before.near_px, after.rms_px);
    assert!(after.near_px < 1.2 * after.beyond_px, "{} {}", after.near_px, after.beyond_px);
    assert!(after.rms_px[0] < 0.03 && after.rms_px[1] < 0.03, "{:?}", after.rms_px);
    assert!(after.covered.iter().all(|share| (0.63..0.75).contains(share)), "{:?}", after.covered);
    assert!(after.replaced < 0.03, "{}", after.replaced);
}

#[test]
fn gradients_are_followed() {
    for flow in [Flow::Jet(1.2, 3.0), Flow::Vortices(4.0, 3.0), Flow::Wave(6.0, 5.0)] {
        let lab = Lab::new(flow, 0.8, 12);
        let found = errors(&lab, &decided(&lab).0.field);
        assert!(found.rms_px.iter().all(|rms| *rms < 0.5), "{flow:?} {:?}", found.rms_px);
        let covered = found.covered.iter().sum::<f64>() / 3.0;
        assert!((0.6..0.8).contains(&covered), "{flow:?} {:?}", found.covered);
    }
}

/// The stated uncertainties are half or twice the true ones; the residuals show it.
#[test]
fn wrong_covariances_are_found_by_their_residuals() {
    for stated in [0.5, 2.0] {
        let lab = Lab { stated, ..Lab::new(Flow::Shear(0.0), 0.8, 13) };
        let (tracks, ..) = decided(&lab);
        let found = errors(&lab, &tracks.field);
        let covered = found.covered.iter().sum::<f64>() / 3.0;
        assert!((0.55..0.82).contains(&covered), "{stated}: {:?} {}", found.covered, tracks.report.misfit);
    }
}

#[test]
fn pairs_are_the_same_particles() {
    let (tracks, _, [a, b]) = decided(&Lab::new(Flow::Ring(0.8, 4.0), 0.7, 14));
    let numbers = |table: &[Particle]| -> HashSet<u64> { table.iter().map(|particle| particle.id).collect() };
    let both = numbers(&a).intersection(&numbers(&b)).count();
    let right = tracks.pairs.iter().filter(|pair| a[pair.particles[0]].id == b[pair.particles[1]].id).count();
    assert!(right as f64 > 0.98 * both as f64, "{right} of {both}");
    assert!(tracks.pairs.len() - right <= both / 200, "{} false", tracks.pairs.len() - right);
}

#[test]
fn windows_without_pairs_say_so() {
    let lab = Lab::new(Flow::Shear(0.0), 0.5, 15);
    let (mut field, tables) = (lab.field(), lab.tables());
    let dark = field.layout.index([3, 3, 20]);
    field.flag[dark] = NO_DATA;
    // No particle in a slab of 1.2 mm, and none at all beyond 3 mm.
    let kept = tables.map(|table| {
        let is_kept = |p: &Particle| (p.place_mm[2] + 2.5).abs() > 0.6 && p.place_mm[2] < 3.0;
        table.into_iter().filter(is_kept).collect::<Vec<_>>()
    });
    let found = decide(&field, &[[&kept[0], &kept[1]]], &|_| true).unwrap().field;
    let at = |z_mm: f64| {
        let near = |i: &usize| (found.place_mm(*i)[2] - z_mm).abs();
        (0..found.len()).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap()
    };
    // Neighbours reach the slab: replaced. Nothing reaches the end: the correlation's own vector.
    let (slab, end) = (at(-2.5), at(4.51));
    assert_eq!((found.flag[slab], found.count[slab]), (REPLACED, 0.0));
    assert!(found.sw[slab].is_nan() && (found.w[slab] - field.w[slab]).abs() > 1e-6);
    assert_eq!((found.flag[end], found.count[end], found.w[end]), (MEASURED, 0.0, field.w[end]));
    assert_eq!((found.flag[at(1.0)], found.flag[dark]), (MEASURED, MEASURED));
    assert!(found.count[at(1.0)] > 0.0);
}

/// Writes particles that move as those of the volumes do, and their places afterwards.
fn save_tables(bench: &Workbench) {
    let text = |frame: u8| {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut text = format!("{FRAME_LINE}\n{HEADER}\n");
        for id in 0..600 {
            let place = DVec3::new(4.7, 3.9, 11.5) * DVec3::from_array([(); 3].map(|()| random.random::<f64>()));
            let [x, y, z] = (place + frame as f64 * DVec3::new(0.13, -0.07, 0.2)).to_array();
            text += &format!("{frame},{id},{x},{y},{z},100\n");
        }
        text
    };
    std::fs::write(bench.path("a.csv"), text(0)).unwrap();
    std::fs::write(bench.path("b.csv"), text(1)).unwrap();
}

#[test]
fn tables_decide_the_field_and_leave_tracks() {
    let bench = workbench();
    save_tables(&bench);
    let run = |more: &[&str]| bench.done(&[&["a.lfv", "b.lfv"], more, &SMALL[..]].concat()).stderr;
    run(&["-o", "plain.exr"]);
    let with = ["--particles", "a.csv", "b.csv", "--tracks", "t.csv", "-o"];
    let said = run(&[&with[..], &["one.exr", "--threads", "1", "--stats", "s.json"]].concat());
    assert!(said.contains("no uncertainties") && said.lines().count() == 1, "{said}");
    run(&[&with[..], &["four.exr", "--threads", "4"]].concat());
    let [plain, one, four] = ["plain.exr", "one.exr", "four.exr"].map(|name| Field::open(&bench.path(name)).unwrap());
    assert!(one.w == four.w && one.su == four.su && one.w != plain.w);
    for i in (0..one.len()).filter(|&i| one.flag[i] == MEASURED) {
        let error = one.displacement_mm(i) - DVec3::new(0.13, -0.07, 0.2);
        assert!(error.abs().max_element() < 4e-8, "{error}");
    }
    let tracks = particles::read(&bench.text("t.csv")).unwrap();
    let [first, second] = [0, 1].map(|frame| tracks.iter().filter(|track| track.frame == frame).count());
    assert!(first == second && first > 550, "{first} {second}");
    assert!(bench.text("s.json").contains("particle_pairs"));
}

/// Scar: lf-fit corrected the camera by 5.9 px for one frame and by 5.4 for the next, and w was wrong by 0.2 um in all.
#[test]
fn cameras_that_fits_corrected_differently_are_said() {
    let bench = workbench();
    save_tables(&bench);
    let said = |corrections: [&str; 2], cameras: [&str; 2]| {
        let tables = ["a", "b"].iter().zip(corrections).zip(cameras);
        let files = tables.map(|((name, corrected), camera)| {
            let step = Step { tool: "lf-fit".into(), version: "1".into(), arguments: vec!["-c".into(), camera.into()] };
            let lines = format!("# {}\n# {CORRECTED} {corrected}\n", json!(step));
            let file = format!("{name}-fit.csv");
            let text = bench.text(format!("{name}.csv")).replacen('\n', &format!("\n{lines}"), 1);
            std::fs::write(bench.path(&file), text).unwrap();
            file
        });
        let files: Vec<String> = files.collect();
        bench.done(&["--particles", &files[0], &files[1], "-o", "f.exr"]).stderr.contains("corrected their camera")
    };
    let [one, near, other] = [5.949, 6.01, 5.421].map(|px| format!("{{\"spherical_px\": [{px}, 0.046]}}"));
    assert!(said([&one, &other], ["c.json", "c.json"]) && said(["{}", &other], ["c.json", "c.json"]));
    assert!(!said([&one, &near], ["c.json", "c.json"]) && !said([&one, "{}"], ["c.json", "corrected.json"]));
}

/// Without volumes, and with the columns of another program: 0.2 mm along z for particles about 0.8 mm apart.
#[test]
fn tables_alone_make_a_field() {
    let bench = workbench();
    save_tables(&bench);
    for name in ["a", "b"] {
        let table = particles::read(&bench.text(format!("{name}.csv"))).unwrap();
        let row = |particle: &Particle| {
            let [x, y, z] = particle.place_mm;
            format!("{z},{},{y}\n", 1e3 * x)
        };
        let rows: String = table.iter().map(row).collect();
        let text = format!("{FRAME_LINE}\nz_mm,x_um,y_mm\n{rows}");
        std::fs::write(bench.path(format!("{name}-own.csv")), text).unwrap();
    }
    bench.done(&["--particles", "a-own.csv", "b-own.csv", "-o", "own.exr", "--tracks", "t.csv"]);
    let field = Field::open(&bench.path("own.exr")).unwrap();
    let measured: Vec<usize> = (0..field.len()).filter(|&i| field.flag[i] == MEASURED).collect();
    assert!(measured.len() * 10 > field.len() * 9, "{} of {}", measured.len(), field.len());
    for i in measured {
        let error = field.displacement_mm(i) - DVec3::new(0.13, -0.07, 0.2);
        assert!(error.abs().max_element() < 1e-7, "{error}");
    }
    let single = format!("{FRAME_LINE}\nx_mm,y_mm,z_mm\n1,1,1\n");
    std::fs::write(bench.path("one.csv"), single).unwrap();
    bench
        .refused(&["--particles", "one.csv", "one.csv", "-o", "f.exr", "-q"], &["one.csv", "too few or too far apart"]);
    bench.refused(&["a.lfv", "--particles", "a.csv", "b.csv", "-o", "f.exr", "-q"], &["1 volumes; wanted two"]);
}

#[test]
fn tables_without_a_common_particle_leave_the_correlation() {
    let bench = workbench();
    save_tables(&bench);
    std::fs::write(bench.path("far.csv"), format!("{FRAME_LINE}\n{HEADER}\n1,0,500,500,500,1\n")).unwrap();
    bench.run(&[&["a.lfv", "b.lfv", "-o", "plain.exr", "-q"], &SMALL[..]].concat());
    let far = ["a.lfv", "b.lfv", "-o", "far.exr", "--particles", "a.csv", "far.csv", "--tracks", "t.csv"];
    let run = bench.run(&[&far[..], &SMALL[..]].concat());
    let line = "a.csv, far.csv: no particle of 600 is one of 1 by its place";
    assert!(run.stderr.contains(line) && run.stderr.contains("by correlation alone"), "{}", run.stderr);
    let [plain, far] = ["plain.exr", "far.exr"].map(|file| Field::open(&bench.path(file)).unwrap());
    assert_eq!([&plain.u, &plain.v, &plain.w], [&far.u, &far.v, &far.w]);
    assert_eq!(
        std::fs::read_to_string(bench.path("t.csv")).unwrap().lines().filter(|l| !l.starts_with('#')).count(),
        1
    );
}

#[test]
fn bad_tables_get_one_line() {
    let bench = workbench();
    save_tables(&bench);
    let write =
        |name: &str, rows: &str| std::fs::write(bench.path(name), format!("{FRAME_LINE}\n{HEADER}\n{rows}")).unwrap();
    write("empty.csv", "");
    write("two.csv", "0,0,1,1,1,1\n1,0,1,1,1,1\n");
    write("bad.csv", "0,0,1,1,x,1\n");
    let small = |more: &[&'static str]| [&["a.lfv", "b.lfv", "-o", "f.exr", "-q"], more, &SMALL[..]].concat();
    bench.refused(&small(&["--particles", "a.csv", "empty.csv"]), &["empty.csv: no particle; wanted"]);
    bench.refused(&small(&["--particles", "two.csv", "b.csv"]), &["two.csv: particles of frames 0 and 1"]);
    bench.refused(&small(&["--particles", "a.csv", "bad.csv"]), &["bad.csv: line 3 is not 6 numbers"]);
    bench
        .refused(&small(&["--particles", "a.csv", "b.csv", "--particles", "a.csv", "b.csv"]), &["4 tables for 1 pair"]);
    bench.refused(&small(&["--particles", "a.csv", "b.csv", "--tracks", "b.csv"]), &["b.csv", "input"]);
    bench.refused(&small(&["--particles", "a.csv", "b.csv", "--tracks", "f.exr"]), &["--tracks"]);
    bench.refused(&small(&["--tracks", "t.csv"]), &["--particles"]);
    assert!(!bench.path("f.exr").exists() && !bench.path("t.csv").exists(), "no half file");
}
