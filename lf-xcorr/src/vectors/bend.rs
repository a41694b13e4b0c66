//! The part of a flow that bends inside a window, from the places of its particle images.
//!
//! A vector is the displacement at its window's centre, but a window measures the mean over its particle images. In
//! volumes deformed by a predictor, the images show the rest of the flow, r. The mean of a gradient of r over a window
//! is 0. What bends has a mean, and its error does not fall with the number of images: `r(centre) - mean(r)`.
//!
//! Equation: `B = sum of q(x) e`, with `q(x) = 15/4 sum over axes of (1/3 - x_a^2)` at places x from -1 to 1 across the
//! window, and e the residual displacements of the images, times their shares. This is the value at the centre of the
//! quadratic through images spread evenly, less their mean: the mean of q is 0, that of q x_a^2 is -1/3.
//!
//! Scatter contributes to B too: the sum of the squares of q e, which is subtracted from B squared. The difference is
//! noisy for one window, so it is averaged over neighbouring windows.

use super::image_sums::ImageSums;
use super::{fill::filled, smooth::smooth};
use crate::correlate::WindowGrid;
use glam::DVec3;
use std::ops::Range;

/// Constant: see the equation.
const QUADRATIC: f64 = 3.75;
/// Constant: standard deviation of the weights of the mean over neighbouring windows, in windows.
const NEIGHBOURS: f64 = 0.4;
/// Constant: factor on the mean square, for flow that bends faster than a quadratic. Chosen for coverage on waves, jets
/// and vortices (`cargo bench -p lf-xcorr --bench coverage -- choose`).
const FASTER: f64 = 1.5;

/// Square of the bend in the window of these `voxels`, less the contribution of scatter; it can be negative.
/// `residuals` are the displacements that the `images` measure, less the mean; `few` enlarges their squares to those of
/// a sample.
pub(crate) fn square(voxels: &[Range<usize>; 3], images: &[ImageSums], residuals: &[DVec3], few: f64) -> DVec3 {
    let product: f64 = images.iter().map(|image| image.product).sum();
    let weights: Vec<f64> = images.iter().map(|image| weight(voxels, image)).collect();
    let mean = images.iter().zip(&weights).map(|(image, weight)| image.product / product * weight).sum::<f64>();
    let (mut bend, mut noise) = (DVec3::ZERO, DVec3::ZERO);
    for (weight, residual) in weights.iter().zip(residuals) {
        let part = (weight - mean) * *residual;
        bend += part;
        noise += part * part;
    }
    bend * bend - few * noise
}

/// The weight q of an image at its centre of light.
fn weight(voxels: &[Range<usize>; 3], image: &ImageSums) -> f64 {
    if image.product <= 0.0 {
        return 0.0;
    }
    let place = image.moment / image.product;
    let term = |axis: usize| {
        let half = 0.5 * voxels[axis].len() as f64;
        let from_centre = (place[axis] + 0.5 - voxels[axis].start as f64) / half - 1.0;
        QUADRATIC * (1.0 / 3.0 - from_centre * from_centre)
    };
    (0..3).map(term).sum()
}

/// Mean square of the bend around every window, from the squares of the windows that have one.
pub(crate) fn mean_squares(windows: &WindowGrid, squares: Vec<Option<DVec3>>) -> Vec<DVec3> {
    let Some(squares) = filled(windows.shape(), squares) else { return vec![DVec3::ZERO; windows.count()] };
    let nodes = windows.axes.each_ref().map(|axis| NEIGHBOURS * axis.window as f64 / axis.step as f64);
    let means = smooth(windows.shape(), &squares, DVec3::from_array(nodes));
    means.into_iter().map(|mean| FASTER * mean.max(DVec3::ZERO)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Images of equal light at the nodes of a fine grid, with the residual displacement `r` along x.
    fn of(r: impl Fn([f64; 3]) -> f64) -> DVec3 {
        const SIDE: usize = 16;
        let voxels = [10..10 + SIDE, 0..SIDE, 4..4 + SIDE];
        let places: Vec<[usize; 3]> =
            (0..SIDE.pow(3)).map(|k| [10 + k % SIDE, k / SIDE % SIDE, 4 + k / SIDE / SIDE]).collect();
        let image = |place: &[usize; 3]| ImageSums {
            product: 2.0,
            moment: 2.0 * DVec3::from_array(place.map(|p| p as f64)),
            ..ImageSums::default()
        };
        let images: Vec<ImageSums> = places.iter().map(image).collect();
        let centred = |place: &[usize; 3]| {
            std::array::from_fn(|a| (place[a] - voxels[a].start) as f64 / (0.5 * SIDE as f64) + 1.0 / 16.0 - 1.0)
        };
        let values: Vec<f64> = places.iter().map(|place| r(centred(place))).collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let residuals: Vec<DVec3> = values.iter().map(|value| (value - mean) / count * DVec3::X).collect();
        square(&voxels, &images, &residuals, count / (count - 1.0))
    }

    /// By hand: 0.3 x^2 has a mean of 0.1 over the window, and 0 at its centre. 0.3 x^2 - 0.6 y^2 + 0.1: -0.1.
    #[test]
    fn a_quadratic_is_found_and_a_gradient_is_not() {
        let error = |found: DVec3, wanted: f64| (found[0] - wanted).abs();
        assert!(error(of(|[x, ..]| 0.3 * x * x), 0.01) < 4e-4, "{}", of(|[x, ..]| 0.3 * x * x));
        assert!(error(of(|[x, y, _]| 0.3 * x * x - 0.6 * y * y + 0.1), 0.01) < 6e-4);
        assert!(of(|[x, y, z]| 2.0 * x - y + 0.5 * z).abs().max_element() < 0.01);
    }
}
