//! How fast is a pass over volumes of the demo's kind: blobs in a haze, and blobs alone?

#[path = "../tests/scene/mod.rs"]
mod scene;

use divan::{Bencher, counter::ItemsCount};
use lf_xcorr::{Options, Pass, correlate, windows};

fn main() {
    divan::main();
}

/// Vectors per second of one fine pass, for windows of a side in voxels.
#[divan::bench(args = [16, 24, 32], sample_count = 5)]
fn fine_pass(bencher: Bencher, side: usize) {
    measure(bencher, Pass { window: [side; 3], overlap: 0.75, search: Options::REFINE }, 8.0, 0.75);
}

/// The same with particles long along z.
#[divan::bench(args = [16, 24, 32], sample_count = 5)]
fn long_particles(bencher: Bencher, side: usize) {
    measure(bencher, Pass { window: [side; 3], overlap: 0.75, search: Options::REFINE }, 8.0, 4.0);
}

/// Growth with density, particles in 32^3 voxels.
#[divan::bench(args = [2, 8, 32, 128], sample_count = 5)]
fn density(bencher: Bencher, particles: usize) {
    measure(bencher, Pass { window: [32; 3], overlap: 0.75, search: Options::REFINE }, particles as f64, 0.75);
}

/// Growth with the search radius.
#[divan::bench(args = [2, 4, 8], sample_count = 5)]
fn search(bencher: Bencher, radius: usize) {
    measure(bencher, Pass { window: [32; 3], overlap: 0.75, search: [radius; 3] }, 8.0, 0.75);
}

fn measure(bencher: Bencher, pass: Pass, particles: f64, sigma_z_vox: f64) {
    let grid = scene::grid([128; 3]);
    let density = particles / 32f64.powi(3);
    let [a, b] = scene::pair(&grid, density, [0.75, 0.75, sigma_z_vox], 1, |_| [0.3, -0.6, 0.7]);
    let options = Options { passes: vec![pass], floor: Options::FLOOR, median_test: Default::default() };
    let count = windows(grid.shape, &options);
    bencher.counter(ItemsCount::new(count)).bench(|| correlate(&a.sparse(), &b.sparse(), &options));
}
