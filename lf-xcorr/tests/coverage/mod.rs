//! The share of true errors that the stated uncertainties cover, on clouds of particles.

use crate::scene::{self, Wear};
use lf_core::field::MEASURED;
use lf_xcorr::{Options, correlate};

/// Share of the errors of u, v, w that the stated standard uncertainty covers, and their root mean squares, voxels.
pub struct Coverage {
    pub share: [f64; 3],
    pub error_vox: [f64; 3],
    pub stated_vox: [f64; 3],
}

pub fn coverage(
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

pub const WORN: Wear = Wear { jitter_vox: [0.1, 0.1, 0.2], lost: 0.1, flicker: 0.3 };

/// A shear of u and w, in voxels per voxel.
pub fn shear(rate: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |p: [f64; 3]| [1.3 + rate * (p[1] - 64.0), -0.6, 0.7 + rate * (p[0] - 64.0)]
}

/// Vortices in x and y with a period of `windows` windows of 32 voxels.
pub fn vortices(windows: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |p: [f64; 3]| {
        let k = std::f64::consts::TAU / (32.0 * windows);
        [2.0 * (k * p[0]).sin() * (k * p[1]).cos(), -2.0 * (k * p[0]).cos() * (k * p[1]).sin(), 0.3]
    }
}
