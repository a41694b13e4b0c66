use crate::options::Score;
use lf_core::{Camera, light::Tones, light::usual_light};
use ndarray::ArrayView2;

/// A threshold found from the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Automatic {
    /// Noise over the brightest pixel.
    pub noise: f64,
    /// Brightness of the usual light over the brightest pixel, [`usual_light`].
    pub light: f64,
    /// Smallest geometric mean kept, over the brightest pixel.
    pub threshold: f64,
    /// The threshold where faint particles are kept too.
    pub faint: f64,
}

/// Threshold of a geometric mean over the brightness of the usual light. In the ready scenes `core` and
/// `full` the voxel of a particle scores at least a quarter of that brightness, even with noise of 2 % of the brightest
/// pixel. Half of this value keeps twice the voxels.
const MEAN_SHARE: f64 = 0.2;

/// Like [`MEAN_SHARE`], for particles of a quarter of the usual light. In nine frames of 54 particles, the logarithms
/// of whose light have a standard deviation of 2, it lost 7 particles, and `MEAN_SHARE` 73.
const FAINT_SHARE: f64 = 0.05;

/// Like [`MEAN_SHARE`], but for a share of the rays, each of which must reach it. At `MEAN_SHARE` one particle in six
/// would lose more than a tenth of its rays on turned and hexagonal lattices.
const RAY_SHARE: f64 = 0.06;

/// Setting negatives to 0 leaves this share of noise about zero: `sqrt(1/2 - 1/(2 pi))`.
const CUT_NOISE: f64 = 0.58;

impl Automatic {
    /// The threshold for an image of the camera's size, and for a score. NaN is a blind pixel. `deviation` is the
    /// standard deviation of a dark pixel, counts, before negatives were set to 0: [`lf_core::image::noise`].
    pub fn new(image: ArrayView2<f32>, deviation: f64, camera: &Camera, score: Score) -> Self {
        let tones = Tones::new(image);
        let peak = tones.peak;
        if peak <= 0.0 {
            return Self { noise: 0.0, light: 0.0, threshold: 0.0, faint: 0.0 };
        }
        let lenslet_px = camera.microlenses.pitch_mm / camera.sensor.pixel_pitch_mm;
        let light = usual_light(image, lenslet_px, &tones, deviation) / peak;
        let noise = (deviation / peak).min(1.0);
        let [usual, faint] = match score {
            Score::Geometric => [MEAN_SHARE, FAINT_SHARE],
            Score::Share(_) => [RAY_SHARE; 2],
        };
        let above_noise = |share: f64| (share * light).max(CUT_NOISE * noise).min(1.0);
        Self { noise, light, threshold: above_noise(usual), faint: above_noise(faint) }
    }
}
