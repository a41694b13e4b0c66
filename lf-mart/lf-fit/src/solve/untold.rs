//! Places that one camera does not determine although its image has slopes there.
//!
//! In focus a particle lights one lenslet, wherever it is before it; or two, as two particles do that are in focus
//! before one each. Slopes hold over a small part of the lenslet there, and of the depths from which all light stays in
//! one lenslet. Somewhat farther away places depend on the shape of a particle's image.

use crate::cameras::view::CameraView;
use crate::particle::FoundParticle;
use lf_core::statistics::median;

/// Slopes do not hold where the uncertainty sideways is this many times the usual one. On six ideal frames of the demo,
/// uncertainties of ten to a hundred times the usual one, 0.1 to 1 px, had errors of 1 to 4 px; smaller ones held.
const UNUSUAL: f64 = 10.0;
/// Nearer to the focal plane than this many depths of focus, one small uncertainty in six is wrong by pixels.
const IN_FOCUS: f64 = 1.5;
/// The standard uncertainty of a depth in focus, over the depth at which the cone of light is as wide as a lenslet. On
/// five frames that diffract 16 such particles erred by 0.14 of it RMS; most stated less than 0.015.
const IN_CONE: f64 = 0.16;
/// Nearer to the focal plane than this part of that depth, light falls on a few pixels of one to four lenslets. Places
/// then depend on the exact shape of a particle's image, which no lens makes Gaussian.
const NEAR_FOCUS: f64 = 1.1;
/// Standard uncertainties that the shape adds there: of x and y over a lenslet's width, and of z over that depth. In
/// frames whose particles are discs or have Airy's rings, x and y erred by 0.01 to 0.03, and z by 0.02 to 0.15.
const SHAPE: [f64; 2] = [0.01, 0.04];
/// Where the variances of x, y and z lie in a covariance.
const PLACE: [usize; 3] = [0, 3, 5];

/// Widens the uncertainties of such particles to the width of a lenslet, and in focus to part of the depth at which the
/// cone of light is as wide. Returns their number. Near the focus it adds what the shape of particles leaves open.
pub(crate) fn widen(particles: &mut [FoundParticle], view: &CameraView) -> usize {
    let variances = |axis: usize| particles.iter().map(move |found| found.covariance_mm2[axis]);
    let most = |axis: usize| UNUSUAL.powi(2) * median(&mut variances(axis).collect::<Vec<f64>>());
    // A plateau away from focus is one sideways.
    let most = [most(PLACE[0]), most(PLACE[1]), f64::INFINITY];
    // The variance of places that are alike all over a lenslet.
    let lenslet_mm2 = (view.camera.pitch_px() * view.pixel_mm).powi(2) / 12.0;
    let in_focus_mm = IN_FOCUS * view.depth_of_focus_mm();
    // The cone of light is as wide as a lenslet where it lights a lenslet's number of pixels.
    let cone_mm = view.camera.pitch_px() * view.depth_of_focus_mm();
    let depth_mm2 = (IN_CONE * cone_mm).powi(2);
    let sideways_mm = SHAPE[0] * view.camera.pitch_px() * view.pixel_mm;
    let shape_mm = [sideways_mm, sideways_mm, SHAPE[1] * cone_mm];
    let mut count = 0;
    for found in particles {
        if found.particle.place_mm[2].abs() < NEAR_FOCUS * cone_mm {
            PLACE.into_iter().zip(shape_mm).for_each(|(axis, mm)| found.covariance_mm2[axis] += mm * mm);
        }
        let is_in_focus = found.particle.place_mm[2].abs() < in_focus_mm;
        let mut is_untold = false;
        for ((axis, wide_mm2), most) in PLACE.into_iter().zip([lenslet_mm2, lenslet_mm2, depth_mm2]).zip(most) {
            let variance = &mut found.covariance_mm2[axis];
            if *variance < wide_mm2 && (is_in_focus || *variance > most) {
                (*variance, is_untold) = (wide_mm2, true);
            }
        }
        count += usize::from(is_untold);
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::view::tests::{PIXEL_MM, Sight, view};
    use crate::particle::Particle;
    use lf_core::camera::Pose;

    #[test]
    fn a_place_in_focus_or_on_a_plateau_is_that_of_a_lenslet() {
        let sight = Sight::new(3);
        let particle = |z: f64, sigmas_px: [f64; 2]| {
            let [x, y] = sigmas_px.map(|sigma| (sigma * PIXEL_MM).powi(2));
            let covariance_mm2 = [x, 0.0, 0.0, y, 0.0, 1e-4];
            FoundParticle { particle: Particle::new([0.1, 0.2, z], 1.0), covariance_mm2, light_std: 0.1 }
        };
        // A depth of focus is 0.0055 x 4 mm. A lenslet of 14 px is uncertain by 14 / sqrt(12) px.
        let lenslet = 4.041;
        // Near the focus the shape adds 0.14 px.
        let cases = [
            (0.5, [0.02, 0.02], [0.02, 0.02]),
            (-0.034, [0.02, 0.02], [0.141_421, 0.141_421]),
            (-0.032, [0.02, 0.02], [lenslet, lenslet]),
            (1.0, [0.19, 0.21], [0.19, lenslet]),
            (1.0, [6.0, 0.02], [6.0, 0.02]),
        ];
        let mut particles: Vec<FoundParticle> = cases.iter().map(|(z, sigmas, _)| particle(*z, *sigmas)).collect();
        assert_eq!(widen(&mut particles, &view(&sight, Pose::default(), 1.0)), 2);
        for (found, (z, _, wanted)) in particles.iter().zip(cases) {
            for (axis, wanted) in PLACE.into_iter().zip(wanted) {
                let sigma_px = found.covariance_mm2[axis].sqrt() / PIXEL_MM;
                assert!((sigma_px - wanted).abs() < 1e-3, "z = {z}: {sigma_px} for {wanted}");
            }
            // The cone is as wide as a lenslet at 14 x 0.0055 x 4 mm.
            let wanted = match z {
                -0.032 => 0.16 * 0.308,
                -0.034 => 0.01_f64.hypot(0.04 * 0.308),
                _ => 0.01,
            };
            assert!((found.covariance_mm2[PLACE[2]].sqrt() - wanted).abs() < 1e-4);
            assert_eq!(found.light_std, 0.1);
        }
    }
}
