use lf_core::image::noise;
use ndarray::ArrayView2;

/// A threshold found from the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Automatic {
    /// Noise over the brightest pixel.
    pub noise: f64,
    /// Least geometric mean kept, over the brightest pixel.
    pub threshold: f64,
}

/// Threshold over the mean brightness of the light itself, sum I^2 / sum I. This mean grows with the overlap of
/// particles, as their scores do, and not with the size of the image, as its brightest pixel does. In the ready scenes
/// `core` and `full` the voxel of a particle scores at least a quarter of it, also with noise of 2 % of the brightest
/// pixel. Half of this value keeps twice the voxels.
const SHARE: f64 = 0.2;

impl Automatic {
    /// The threshold for an image of shape (height, width) without negative values. NaN is a blind pixel.
    pub fn new(image: ArrayView2<f32>) -> Self {
        let (mut light, mut squares, mut peak) = (0f64, 0f64, 0f64);
        for value in image.iter().filter(|value| !value.is_nan()) {
            let value = f64::from(*value);
            light += value;
            squares += value * value;
            peak = peak.max(value);
        }
        if peak <= 0.0 {
            return Self { noise: 0.0, threshold: 0.0 };
        }
        let noise = (noise(image) / peak).min(1.0);
        Self { noise, threshold: (SHARE * squares / light / peak).max(noise).min(1.0) }
    }
}
