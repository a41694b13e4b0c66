//! The fraction of lit voxels from which on transforms are faster than direct sums, measured and estimated.
//!
//! Prints the time of one pass by direct sums over that by transforms, on one core over voxels lit at random. Cases
//! that would take longer than [`LONGEST_S`] are left out. `--quick` measures the small cases only.

use lf_core::Grid;
use lf_xcorr::{Pass, Sparse, one_pass};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::time::Instant;

const LIT: [f64; 4] = [0.001, 0.01, 0.1, 1.0];
const LONGEST_S: f64 = 4.0;

fn main() {
    let quick = std::env::args().any(|word| word == "--quick");
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    println!("direct sums over transforms, one core: measured (estimated); above 1 transforms are faster");
    println!("{:32}{}", "lit", LIT.map(|lit| format!("{:>18}", format!("{} %", 100.0 * lit))).concat());
    for (window, overlap, side) in
        [(16, 0.75, 36), (16, 0.0, 48), (32, 0.75, 64), (32, 0.0, 64), (64, 0.75, 96), (64, 0.0, 128)]
    {
        for radius in [4, 8, 16] {
            if quick && (window > 32 || radius > 8) {
                continue;
            }
            let pass = Pass { window: [window; 3], overlap, search: [radius; 3] };
            let mut last = [0.0; 2];
            let row = LIT.map(|lit| {
                let volumes = [1, 2].map(|seed| Volume::lit(seed, [side; 3], lit));
                let sparse = volumes.each_ref().map(Volume::sparse);
                let mut estimated = [0.0; 2];
                for path in 0..2 {
                    // Ten times the light makes up to a hundred times the products.
                    let factor = if path == 0 { 30.0 } else { 1.2 };
                    if last[path] * factor > 5.0 * LONGEST_S {
                        last[path] = f64::INFINITY;
                        continue;
                    }
                    (last[path], estimated) = one.install(|| fastest_of_three(sparse.each_ref(), &pass, path == 1));
                }
                let measured = last[0] / last[1];
                if measured.is_finite() {
                    format!("{:>18}", format!("{measured:.2} ({:.2})", estimated[0] / estimated[1]))
                } else {
                    format!("{:>18}", format!("- ({:.2})", estimated[0] / estimated[1]))
                }
            });
            println!("{:32}{}", format!("window {window}, overlap {overlap}, search {radius}"), row.concat());
        }
    }
}

/// Seconds of the fastest of three runs, and the estimate. Other work on the machine only adds time.
fn fastest_of_three(volumes: [&Sparse; 2], pass: &Pass, transform: bool) -> (f64, [f64; 2]) {
    let mut fastest = (f64::INFINITY, [0.0; 2]);
    for _ in 0..3 {
        let started = Instant::now();
        let (_, estimated) = std::hint::black_box(one_pass(volumes, pass, transform));
        fastest = (started.elapsed().as_secs_f64().min(fastest.0), estimated);
        if fastest.0 > 0.5 {
            break;
        }
    }
    fastest
}

/// Voxels lit at random.
struct Volume {
    grid: Grid,
    indices: Vec<u64>,
    intensity: Vec<f32>,
}

impl Volume {
    fn lit(seed: u64, shape: [usize; 3], share: f64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let grid = Grid { shape, spacing_mm: [1.0; 3], origin_mm: [0.0; 3] };
        let indices: Vec<u64> = (0..grid.len()).filter(|_| random.random::<f64>() < share).collect();
        let intensity = indices.iter().map(|_| random.random::<f32>() + 0.1).collect();
        Self { grid, indices, intensity }
    }

    fn sparse(&self) -> Sparse<'_> {
        Sparse { grid: &self.grid, indices: &self.indices, intensity: &self.intensity }
    }
}
