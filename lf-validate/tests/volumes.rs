//! The command line of the scores of volumes, and the pictures of every score.

use crate::workbench::{CAMERA, field, save_field, workbench};
use lf_core::Grid;
use lf_tests::Workbench;
use serde_json::{Value, json};
use std::fs;

fn small() -> Grid {
    Grid { shape: [4, 3, 2], spacing_mm: [0.1, 0.1, 1.0], origin_mm: [-0.15, -0.1, -0.5] }
}

/// A voxel is two pixels of [`CAMERA`] along x and y, ten along z.
fn large() -> Grid {
    Grid { shape: [21, 15, 15], spacing_mm: [0.022, 0.022, 0.11], origin_mm: [0.0; 3] }
}

fn save(bench: &Workbench, name: &str, grid: &Grid, lit: &[(u64, f32)]) {
    let (indices, values): (Vec<u64>, Vec<f32>) = lit.iter().copied().unzip();
    bench.volume(name, grid, &indices, &[("intensity", &values)]);
}

/// By hand: products 3 * 0 + 4 * 6 in the first slice, 2 * 1 in the second; squares 25 and 40, 4 and 1.
fn pair(bench: &Workbench) {
    save(bench, "truth.lfv", &small(), &[(1, 3.0), (5, 4.0), (13, 2.0)]);
    save(bench, "volume.lfv", &small(), &[(0, 2.0), (5, 6.0), (13, 1.0)]);
}

/// Writes Gaussians of standard deviation 0.75 voxels, cut at `reach` voxels.
fn blobs(bench: &Workbench, name: &str, centres: &[[f64; 3]], reach: f64) {
    let grid = large();
    let lit = |index: u64| {
        let voxel = grid.voxel(index).map(|n| n as f64);
        let light = |centre: &[f64; 3]| {
            let way = [0, 1, 2].map(|axis| voxel[axis] - centre[axis]);
            let is_near = way.iter().all(|step| step.abs() <= reach);
            let square: f64 = way.iter().map(|step| step * step).sum();
            if is_near { 100.0 * (-0.5 * square / (0.75 * 0.75)).exp() } else { 0.0 }
        };
        let sum: f64 = centres.iter().map(light).sum();
        (sum > 0.0).then_some((index, sum as f32))
    };
    save(bench, name, &grid, &(0..grid.len()).filter_map(lit).collect::<Vec<_>>());
}

/// Writes a table of particles: frame and place in voxels.
fn table(bench: &Workbench, name: &str, particles: &[(usize, [f64; 3])]) {
    let row = |(id, (frame, [x, y, z])): (usize, &(usize, [f64; 3]))| {
        format!("{frame},{id},{},{},{},1\n", x * 0.022, y * 0.022, z * 0.11)
    };
    let rows: String = particles.iter().enumerate().map(row).collect();
    bench.write(name, format!("# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n{rows}"));
}

fn near(found: &Value, wanted: f64, slack: f64) {
    assert!(found.as_f64().is_some_and(|found| (found - wanted).abs() < slack), "{found}, wanted {wanted}");
}

fn all_near(found: &Value, wanted: &[Option<f64>]) {
    let found = found.as_array().unwrap();
    assert_eq!(found.len(), wanted.len(), "{found:?}");
    for (found, wanted) in found.iter().zip(wanted) {
        match wanted {
            Some(wanted) => near(found, *wanted, 1e-12),
            None => assert!(found.is_null(), "{found}"),
        }
    }
}

#[test]
fn quality_by_depth_and_region_by_hand() {
    let bench = workbench();
    pair(&bench);
    let words = ["quality", "truth.lfv", "volume.lfv"];
    let score = bench.run(&words).silent_json();
    let by_depth = &score["by_depth"];
    all_near(&by_depth["z_mm"], &[Some(-0.5), Some(0.5)]);
    all_near(&by_depth["q"], &[Some(24.0 / 1000f64.sqrt()), Some(1.0)]);
    all_near(&by_depth["scale"], &[Some(0.6), Some(2.0)]);
    all_near(&by_depth["ghost_share"], &[Some(0.25), Some(0.0)]);
    all_near(&by_depth["missed_share"], &[Some(3.0 / 7.0), Some(0.0)]);
    all_near(&by_depth["truth_sum"], &[Some(7.0), Some(2.0)]);
    all_near(&by_depth["volume_sum"], &[Some(8.0), Some(1.0)]);
    // Three boxes on each side, or one for each voxel if there are fewer. Most are dark.
    assert_eq!(score["by_region"]["shape"], json!([3, 3, 2]));
    assert_eq!(score["by_region"]["q"].as_array().unwrap().len(), 18);

    let halves = bench.run(&[&words[..], &["--regions", "2,1,2"]].concat()).silent_json();
    let by_region = &halves["by_region"];
    assert_eq!(by_region["shape"], json!([2, 1, 2]));
    all_near(&by_region["centre_mm"][3], &[Some(0.1), Some(0.0), Some(0.5)]);
    // All light is at the left.
    all_near(&by_region["q"], &[Some(24.0 / 1000f64.sqrt()), None, Some(1.0), None]);
    all_near(&by_region["ghost_share"], &[Some(0.25), None, Some(0.0), None]);
    assert_eq!(halves["by_depth"], score["by_depth"]);
    for (typed, wanted) in [
        ("5,1,1", "at least a voxel"),
        ("0,1,1", "--regions"),
        ("1.5,1,1", "3 whole numbers"),
        ("-1,1,1", "--regions"),
        ("2,2", "--regions"),
    ] {
        let text = bench.run(&[&words[..], &[&format!("--regions={typed}")]].concat()).refusal();
        assert!(text.contains(wanted), "{typed}: {text}");
    }
}

/// 2 of 9 are ghosts and 3 of 9 are missed.
#[test]
fn limits_on_ghosts_and_missed_light() {
    let bench = workbench();
    pair(&bench);
    save(&bench, "dark.lfv", &small(), &[]);
    for (limits, code) in [
        (&["--max-ghosts", "0.23"][..], 0),
        (&["--max-ghosts", "0.22"], 1),
        (&["--max-missed", "0.34"], 0),
        (&["--max-missed", "0.33"], 1),
        (&["--max-ghosts", "1", "--max-missed", "1", "--min-q", "0"], 0),
        (&["--max-ghosts", "1", "--max-missed", "1", "--min-q", "1"], 1),
    ] {
        let output = bench.run(&[&["quality", "truth.lfv", "volume.lfv"], limits].concat());
        assert_eq!((output.status.code(), output.stderr.len()), (Some(code), 0), "{limits:?}");
        assert!(!output.stdout.is_empty());
    }
    // A share of no light exceeds every limit.
    for (words, option, code) in [
        (["truth.lfv", "dark.lfv"], "--max-ghosts", 1),
        (["truth.lfv", "dark.lfv"], "--max-missed", 0),
        (["dark.lfv", "volume.lfv"], "--max-missed", 1),
        (["dark.lfv", "volume.lfv"], "--max-ghosts", 0),
    ] {
        let output = bench.run(&[&["quality"], &words[..], &[option, "1"]].concat());
        assert_eq!(output.status.code(), Some(code), "{words:?} {option}");
        assert!(output.stderr.contains("dark.lfv: every voxel is dark"));
    }
    bench.run(&["quality", "truth.lfv", "volume.lfv", "--max-ghosts", "NaN"]).refusal();
    bench.run(&["quality", "truth.lfv", "volume.lfv", "--max-missed", "few"]).refusal();
}

/// A Gaussian of 0.75 voxels is 4 * 0.75 voxels wide at exp(-2) and 0.75 sqrt(8 ln 2) at half maximum, at any place.
#[test]
fn elongation_by_hand_in_every_unit() {
    let bench = workbench();
    let centres = [[5.0, 7.0, 7.0], [14.3, 6.8, 7.4]];
    blobs(&bench, "volume.lfv", &centres, 9.0);
    table(&bench, "particles.csv", &[(0, centres[0]), (0, centres[1]), (3, [9.0, 7.0, 7.0])]);
    bench.write("camera.json", CAMERA);
    let words = ["elongation", "particles.csv", "volume.lfv"];
    let bare = bench.run(&words).silent_json();
    let score = bench.run(&[&words[..], &["-c", "camera.json"]].concat()).silent_json();
    assert_eq!((&score["particles"], &score["measured"]), (&json!(2), &json!(2)));
    for (axis, voxel_mm, voxel_px) in [("x", 0.022, 2.0), ("y", 0.022, 2.0), ("z", 0.11, 10.0)] {
        for name in ["median", "p10", "p90"] {
            for (unit, voxel) in [("vox", 1.0), ("mm", voxel_mm), ("px", voxel_px)] {
                let key = format!("{name}_{axis}_{unit}");
                near(&score["diameter"][&key], 3.0 * voxel, 1e-3 * voxel);
                near(&score["half_maximum"][&key], 0.75 * (8.0 * 2f64.ln()).sqrt() * voxel, 1e-3 * voxel);
                assert_eq!(bare["diameter"].get(&key).is_some(), unit != "px", "{key}");
            }
        }
    }
    let particles: u64 = score["by_depth"]["particles"].as_array().unwrap().iter().filter_map(Value::as_u64).sum();
    assert_eq!((particles, score["by_depth"]["z_mm"].as_array().unwrap().len()), (2, 20));
    for (limit, code) in [("3.01,3.01,3.01", 0), ("2.99,9,9", 1), ("9,9,2.99", 1)] {
        let output = bench.run(&[&words[..], &["--max-diameter", limit]].concat());
        assert_eq!((output.status.code(), output.stdout.is_empty()), (Some(code), false), "{limit}");
    }
    let piped = bench.feed(&["elongation", "particles.csv"], bench.bytes("volume.lfv"));
    assert_eq!(piped.silent_json(), bare);
}

#[test]
fn elongation_takes_frames_pairs_and_a_search() {
    let bench = workbench();
    blobs(&bench, "volume.lfv", &[[5.0, 7.0, 7.0]], 2.0);
    blobs(&bench, "other.lfv", &[[14.0, 7.0, 7.0]], 2.0);
    // The particle of frame 0 is on the first blob, that of frame 3 on the second, that of frame 5 beside the first.
    table(&bench, "particles.csv", &[(0, [5.0, 7.0, 7.0]), (3, [14.0, 7.0, 7.0]), (5, [10.0, 7.0, 7.0])]);
    let counts = |words: &[&str]| {
        let score: Value = serde_json::from_slice(&bench.run(&[&["elongation"], words].concat()).stdout).unwrap();
        ["particles", "measured", "missed"].map(|key| score[key].as_u64().unwrap())
    };
    assert_eq!(counts(&["particles.csv", "volume.lfv"]), [1, 1, 0]);
    assert_eq!(counts(&["particles.csv", "other.lfv", "--frame", "3"]), [1, 1, 0]);
    assert_eq!(counts(&["particles.csv", "volume.lfv", "--frame", "3"]), [1, 0, 1]);
    assert_eq!(counts(&["particles.csv", "volume.lfv", "--frame", "5"]), [1, 0, 1]);
    assert_eq!(counts(&["particles.csv", "volume.lfv", "--frame", "5", "--search", "3,0,0"]), [1, 1, 0]);
    assert_eq!(counts(&["particles.csv", "volume.lfv", "--and", "particles.csv", "volume.lfv"]), [2, 2, 0]);
    assert_eq!(counts(&["particles.csv", "volume.lfv", "--and", "particles.csv", "other.lfv"]), [2, 1, 1]);
    let none = bench.run(&["elongation", "particles.csv", "other.lfv", "--max-diameter", "9,9,9"]);
    assert_eq!(none.status.code(), Some(1));
    assert!(none.stderr.contains("other.lfv: no particle could be measured: of 1, 1 missed"), "{none:?}");

    save(&bench, "small.lfv", &small(), &[(1, 3.0)]);
    bench.write("cut.csv", "frame,id,x_mm,y_mm,z_mm,intensity\n0,1,0\n");
    for (words, wanted) in [
        (&["particles.csv", "volume.lfv", "--frame", "7"][..], ["particles.csv", "no particle of frame 7 among 3"]),
        (
            &["particles.csv", "volume.lfv", "--and", "particles.csv", "small.lfv"],
            ["small.lfv", "first volume's grid of 21"],
        ),
        (&["particles.csv", "volume.lfv", "--and", "particles.csv"], ["--and", "2 values required"]),
        (&["particles.csv", "volume.lfv", "--search", "1,1"], ["--search", "3 whole numbers"]),
        (&["particles.csv", "volume.lfv", "--search", "1,1,0.5"], ["--search", "3 whole numbers"]),
        (&["cut.csv", "volume.lfv"], ["cut.csv", "line 2"]),
        (&["volume.lfv", "particles.csv"], ["volume.lfv", "wanted"]),
        (&["gone.csv", "volume.lfv"], ["gone.csv", "no such file"]),
        (&["-", "-"], ["standard input", "more than once"]),
    ] {
        let text = bench.run(&[&["elongation"], words].concat()).refusal();
        assert!(wanted.iter().all(|word| text.contains(word)), "{words:?}: {text}");
    }
}

/// By hand: slices of 7 and 2 in one volume, 8 and 1 in the other.
#[test]
fn depth_of_several_volumes_by_hand() {
    let bench = workbench();
    pair(&bench);
    let score = bench.run(&["depth", "truth.lfv", "volume.lfv", "--slab=-1,0"]).silent_json();
    assert_eq!((&score["volumes"], &score["slab_mm"]), (&json!(2), &json!([-1.0, 0.0])));
    all_near(&score["z_mm"], &[Some(-0.5), Some(0.5)]);
    all_near(&score["profile"], &[Some(7.5), Some(1.5)]);
    all_near(&score["peak"], &[Some(5.0), Some(1.5)]);
    near(&score["mean_z_mm"], -0.5 * 6.0 / 9.0, 1e-12);
    near(&score["outside_share"], 1.5 / 9.0, 1e-12);
    near(&score["outside_peak"], 0.2, 1e-12);
    near(&score["unevenness"], 0.0, 1e-12);
    let bare = bench.run(&["depth", "truth.lfv", "volume.lfv"]).silent_json();
    assert!(bare.get("outside_share").is_none() && bare.get("slab_mm").is_none());
    near(&bare["unevenness"], 3.0 / 4.5, 1e-12);
    let piped = bench.feed(&["depth"], bench.bytes("truth.lfv"));
    assert_eq!(piped.silent_json(), bench.run(&["depth", "truth.lfv"]).silent_json());
    for (most, code) in [("0.17", 0), ("0.16", 1)] {
        let output = bench.run(&["depth", "truth.lfv", "volume.lfv", "--slab=-1,0", "--max-outside", most]);
        assert_eq!((output.status.code(), output.stdout.is_empty()), (Some(code), false), "{most}");
    }
    // For a slab between two slices, all light is outside.
    let between = bench.run(&["depth", "truth.lfv", "--slab=-0.1,0.1", "--plot", "between.svg"]).silent_json();
    near(&between["outside_share"], 1.0, 1e-12);
    assert!(between["outside_peak"].is_null() && between["unevenness"].is_null());
    assert!(!bench.text("between.svg").contains("NaN"));
}

#[test]
fn depth_refuses_and_warns_in_one_line() {
    let bench = workbench();
    pair(&bench);
    save(&bench, "dark.lfv", &small(), &[(3, 0.0)]);
    save(&bench, "large.lfv", &large(), &[(3, 1.0)]);
    for (limit, code) in [(&[][..], 0), (&["--slab", "0,1", "--max-outside", "1"], 1)] {
        let output = bench.run(&[&["depth", "dark.lfv"], limit].concat());
        assert_eq!(output.status.code(), Some(code));
        assert_eq!(output.stderr, "lf-validate: warning: every voxel is dark\n");
        let score: Value = output.json();
        assert!(score["mean_z_mm"].is_null() && score["unevenness"].is_null() && score["light"] == 0.0);
    }
    assert_eq!(bench.run(&["depth", "dark.lfv", "--quiet"]).stderr, "");
    for (words, wanted) in [
        (&["truth.lfv", "--slab", "1,-1"][..], ["--slab: 1,-1", "lower depth first"]),
        (&["truth.lfv", "--slab", "1,1"], ["--slab", "lower depth first"]),
        (&["truth.lfv", "--slab", "1"], ["--slab", "2 numbers"]),
        (&["truth.lfv", "--max-outside", "0.1"], ["--slab", "required"]),
        (&["truth.lfv", "large.lfv"], ["large.lfv", "first volume's grid of 4 x 3 x 2"]),
        (&["truth.lfv", "gone.lfv"], ["gone.lfv", "no such file"]),
        (&["-", "-"], ["standard input", "more than once"]),
    ] {
        let text = bench.run(&[&["depth"], words].concat()).refusal();
        assert!(wanted.iter().all(|word| text.contains(word)), "{words:?}: {text}");
    }
}

/// A score, one of its inputs, a call that is refused, and the texts of its picture.
struct Drawn {
    words: &'static [&'static str],
    input: &'static str,
    refused: &'static [&'static str],
    texts: &'static [&'static str],
}

const DRAWN: [Drawn; 5] = [
    Drawn {
        words: &["quality", "truth.lfv", "volume.lfv"],
        input: "volume.lfv",
        refused: &["quality", "truth.lfv", "blobs.lfv"],
        texts: &["Quality of a reconstructed volume", "z, mm", "share of the slice", "sum of intensities, counts"],
    },
    Drawn {
        words: &["elongation", "particles.csv", "blobs.lfv"],
        input: "particles.csv",
        refused: &["elongation", "particles.csv", "blobs.lfv", "--frame", "9"],
        texts: &["Diameters of reconstructed particles", "diameter along z, voxels", "share of the particles", "z, mm"],
    },
    Drawn {
        words: &["depth", "truth.lfv", "volume.lfv", "--slab=-1,0"],
        input: "truth.lfv",
        refused: &["depth", "truth.lfv", "blobs.lfv"],
        texts: &["Light along the optical axis", "z, mm", "x, mm", "intensity, counts", "lit slab"],
    },
    Drawn {
        words: &["displacement", "truth.exr", "field.exr"],
        input: "field.exr",
        refused: &["displacement", "truth.exr", "truth.lfv"],
        texts: &[
            "Displacement errors against a true field",
            "error of w (measured - true), voxels",
            "density, 1 / voxels",
        ],
    },
    Drawn {
        words: &["divergence", "field.exr"],
        input: "field.exr",
        refused: &["divergence", "truth.lfv"],
        texts: &["Divergence of a measured field", "divergence (change of volume", "density"],
    },
];

#[test]
fn every_score_has_its_picture() {
    let bench = workbench();
    pair(&bench);
    blobs(&bench, "blobs.lfv", &[[5.0, 7.0, 7.0], [14.3, 6.8, 7.4]], 9.0);
    table(&bench, "particles.csv", &[(0, [5.0, 7.0, 7.0]), (0, [14.3, 6.8, 7.4])]);
    let waves = |[x, y, z]: [f64; 3]| [0.002 * (x * 5.0).sin(), 0.002 * y, 0.01 * (z * 7.0).cos()].map(|mm| mm as f32);
    for (name, mut field) in [("truth.exr", field([6, 6, 10], |_| [0.0; 3])), ("field.exr", field([6, 6, 10], waves))] {
        field.su.fill(0.01);
        save_field(&bench, name, &field);
    }
    for Drawn { words, input, refused, texts } in DRAWN {
        let with = |words: &[&'static str], file: &'static str| bench.run(&[words, &["--plot", file]].concat());
        let bare = bench.run(words);
        assert_eq!(with(words, "one.svg").silent_json(), bare.silent_json(), "{words:?}");
        let svg = bench.text("one.svg");
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{words:?}");
        // A text may be broken into lines.
        let plain: Vec<&str> = svg.lines().map(str::trim).filter(|line| !line.starts_with('<')).collect();
        let plain = plain.join(" ").replace("&apos;", "'");
        assert!(texts.iter().all(|text| plain.contains(text)), "{words:?}: {plain}");
        with(words, "two.svg");
        assert_eq!(bench.text("two.svg"), svg, "{words:?}");
        assert_eq!(with(&[words, &["--threads", "1"]].concat(), "two.svg").stdout, bare.stdout);
        assert_eq!(bench.text("two.svg"), svg, "{words:?}");

        let before = fs::read(bench.path(input)).unwrap();
        assert!(with(words, input).refusal().contains("is also an input"), "{words:?}");
        assert_eq!(fs::read(bench.path(input)).unwrap(), before, "{words:?}");
        assert!(with(words, "-").refusal().contains("--plot: -"), "{words:?}");
        assert!(with(words, "gone/picture.svg").refusal().contains("gone/picture.svg"), "{words:?}");
        // Without a score nothing is written, and an old picture stays.
        let listing = || {
            let files = fs::read_dir(bench.path("")).unwrap();
            let mut names: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let files = listing();
        with(refused, "three.svg").refusal();
        with(refused, "one.svg").refusal();
        assert_eq!((listing(), bench.text("one.svg")), (files, svg), "{words:?}");
        let stats = bench.run(&[words, &["--plot", "four.svg", "--stats", "four.svg"]].concat());
        assert!(stats.refusal().contains("--stats"), "{words:?}");
    }
}
