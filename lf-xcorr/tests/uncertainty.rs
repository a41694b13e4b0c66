//! The stated uncertainties cover the true errors.

use crate::coverage::{Cloud, Flow, coverage};
use crate::scene;
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
    assert!(
        (field.u[0] - 0.5).abs() < 0.0011 && (field.su[0] - 0.15).abs() < 0.00045,
        "{} {}",
        field.u[0],
        field.su[0]
    );
    assert!(field.sv[0] < 0.0016, "{}", field.sv[0]);
}

#[test]
fn worn_particles_are_covered_as_a_standard_uncertainty_says() {
    for (density, flow) in [(4.0, Flow::Shear(0.0)), (8.0, Flow::Shear(5.0)), (20.0, Flow::Rotation(10.0))] {
        let found = coverage(&Cloud::worn(density), |place| flow.at(place), 1..2);
        let mean = found.share.iter().sum::<f64>() / 3.0;
        assert!((0.60..0.75).contains(&mean), "{density} {flow:?}: {:?}", found.share);
        assert!(found.error_vox.iter().all(|error| *error > 0.03), "{:?}", found.error_vox);
    }
}

/// The errors of u and v are those of windows too large for the flow, whether the particles are worn or not.
#[test]
fn errors_of_windows_too_large_for_the_flow_are_stated() {
    let flow = Flow::Vortices(4.0, 5.0);
    for cloud in [Cloud::exact(12.0), Cloud::exact(30.0), Cloud::worn(30.0)] {
        let found = coverage(&cloud, |place| flow.at(place), 1..2);
        let share = 0.5 * (found.share[0] + found.share[1]);
        assert!((0.55..0.80).contains(&share), "{:?}", found.share);
        assert!(found.error_vox[0] > 0.075, "{:?}", found.error_vox);
    }
}
