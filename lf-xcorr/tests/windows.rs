//! Windows that are chosen from the particles, and warnings about windows, frames and searches.

use crate::scene::{self, Volume};
use crate::workbench::{SMALL, save_pair, workbench};
use lf_core::statistics::upper_median;
use lf_core::{Field, Grid};
use lf_tests::Workbench;

/// The voxels of the clouds.
const SPACING_MM: [f64; 3] = [0.1, 0.1, 0.2];

fn field(bench: &Workbench, name: &str) -> Field {
    Field::open(&bench.path(name)).unwrap()
}

/// A pair of clouds with `density` particles in a cubic mm, voxels of 0.1 x 0.1 x 0.2 mm.
fn save_cloud(bench: &Workbench, names: [&str; 2], density: f64, shift_vox: [f64; 3], seeds: [u64; 2]) {
    let grid = Grid { spacing_mm: SPACING_MM, ..scene::grid([72, 72, 48]) };
    let pair = |seed| scene::pair(&grid, density * SPACING_MM.iter().product::<f64>(), [0.8; 3], seed, |_| shift_vox);
    let [[a, _], [_, b]] = seeds.map(pair);
    for (name, volume) in names.iter().zip([&a, &b]) {
        save(bench, name, volume);
    }
}

fn save(bench: &Workbench, name: &str, volume: &Volume) {
    bench.volume(name, &volume.grid, &volume.indices, &[("intensity", &volume.intensity)]);
}

/// The warnings of a run.
fn warnings(bench: &Workbench, arguments: &[&str]) -> Vec<String> {
    let said = bench.done(&[arguments, &["-o", "f.exr"]].concat()).stderr;
    said.lines().filter_map(|line| Some(line.strip_prefix("lf-xcorr: warning: ")?.to_owned())).collect()
}

#[test]
fn the_median_window_holds_ten_particles_in_a_cube() {
    let bench = workbench();
    for (density, seed) in [(0.4, 1), (1.5, 2)] {
        save_cloud(&bench, ["a.lfv", "b.lfv"], density, [1.3, -0.7, 0.4], [seed, seed]);
        let said = bench.done(&["a.lfv", "b.lfv", "-o", "chosen.exr"]).stderr;
        let chosen = field(&bench, "chosen.exr");
        let sides_mm = [0, 1, 2].map(|axis| chosen.layout.window[axis] as f64 * SPACING_MM[axis]);
        let wanted_mm = (10.0 / density).cbrt();
        // Seven particles in a hundred are hidden by others or cut at the sides.
        sides_mm.iter().for_each(|side| assert!((side / wanted_mm - 1.0).abs() < 0.2, "{sides_mm:?} {wanted_mm}"));
        let count = upper_median(&mut chosen.count.clone()).unwrap();
        assert!((8.0..13.0).contains(&count), "{count}");
        assert_eq!(said.lines().count(), 1, "no warning: {said}");

        // The line names the option that chooses the same windows again.
        let (_, option) = said.trim_end().trim_end_matches(')').split_once("(--window-mm ").unwrap();
        bench.done(&["a.lfv", "b.lfv", "-o", "typed.exr", "--window-mm", option]);
        assert!(bench.bytes("chosen.exr") == bench.bytes("typed.exr"), "{option}");
        // So does the estimate.
        let estimate = bench.done("a.lfv b.lfv --estimate -q").json();
        let sides: Vec<f64> = option.split(',').map(|side| side.parse().unwrap()).collect();
        assert_eq!(
            estimate["window_mm"].as_array().unwrap().iter().filter_map(|side| side.as_f64()).collect::<Vec<_>>(),
            sides
        );
    }
}

#[test]
fn windows_too_small_and_windows_far_from_cubes_are_warned_of() {
    let bench = workbench();
    save_cloud(&bench, ["a.lfv", "b.lfv"], 1.0, [1.3, -0.7, 0.4], [3, 3]);
    let said = warnings(&bench, &["a.lfv", "b.lfv", "--window", "12,12,6", "--overlap", "0.5"]);
    let few = said.iter().find(|line| line.contains("too few")).unwrap();
    assert!(few.starts_with("the median window of 12 x 12 x 6 voxels (1.2 x 1.2 x 1.2 mm) holds "), "{few}");
    // The remedy holds.
    let (_, option) = few.split_once("--window-mm ").unwrap();
    let said = warnings(&bench, &["a.lfv", "b.lfv", "--window-mm", option.split(' ').next().unwrap()]);
    assert_eq!(said, [""; 0]);
    let count = upper_median(&mut field(&bench, "f.exr").count.clone()).unwrap();
    assert!((6.0..16.0).contains(&count), "{count}");

    let said = warnings(&bench, &["a.lfv", "b.lfv", "--window", "16,16,40", "--overlap", "0.5"]);
    let wanted = "windows of 16 x 16 x 40 voxels (1.6 x 1.6 x 8 mm) are 5.0 times as long one way as another";
    assert!(said.len() == 1 && said[0].starts_with(wanted) && said[0].contains("--window-mm 2.7"), "{said:?}");
}

#[test]
fn a_volume_with_itself_and_frames_in_the_wrong_order_are_warned_of() {
    let bench = workbench();
    let run = |pair: [&'static str; 2]| warnings(&bench, &[&pair[..], &SMALL[..]].concat());
    save_pair(&bench, ["f-0001.lfv", "f-0002.lfv"], 5);
    assert_eq!(run(["f-0001.lfv", "f-0002.lfv"]), [""; 0]);
    let said = run(["f-0002.lfv", "f-0001.lfv"]);
    assert!(said.len() == 1 && said[0].contains("f-0002.lfv seems to be later than f-0001.lfv"), "{said:?}");
    let said = run(["f-0001.lfv", "f-0001.lfv"]);
    assert!(said.len() == 1 && said[0].contains("hold the same light"), "{said:?}");
}

#[test]
fn a_search_that_is_too_short_and_volumes_that_do_not_agree_have_their_own_warnings() {
    let bench = workbench();
    save_cloud(&bench, ["a.lfv", "b.lfv"], 1.5, [4.6, -0.7, 0.4], [7, 7]);
    let short = ["a.lfv", "b.lfv", "--window", "24,24,12", "--overlap", "0.5", "--search"];
    let said = warnings(&bench, &[&short[..], &["6,6,4"]].concat());
    assert!(
        said.len() == 1 && said[0].contains("along x reach the end") && said[0].ends_with("--search 12,6,4"),
        "{said:?}"
    );
    assert_eq!(warnings(&bench, &[&short[..], &["12,6,4"]].concat()), [""; 0]);

    save_cloud(&bench, ["a.lfv", "other.lfv"], 1.5, [0.7, -0.7, 0.4], [7, 70]);
    let said =
        warnings(&bench, &["a.lfv", "other.lfv", "--window", "24,24,12", "--overlap", "0.5", "--search", "8,8,4"]);
    assert!(said.iter().any(|line| line.contains("the volumes agree little (mean correlation 0.")), "{said:?}");
    assert!(!said.iter().any(|line| line.contains("enlarge") || line.contains("try larger")), "{said:?}");
}
