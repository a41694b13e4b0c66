//! Errors of vectors on clouds of Gaussian particles with a known displacement.

use crate::scene;
use lf_core::{Field, field::MEASURED};
use lf_xcorr::{Options, Outcome, correlate};

/// Bias and RMS error of u, v, w over the measured vectors, voxels (the grids here have voxels of 1 mm).
fn error(field: &Field, truth: impl Fn([f64; 3]) -> [f64; 3]) -> [[f64; 2]; 3] {
    let measured: Vec<usize> = (0..field.len()).filter(|&i| field.flag[i] == MEASURED).collect();
    let components = [&field.u, &field.v, &field.w];
    std::array::from_fn(|a| {
        let errors = measured.iter().map(|&i| components[a][i] as f64 - truth(field.place_mm(i))[a]);
        let (sum, squares) = errors.fold((0.0, 0.0), |(sum, squares), e| (sum + e, squares + e * e));
        let n = measured.len() as f64;
        [sum / n, (squares / n).sqrt()]
    })
}

fn report(name: &str, outcome: &Outcome, error: [[f64; 2]; 3], seconds: f64) {
    let last = outcome.passes.last().unwrap().counts();
    println!(
        "{name}: bias {:+.4} {:+.4} {:+.4} RMS {:.4} {:.4} {:.4} voxel; {} vectors, {} outliers, {} outside, \
         {} recovered, {} replaced; {seconds:.2} s",
        error[0][0],
        error[1][0],
        error[2][0],
        error[0][1],
        error[1][1],
        error[2][1],
        outcome.field.len(),
        last.outliers,
        last.outside,
        last.recovered,
        last.replaced
    );
}

fn uniform(name: &str, sigma_vox: [f64; 3]) -> ([[f64; 2]; 3], Outcome) {
    let shift = [2.3, -1.6, 0.7];
    let [a, b] = scene::pair(&scene::grid([128; 3]), 8.0 / 32f64.powi(3), sigma_vox, 1, |_| shift);
    let options = Options::coarse_to_fine([64; 3], [32; 3], 0.75, [8; 3], Options::REFINE);
    let started = std::time::Instant::now();
    let outcome = correlate(&a.sparse(), &b.sparse(), &options).unwrap();
    let found = error(&outcome.field, |_| shift);
    report(name, &outcome, found, started.elapsed().as_secs_f64());
    (found, outcome)
}

#[test]
fn round_particles_are_measured_without_bias() {
    let (error, outcome) = uniform("round", [0.75; 3]);
    error.iter().for_each(|[bias, rms]| assert!(bias.abs() < 0.0016 && *rms < 0.0022, "{error:?}"));
    assert_eq!(outcome.field.len(), 13 * 13 * 13);
    assert_eq!(outcome.passes[1].counts().replaced + outcome.passes[1].counts().no_data, 0);
}

// Scar: normalised by the energy of one window, w came out 0.1 voxel short.
#[test]
fn particles_long_along_z_are_measured_without_bias() {
    let (error, outcome) = uniform("long", [0.75, 0.75, 4.0]);
    error[..2].iter().for_each(|[bias, rms]| assert!(bias.abs() < 0.0014 && *rms < 0.0022, "{error:?}"));
    assert!(error[2][0].abs() < 0.0005 && error[2][1] < 0.0034, "{error:?}");
    assert_eq!(outcome.passes[1].counts().replaced + outcome.passes[1].counts().no_data, 0);
}

/// Both windows move, so a rotation is not measured as a contraction: the radial part stays small.
#[test]
fn rotation_is_measured_at_the_midpoint() {
    let rate = 0.04;
    let truth = |p: [f64; 3]| [-rate * (p[1] - 63.5), rate * (p[0] - 63.5), 0.0];
    let [a, b] = scene::pair(&scene::grid([128, 128, 48]), 12.0 / 32f64.powi(3), [0.75; 3], 2, truth);
    let options = Options::coarse_to_fine([64, 64, 48], [32; 3], 0.75, [8; 3], Options::REFINE);
    let outcome = correlate(&a.sparse(), &b.sparse(), &options).unwrap();
    let found = error(&outcome.field, truth);
    report("rotation", &outcome, found, 0.0);
    found.iter().for_each(|[bias, rms]| assert!(bias.abs() < 0.0004 && *rms < 0.0042, "{found:?}"));
}

/// A displacement far beyond the finest search is found by the binned first pass.
#[test]
fn a_large_displacement_is_found_through_bins() {
    let shift = [25.4, -17.8, 3.2];
    let [a, b] = scene::pair(&scene::grid([192, 192, 64]), 8.0 / 32f64.powi(3), [0.9; 3], 3, |_| shift);
    let options = Options::coarse_to_fine([96, 96, 64], [48, 48, 32], 0.75, [40, 40, 8], Options::REFINE);
    let outcome = correlate(&a.sparse(), &b.sparse(), &options).unwrap();
    assert_eq!(outcome.passes[0].bin, [5, 5, 2]);
    let found = error(&outcome.field, |_| shift);
    report("large", &outcome, found, 0.0);
    found.iter().for_each(|[bias, rms]| assert!(bias.abs() < 0.001 && *rms < 0.0012, "{found:?}"));
}
