//! Do the stated uncertainties cover the true errors?

mod scene;

use lf_core::field::MEASURED;
use lf_xcorr::{Options, correlate};
use scene::Wear;

/// Share of the errors of u, v, w that the stated standard uncertainty covers, and their root mean squares, voxels.
struct Coverage {
    share: [f64; 3],
    error_vox: [f64; 3],
    stated_vox: [f64; 3],
}

fn coverage(
    density: f64,
    sigma_z_vox: f64,
    wear: Wear,
    seeds: std::ops::Range<u64>,
    truth: impl Fn([f64; 3]) -> [f64; 3],
) -> Coverage {
    let (mut count, mut covered, mut errors, mut stated) = (0.0, [0.0; 3], [0.0; 3], [0.0; 3]);
    for seed in seeds {
        let grid = scene::grid([128, 128, 96]);
        let [a, b] = scene::worn_pair(&grid, density / 32f64.powi(3), [0.75, 0.75, sigma_z_vox], seed, wear, &truth);
        let options = Options::coarse_to_fine([64; 3], [32; 3], 0.75, [8; 3], Options::REFINE);
        let field = correlate(&a.sparse(), &b.sparse(), &options).unwrap().field;
        for i in (0..field.len()).filter(|&i| field.flag[i] == MEASURED && field.su[i].is_finite()) {
            count += 1.0;
            let wanted = truth(field.place_mm(i));
            let found = [(field.u[i], field.su[i]), (field.v[i], field.sv[i]), (field.w[i], field.sw[i])];
            for (axis, (value, uncertainty)) in found.into_iter().enumerate() {
                let error = (value as f64 - wanted[axis]).abs();
                covered[axis] += (error <= uncertainty as f64) as u8 as f64;
                errors[axis] += error * error;
                stated[axis] += (uncertainty as f64).powi(2);
            }
        }
    }
    let of = |sum: [f64; 3]| sum.map(|sum| sum / count);
    Coverage { share: of(covered), error_vox: of(errors).map(f64::sqrt), stated_vox: of(stated).map(f64::sqrt) }
}

const WORN: Wear = Wear { jitter_vox: [0.1, 0.1, 0.2], lost: 0.1, flicker: 0.3 };

/// A shear of `rate` voxels a voxel in u and w.
fn shear(rate: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |p: [f64; 3]| [1.3 + rate * (p[1] - 64.0), -0.6, 0.7 + rate * (p[0] - 64.0)]
}

/// Vortices across x and y of `windows` windows of 32 voxels each.
fn vortices(windows: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |p: [f64; 3]| {
        let k = std::f64::consts::TAU / (32.0 * windows);
        [2.0 * (k * p[0]).sin() * (k * p[1]).cos(), -2.0 * (k * p[0]).cos() * (k * p[1]).sin(), 0.3]
    }
}

#[test]
#[ignore = "the table of the README"]
fn table() {
    println!("{:22} {:>9}  {:17} {:22} {:22}", "", "particles", "covered, %", "error, voxel", "stated, voxel");
    let line = |name: &str, density: f64, wear: Wear, truth: &dyn Fn([f64; 3]) -> [f64; 3]| {
        let found = coverage(density, 0.75, wear, 1..5, truth);
        let [share, error, stated] = [found.share.map(|s| 100.0 * s), found.error_vox, found.stated_vox];
        println!(
            "{name:22} {density:9}  {:3.0}  {:3.0}  {:3.0}     {:.4} {:.4} {:.4}   {:.4} {:.4} {:.4}",
            share[0], share[1], share[2], error[0], error[1], error[2], stated[0], stated[1], stated[2]
        );
    };
    for density in [4.0, 8.0, 20.0] {
        line("uniform", density, Wear::default(), &shear(0.0));
        line("uniform, worn", density, WORN, &shear(0.0));
        line("shear 0.03, worn", density, WORN, &shear(0.03));
        line("vortices of 8 w., worn", density, WORN, &vortices(8.0));
        line("vortices of 4 w., worn", density, WORN, &vortices(4.0));
    }
}

/// By hand: of two equal particles one moves 0.1 voxel more along x than the mean and one as much less. The sample's standard
/// deviation is 0.1 sqrt(2), that of the mean of two is 0.1, and Student's factor for two is 1.5. Nothing moves along y.
#[test]
fn two_particles_by_hand() {
    let grid = scene::grid([48, 40, 40]);
    let volumes = [-0.5, 0.5].map(|frame: f64| {
        let mut dense = vec![0f32; grid.len() as usize];
        for (x, shift) in [(14.0, 0.6), (34.0, 0.4)] {
            scene::splat(&mut dense, &grid, [x + frame * shift, 20.0, 20.0], [1.0; 3], 1.0);
        }
        scene::Volume::from_dense(&grid, &dense)
    });
    let options = Options::coarse_to_fine([48, 40, 40], [48, 40, 40], 0.0, [4; 3], [3; 3]);
    let field = correlate(&volumes[0].sparse(), &volumes[1].sparse(), &options).unwrap().field;
    assert_eq!((field.len(), field.count[0]), (1, 2.0));
    assert!((field.u[0] - 0.5).abs() < 0.005 && (field.su[0] - 0.15).abs() < 0.01, "{} {}", field.u[0], field.su[0]);
    assert!(field.sv[0] < 0.005, "{}", field.sv[0]);
}

#[test]
fn worn_particles_are_covered_as_a_standard_uncertainty_says() {
    for (density, rate) in [(4.0, 0.0), (8.0, 0.03), (20.0, 0.0)] {
        let found = coverage(density, 0.75, WORN, 1..2, shear(rate));
        let mean = found.share.iter().sum::<f64>() / 3.0;
        assert!((0.60..0.75).contains(&mean), "{density} {rate}: {:?}", found.share);
        assert!(found.error_vox.iter().all(|error| *error > 0.03), "{:?}", found.error_vox);
    }
}

#[test]
fn what_windows_are_too_large_for_is_stated() {
    let found = coverage(12.0, 0.75, Wear::default(), 1..2, vortices(4.0));
    (0..2).for_each(|axis| {
        let ratio = found.stated_vox[axis] / found.error_vox[axis];
        assert!((0.7..1.3).contains(&ratio), "{:?} {:?}", found.stated_vox, found.error_vox);
    });
}
