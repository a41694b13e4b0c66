//! The tool with two volumes to correlate.

use crate::scene;
use lf_core::Grid;
use lf_tests::Workbench;

/// Options that make a run short.
pub const SMALL: [&str; 4] = ["--window", "24,24,12", "--search", "6,6,4"];

/// The grid of the volumes.
pub fn grid() -> Grid {
    Grid { spacing_mm: [0.1, 0.1, 0.5], ..scene::grid([48, 40, 24]) }
}

/// The tool in a folder with two volumes, `a.lfv` and `b.lfv`.
pub fn workbench() -> Workbench {
    let bench = Workbench::new(env!("CARGO_BIN_EXE_lf-xcorr"));
    save_pair(&bench, ["a.lfv", "b.lfv"], 1);
    bench
}

/// Writes a pair of volumes of random particles, displaced by 0.13, -0.07 and 0.2 mm.
pub fn save_pair(bench: &Workbench, names: [&str; 2], seed: u64) {
    let volumes = scene::pair(&grid(), 10.0 / (24.0 * 24.0 * 12.0), [0.75; 3], seed, |_| [1.3, -0.7, 0.4]);
    for (name, volume) in names.iter().zip(&volumes) {
        bench.volume(name, &volume.grid, &volume.indices, &[("intensity", &volume.intensity)]);
    }
}
