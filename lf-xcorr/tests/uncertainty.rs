//! The stated uncertainties cover the true errors.

use crate::coverage::{WORN, coverage, shear, vortices};
use crate::scene::{self, Wear};
use lf_xcorr::{Options, correlate};

/// By hand: of two equal particles, one moves 0.1 voxel more along x than the mean and one 0.1 voxel less. The standard
/// deviation of the sample is 0.1 sqrt(2), that of the mean 0.1, and Student's factor for two is 1.5. Nothing moves
/// along y.
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
fn errors_of_windows_too_large_for_the_flow_are_stated() {
    let found = coverage(12.0, 0.75, Wear::default(), 1..2, vortices(4.0));
    (0..2).for_each(|axis| {
        let ratio = found.stated_vox[axis] / found.error_vox[axis];
        assert!((0.7..1.3).contains(&ratio), "{:?} {:?}", found.stated_vox, found.error_vox);
    });
}
