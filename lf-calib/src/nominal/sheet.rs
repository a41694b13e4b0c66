//! Where a light sheet shows the depth of its particles best.

use lf_core::particle_image::{ParticleModel, Scratch};
use lf_core::statistics::upper_median;
use lf_core::{Camera, linear};

/// Standard deviation of a particle, pixels at the focal plane.
const SIGMA_PX: f64 = 0.75;
/// Noise of a pixel, as a share of the brightest pixel.
const NOISE: f64 = 0.01;
/// The uncertainty in a good depth is at most this many times the smallest.
const GOOD: f64 = 2.0;
/// Depths tried on each side of focus.
const DEPTHS: usize = 40;
/// Places tried at each depth, in lenslets from the axis.
const PLACES: [[f64; 2]; 5] = [[0.03, 0.05], [0.27, 0.14], [0.41, 0.36], [-0.22, 0.47], [-0.38, -0.11]];
/// Light, x, y and z of a particle.
const UNKNOWNS: usize = 4;

/// Depths at which the image of a particle alone shows its depth well.
#[derive(Debug, Clone, PartialEq)]
pub struct LightSheet {
    /// Ends of the good depths away from the camera and towards it, in rising order, mm.
    pub sides_mm: [[f64; 2]; 2],
    /// The uncertainty in z that is kept between the ends, mm: a standard deviation.
    pub std_mm: f64,
}

/// The good depths of a camera, within its useful ones. None if no image shows a depth.
///
/// The uncertainty is the Cramer-Rao bound of a particle whose place and light are unknown, as `lf-validate precision`
/// has it for many.
pub fn light_sheet(camera: &Camera) -> Option<LightSheet> {
    let useful = camera.useful_depth_mm();
    let model = ParticleModel::new(camera, SIGMA_PX * camera.pixel_in_focus_mm(), useful).ok()?;
    let lenslet_mm = camera.microlenses.pitch_mm / camera.main_lens.magnification;
    let depths = |end: f64| (1..=DEPTHS).map(move |n| end * n as f64 / DEPTHS as f64);
    let of_depth = |z: f64| {
        let shown: Vec<_> = PLACES.iter().map(|place| shown(&model, place.map(|p| p * lenslet_mm), z)).collect();
        let brightest = shown.iter().fold(0f64, |most, (peak, _)| most.max(*peak));
        let mut stds: Vec<f64> = shown.iter().map(|(_, std)| *std).collect();
        (z, brightest, upper_median(&mut stds).unwrap_or(f64::INFINITY))
    };
    let sides = useful.map(|end| depths(end).map(of_depth).collect::<Vec<_>>());
    let brightest = sides.iter().flatten().fold(0f64, |most, (_, peak, _)| most.max(*peak));
    let least = |side: &[(f64, f64, f64)]| side.iter().fold(f64::INFINITY, |least, (_, _, std)| least.min(*std));
    // The better side decides; the other one is hardly different.
    let limit = GOOD * least(&sides[0]).max(least(&sides[1]));
    let good = |side: &Vec<(f64, f64, f64)>| {
        let mut depths = side.iter().filter(|(_, _, std)| *std <= limit).map(|(z, _, _)| *z);
        let first = depths.next()?;
        let last = depths.next_back().unwrap_or(first);
        Some([first.min(last), first.max(last)])
    };
    let sides_mm = [good(&sides[0])?, good(&sides[1])?];
    limit.is_finite().then_some(LightSheet { sides_mm, std_mm: limit * NOISE * brightest })
}

/// The brightest pixel of a particle of light 1, and the standard deviation of its depth, mm, under noise of 1.
fn shown(model: &ParticleModel, [x, y]: [f64; 2], z: f64) -> (f64, f64) {
    let mut fisher = [0.0; UNKNOWNS * UNKNOWNS];
    let mut peak = 0f64;
    model.visit([x, y, z], 1.0, &mut Scratch::default(), |_, pixels| {
        for [light, slopes @ ..] in pixels {
            peak = peak.max(*light);
            let unknowns = [*light, slopes[0], slopes[1], slopes[2]];
            for (n, sum) in fisher.iter_mut().enumerate() {
                *sum += unknowns[n / UNKNOWNS] * unknowns[n % UNKNOWNS];
            }
        }
    });
    // The last diagonal element of the Cholesky factor is 1 over the standard deviation of the last unknown.
    let std = linear::cholesky(&mut fisher, UNKNOWNS, 1e-12).map_or(f64::INFINITY, |()| 1.0 / fisher[fisher.len() - 1]);
    (peak, std)
}
