//! Rates of projection and back-projection, in weights a second: `cargo bench -p lf-mart`. `-- WORDS` takes only the
//! rows that have these words.
//!
//! Compared with a stored matrix (compressed sparse rows, one by pixel to project, one by voxel to project back) and
//! with the machine's memory. 60 x 60 lenslets, 8000 particles of 3 x 3 x 9 voxels of 1 x 1 x 10 px. Medians of seven
//! runs.

use lf_core::simd::Level;
use lf_core::weights::{Basis, Model, Scratch};
use lf_core::{Camera, Grid, Weights};
use lf_mart::projector::Projector;
use ndarray::Array2;
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

const PARTICLES: u64 = 8000;
const RUNS: usize = 7;

fn camera(aperture: &str, layout: &str, rotation: f64) -> Camera {
    let text = format!(
        r#"{{"sensor": {{"width": 840, "height": 840, "pixel_pitch_mm": 0.0055}},
        "main_lens": {{"focal_length_mm": 200, "magnification": 1, "working_f_number": 4, "aperture": "{aperture}"}},
        "microlenses": {{"layout": "{layout}", "pitch_mm": 0.077, "focal_length_mm": 0.308,
        "rotation_rad": {rotation}, "offset_mm": [0, 0]}}}}"#
    );
    Camera::from_json(&text).expect("a camera")
}

/// Every tenth voxel of the particles.
fn voxels(grid: &Grid) -> Vec<u64> {
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as usize) % below
    };
    let [nx, ny, nz] = grid.shape;
    let mut all = Vec::new();
    for _ in 0..PARTICLES {
        let [x, y, z] = [random(nx - 2), random(ny - 2), random(nz - 8)];
        all.extend((0..81).map(|n| grid.index([x + n % 3, y + n / 3 % 3, z + n / 9])));
    }
    all.sort_unstable();
    all.dedup();
    all.into_iter().step_by(10).collect()
}

/// Median seconds of a piece of work.
fn seconds(mut work: impl FnMut()) -> f64 {
    let mut all: Vec<f64> = (0..RUNS)
        .map(|_| {
            let began = Instant::now();
            work();
            began.elapsed().as_secs_f64()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all[RUNS / 2]
}

/// Rows of a sparse matrix: (column, weight).
struct SparseMatrix {
    starts: Vec<usize>,
    weights: Vec<(u32, f32)>,
}

impl SparseMatrix {
    fn new(rows: usize, entries: impl Iterator<Item = (u32, u32, f32)> + Clone) -> Self {
        let mut starts = vec![0; rows + 1];
        for (row, _, _) in entries.clone() {
            starts[row as usize + 1] += 1;
        }
        for row in 0..rows {
            starts[row + 1] += starts[row];
        }
        let mut next = starts.clone();
        let mut weights = vec![(0, 0.0); starts[rows]];
        for (row, column, weight) in entries {
            weights[next[row as usize]] = (column, weight);
            next[row as usize] += 1;
        }
        Self { starts, weights }
    }

    fn times(&self, vector: &[f32]) -> Vec<f32> {
        let product = |row: usize| {
            let row = &self.weights[self.starts[row]..self.starts[row + 1]];
            row.iter().map(|(column, weight)| weight * vector[*column as usize]).sum()
        };
        (0..self.starts.len() - 1).into_par_iter().with_min_len(256).map(product).collect()
    }
}

fn main() {
    // `cargo test --benches` only asks whether it starts.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let words = std::env::args().skip(1).find(|word| !word.starts_with("--")).unwrap_or_default();
    let grid = Grid::in_bounds([[-2.0, 2.0], [-2.0, 2.0], [-5.0, 5.0]], [0.0055, 0.0055, 0.055]).expect("a grid");
    let particles = voxels(&grid);
    let basis = Basis::Point;
    println!(
        "{:<44} {:>8} {:>14} {:>21} {:>21}",
        "million weights a second", "", "", "widest instructions", "portable"
    );
    println!(
        "{:<44} {:>8} {:>14} {:>10} {:>10} {:>10} {:>10}",
        "", "voxels", "weights/voxel", "forward", "back", "forward", "back"
    );
    // Particles are few voxels here and there. DensePhase is all voxels of a block, as in a first sweep.
    let dense = Grid::in_bounds([[-0.25, 0.25], [-0.25, 0.25], [-5.0, 5.0]], [0.011, 0.011, 0.055]).expect("a grid");
    let block: Vec<u64> = (0..dense.len()).collect();
    for (name, aperture, layout, rotation) in [
        ("square stop, aligned", "square", "square", 0.0),
        ("round stop, aligned", "circle", "square", 0.0),
        ("square stop, square lattice turned", "square", "square", 0.003),
        ("round stop, hexagonal lattice turned", "circle", "hexagonal", 0.003),
    ] {
        let camera = camera(aperture, layout, rotation);
        for (kind, grid, voxels, most_bytes) in [
            ("dense phase", &dense, &block, 0),
            ("particles", &grid, &particles, 0),
            ("kept", &grid, &particles, u64::MAX),
        ] {
            let name = format!("{name}, {kind}");
            if !name.contains(&words) {
                continue;
            }
            let rates = [Level::detect(), Level::Portable].map(|level| {
                Level::at_most(level);
                let choice = Weights::choose(&camera, grid, Model::Exact, basis).expect("weights");
                rates(&mut Projector::new(&choice, voxels, most_bytes), voxels.len())
            });
            Level::at_most(Level::Avx2Fma);
            row(&name, voxels.len(), rates[0].0, rates.map(|(_, rates)| rates).concat());
        }
    }
    stored(&grid, &particles);
    memory();
}

fn row(name: &str, voxels: usize, weights: f64, rates: Vec<f64>) {
    let rates: String = rates.iter().map(|rate| format!(" {rate:>10.0}")).collect();
    println!("{name:<44} {voxels:>8} {:>14.0}{rates}", weights / voxels as f64);
}

/// The number of weights, and how many of them a second go forward and back, in millions.
fn rates(projector: &mut Projector, voxels: usize) -> (f64, [f64; 2]) {
    let (strengths, image) = (vec![1.0; voxels], Array2::from_elem((840, 840), 1.0));
    let weights = projector.weights() as f64;
    let forward = seconds(|| {
        black_box(projector.project(&strengths));
    });
    // Two passes: one for the sums, one for the weights.
    let back = 0.5
        * seconds(|| {
            black_box(projector.back_project(image.view()));
        });
    (weights, [forward, back].map(|seconds| 1e-6 * weights / seconds))
}

/// Rates of a matrix of columns and weights, 8 bytes each.
fn stored(grid: &Grid, voxels: &[u64]) {
    let choice = Weights::choose(&camera("square", "square", 0.0), grid, Model::Exact, Basis::Point).expect("weights");
    let mut entries: Vec<(u32, u32, f32)> = Vec::new();
    let mut scratch = Scratch::default();
    for (n, index) in voxels.iter().enumerate() {
        let add = |column, row, weight| entries.push((row * 840 + column, n as u32, weight));
        choice.visit(grid.voxel(*index), &mut scratch, |_| true, add);
    }
    let by_pixel = SparseMatrix::new(840 * 840, entries.iter().copied());
    let by_voxel =
        SparseMatrix::new(voxels.len(), entries.iter().map(|(pixel, voxel, weight)| (*voxel, *pixel, *weight)));
    let (strengths, image) = (vec![1f32; voxels.len()], vec![1f32; 840 * 840]);
    let forward = seconds(|| {
        black_box(by_pixel.times(&strengths));
    });
    let back = seconds(|| {
        black_box(by_voxel.times(&image));
    });
    let weights = entries.len() as f64;
    let rates = [forward, back].map(|seconds| 1e-6 * weights / seconds);
    row("square stop, aligned, matrix of 8 bytes each", voxels.len(), weights, rates.to_vec());
}

/// The most that memory allows a stored matrix.
fn memory() {
    let big = vec![1u64; 1 << 26];
    let read = seconds(|| {
        black_box(
            big.par_chunks(1 << 16).map(|part| part.iter().fold(0u64, |sum, x| sum ^ x)).reduce(|| 0, |a, b| a ^ b),
        );
    });
    let rate = (8 * big.len()) as f64 / read;
    println!(
        "\nmemory reads {:.1} GB/s: no stored matrix of 8 bytes a weight can pass {:.0} million weights/s",
        1e-9 * rate,
        1e-6 * rate / 8.0
    );
}
