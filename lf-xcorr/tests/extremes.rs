//! Extreme gains, sizes of particle images, densities, displacements and shapes.

use crate::scene::{self, Volume};
use lf_core::{Field, field::MEASURED};
use lf_xcorr::{Mask, Options, Pass, Plan, correlate};

const SHIFT: [f64; 3] = [1.3, -0.4, 0.6];

/// Largest bias and root mean square error of u, v, w, voxels, of vectors with a particle image in their window; and
/// the share of these vectors.
fn error(field: &Field) -> [f64; 3] {
    let measured: Vec<usize> =
        (0..field.len()).filter(|&i| field.flag[i] == MEASURED && field.count[i] > 0.0).collect();
    let components = [&field.u, &field.v, &field.w];
    let mut worst = [0f64; 2];
    for (values, shift) in components.iter().zip(SHIFT) {
        let errors = measured.iter().map(|&i| values[i] as f64 - shift);
        let (sum, squares) = errors.fold((0.0, 0.0), |(sum, squares), e| (sum + e, squares + e * e));
        worst[0] = worst[0].max((sum / measured.len() as f64).abs());
        worst[1] = worst[1].max((squares / measured.len() as f64).sqrt());
    }
    [worst[0], worst[1], measured.len() as f64 / field.len() as f64]
}

fn options() -> Options {
    Options::coarse_to_fine([48; 3], [32; 3], 0.75, [6; 3], [3; 3])
}

fn cloud(density: f64, sigma_vox: f64) -> [Volume; 2] {
    scene::pair(&scene::grid([64; 3]), density / 32f64.powi(3), [sigma_vox; 3], 1, |_| SHIFT)
}

fn field(a: &Volume, b: &Volume) -> Field {
    correlate(&a.sparse(), &b.sparse(), &options()).unwrap().field
}

/// Products of squares in f32 would under- and overflow here, and so would sums over bins at the last gains.
#[test]
fn any_gain_gives_the_same_field() {
    let [a, b] = cloud(10.0, 0.8);
    let usual = field(&a, &b);
    for [gain_a, gain_b] in [[1e-30f32, 1e-30], [1e30, 1e30], [1e-30, 1e30], [1e-36, 1e38]] {
        let scaled = |volume: &Volume, gain: f32| Volume {
            grid: volume.grid.clone(),
            indices: volume.indices.clone(),
            intensity: volume.intensity.iter().map(|value| value * gain).collect(),
        };
        let found = field(&scaled(&a, gain_a), &scaled(&b, gain_b));
        for i in 0..found.len() {
            assert_eq!(found.flag[i], usual.flag[i]);
            assert!((found.u[i] - usual.u[i]).abs() < 4e-7, "{} {}", found.u[i], usual.u[i]);
            let same = (found.su[i] - usual.su[i]).abs() < 1e-3 * usual.su[i] || usual.su[i].is_nan();
            assert!(same, "{} {}", found.su[i], usual.su[i]);
        }
    }
}

#[test]
fn small_and_large_particle_images_are_measured() {
    for (sigma_vox, bias, rms) in [(0.3, 0.1, 0.15), (0.5, 0.015, 0.03), (1.5, 0.0008, 0.0028), (4.0, 0.004, 0.012)] {
        let [a, b] = cloud(10.0, sigma_vox);
        let found = error(&field(&a, &b));
        assert!(found[0] < bias && found[1] < rms && found[2] > 0.95, "{sigma_vox}: {found:?}");
    }
}

#[test]
fn thousands_of_particles_in_a_window_are_measured() {
    for (density, bias, rms) in [(300.0, 0.0011, 0.0013), (3000.0, 0.0028, 0.006)] {
        let [a, b] = cloud(density, 0.8);
        let found = error(&field(&a, &b));
        assert!(found[0] < bias && found[1] < rms && found[2] > 0.99, "{density}: {found:?}");
    }
}

/// Windows that hold one particle, or a part of one at their edge. Most are right; the others are marked.
#[test]
fn one_particle_in_a_window_is_measured() {
    let [a, b] = cloud(1.0, 0.8);
    let field = field(&a, &b);
    let seen: Vec<usize> = (0..field.len()).filter(|&i| field.flag[i] == MEASURED && field.count[i] > 0.0).collect();
    let good = |i: &&usize| {
        let errors =
            [field.u[**i], field.v[**i], field.w[**i]].into_iter().zip(SHIFT).map(|(u, s)| (u as f64 - s).abs());
        errors.fold(0.0, f64::max) < 0.1
    };
    let count = seen.iter().filter(good).count();
    assert!(
        seen.len() * 2 > field.len() && count * 10 > seen.len() * 8,
        "{count} of {} of {}",
        seen.len(),
        field.len()
    );
    // A single particle gives no uncertainty.
    assert!(field.su.iter().filter(|s| s.is_nan()).count() * 2 > field.len());
}

/// Even light everywhere, a third of a particle's peak, hardly changes the vectors.
#[test]
fn an_even_ground_changes_little() {
    let [a, b] = cloud(10.0, 0.8);
    let grounded = |volume: &Volume| {
        let mut dense = vec![0.3f32; volume.grid.len() as usize];
        volume.indices.iter().zip(&volume.intensity).for_each(|(&i, value)| dense[i as usize] += value);
        Volume::from_dense(&volume.grid, &dense)
    };
    let (a, b) = (grounded(&a), grounded(&b));
    let found = error(&correlate(&a.sparse(), &b.sparse(), &options()).unwrap().field);
    assert!(found[0] < 0.025 && found[1] < 0.04 && found[2] > 0.95, "{found:?}");
}

/// A displacement of more than half a window is found by a search of that size.
#[test]
fn displacements_beyond_half_a_window_are_found() {
    let shift = [19.3, 0.0, -2.4];
    let [a, b] = scene::pair(&scene::grid([96, 48, 48]), 10.0 / 32f64.powi(3), [0.8; 3], 3, |_| shift);
    let pass = |window: usize, search: [usize; 3]| Pass { window: [window; 3], overlap: 0.5, search };
    let options = Options::new(vec![pass(32, [24, 4, 6]), pass(24, [3; 3])]);
    let field = correlate(&a.sparse(), &b.sparse(), &options).unwrap().field;
    let good = |i: &usize| (field.u[*i] - 19.3).abs() < 0.1 && (field.w[*i] + 2.4).abs() < 0.1;
    let count = (0..field.len()).filter(|&i| field.flag[i] == MEASURED).filter(good).count();
    assert!(count * 10 > field.len() * 8, "{count} of {}", field.len());
}

/// Scar: light that deformation moved out of a thin volume was taken for a lost field.
#[test]
fn thin_volumes_with_a_displacement_along_the_thin_axis_are_measured() {
    for (thick, w) in [(1, 0.0), (2, 0.5), (4, 1.2), (6, 2.0)] {
        let grid = scene::grid([64, 64, thick]);
        let [a, b] = scene::pair(&grid, 0.003, [0.8; 3], 4, |_| [1.3, -0.4, w]);
        let options =
            Options::coarse_to_fine([48, 48, thick], [32, 32, thick], 0.75, [4, 4, thick.min(4)], [3, 3, thick.min(3)]);
        let field = correlate(&a.sparse(), &b.sparse(), &options).unwrap().field;
        let measured: Vec<usize> = (0..field.len()).filter(|&i| field.flag[i] == MEASURED).collect();
        assert!(measured.len() * 10 > field.len() * 9, "{thick}: {} of {}", measured.len(), field.len());
        let rms =
            (measured.iter().map(|&i| (field.u[i] as f64 - 1.3).powi(2)).sum::<f64>() / measured.len() as f64).sqrt();
        assert!(rms < 0.026, "{thick}: {rms}");
        assert!(measured.iter().filter(|&&i| field.su[i].is_finite()).count() * 2 > measured.len(), "{thick}");
    }
}

/// Scar: the mean levels of two pairs of different brightness correlated with each other.
#[test]
fn pairs_of_different_brightness_are_taken_about_their_own_means() {
    let clouds = [cloud(10.0, 0.8), scene::pair(&scene::grid([64; 3]), 10.0 / 32f64.powi(3), [0.8; 3], 2, |_| SHIFT)];
    let grounded = |volume: &Volume, gain: f32| {
        let mut dense = vec![0.3 * gain; volume.grid.len() as usize];
        volume.indices.iter().zip(&volume.intensity).for_each(|(&i, value)| dense[i as usize] += gain * value);
        Volume::from_dense(&volume.grid, &dense)
    };
    let pairs: Vec<[Volume; 2]> = clouds
        .iter()
        .zip([1.0, 50.0])
        .map(|(pair, gain)| pair.each_ref().map(|volume| grounded(volume, gain)))
        .collect();
    let sparse: Vec<[lf_xcorr::Sparse; 2]> = pairs.iter().map(|pair| pair.each_ref().map(Volume::sparse)).collect();
    let both = Plan::new(&sparse, &Mask::Everything, &options()).unwrap().correlate(&|_| ()).unwrap().field;
    let one = correlate(&sparse[0][0], &sparse[0][1], &options()).unwrap().field;
    let (both, one) = (error(&both), error(&one));
    assert!(both[1] < 1.2 * one[1] && both[0] < 0.025 && both[2] > 0.95, "{both:?} {one:?}");
}
