//! The speed of a pass over volumes of particles.

#[path = "../tests/scene/mod.rs"]
mod scene;

use divan::{Bencher, counter::ItemsCount};
use lf_xcorr::{Deform, Options, Pass, correlate};

fn main() {
    divan::main();
}

/// Vectors per second of one pass, for windows of a side in voxels.
#[divan::bench(args = [16, 24, 32], sample_count = 5)]
fn window(bencher: Bencher, side: usize) {
    measure(bencher, pass(side, 0.75, Options::REFINE), 8.0, 0.75, Deform::Never);
}

/// Like `window`, but with particles long along z.
#[divan::bench(args = [16, 24, 32], sample_count = 5)]
fn long_particles(bencher: Bencher, side: usize) {
    measure(bencher, pass(side, 0.75, Options::REFINE), 8.0, 4.0, Deform::Never);
}

/// Time against density: particles in 32^3 voxels.
#[divan::bench(args = [2, 8, 32, 128], sample_count = 5)]
fn density(bencher: Bencher, particles: usize) {
    measure(bencher, pass(32, 0.75, Options::REFINE), particles as f64, 0.75, Deform::Never);
}

/// Time against the search radius.
#[divan::bench(args = [2, 4, 8], sample_count = 5)]
fn search(bencher: Bencher, radius: usize) {
    measure(bencher, pass(32, 0.75, [radius; 3]), 8.0, 0.75, Deform::Never);
}

/// Repeats on deformed volumes.
#[divan::bench(sample_count = 5)]
fn deformed(bencher: Bencher) {
    measure(bencher, pass(32, 0.75, Options::REFINE), 8.0, 0.75, Deform::Auto);
}

/// Windows that share nothing, and a search of half a window, against density: particles in 32^3 voxels.
#[divan::bench(args = [2, 8, 32, 128], sample_count = 3)]
fn apart(bencher: Bencher, particles: usize) {
    measure(bencher, pass(32, 0.0, [16; 3]), particles as f64, 0.75, Deform::Never);
}

fn pass(side: usize, overlap: f64, search: [usize; 3]) -> Pass {
    Pass { window: [side; 3], overlap, search }
}

fn measure(bencher: Bencher, pass: Pass, particles: f64, sigma_z_vox: f64, deform: Deform) {
    let grid = scene::grid([128; 3]);
    let density = particles / 32f64.powi(3);
    let [a, b] = scene::pair(&grid, density, [0.75, 0.75, sigma_z_vox], 1, |_| [0.3, -0.6, 0.7]);
    let options = Options { deform, ..Options::new(vec![pass]) };
    let count = options.windows(grid.shape);
    bencher.counter(ItemsCount::new(count)).bench(|| correlate(&a.sparse(), &b.sparse(), &options));
}
