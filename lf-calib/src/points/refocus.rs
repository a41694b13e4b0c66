//! An image refocused at one depth: it shows where the points of light are in the object.

use super::view::PointView;
use glam::{DVec2, DVec3};
use lf_core::{Optics, image::noise, statistics::upper_median};
use ndarray::{Array2, ArrayView2};

/// A pixel counts if it is this many standard deviations of the noise above the ground.
const ABOVE_NOISE: f64 = 4.0;
/// Smallest height of a peak, as a share of the height of bright peaks.
const LEAST_PEAK: f64 = 0.25;
/// Bright peaks are at this quantile of all peaks.
const BRIGHT: f64 = 0.9;
/// Passes of the smoothing (1, 2, 1) / 4; five give a standard deviation of 1.6 cells.
const SMOOTHING: usize = 5;

pub(crate) struct RefocusedImage {
    light: Array2<f64>,
    half_mm: DVec2,
    cell_mm: f64,
}

/// Refocuses an image as far as `half_mm` from the axis. The light of each pixel goes to where the ray through the
/// pixel's middle and its lenslet's centre comes from.
pub(crate) fn refocus(
    image: ArrayView2<f32>,
    optics: &Optics,
    z_mm: f64,
    half_mm: DVec2,
    cell_mm: f64,
) -> RefocusedImage {
    let size = (2.0 * half_mm / cell_mm).ceil();
    let mut light = Array2::zeros(((size.y as usize).max(3), (size.x as usize).max(3)));
    let ground = ground(image);
    let least = ground + ABOVE_NOISE * noise(image);
    let k = optics.demagnification;
    let axis = PointView::new(optics, DVec3::new(0.0, 0.0, z_mm));
    // Motion on the array for each mm that a point moves along x and along y at this depth, by numerical derivatives.
    let step = 1e-2;
    let hit = |object: DVec2| optics.array_from_object(object, z_mm, DVec2::ZERO);
    let motion = |way: DVec2| (hit(step * way) - hit(-step * way)) / (2.0 * step);
    let per_mm = DVec2::new(motion(DVec2::X).x, motion(DVec2::Y).y);
    for ((row, column), &count) in image.indexed_iter() {
        let count = f64::from(count);
        if count.is_nan() || count <= least {
            continue;
        }
        let place = optics.centre_mm(column as u32, row as u32);
        let centre = optics.lattice().nearest_centre_mm(place / (1.0 + k));
        let aperture = centre - (place - centre) / k;
        if !optics.passes(aperture) {
            continue;
        }
        let mut object = (centre - axis.alpha * aperture) / per_mm;
        for _ in 0..2 {
            object -= (optics.array_from_object(object, z_mm, aperture) - centre) / per_mm;
        }
        let cell = (object + half_mm) / cell_mm;
        if cell.x >= 0.0 && cell.y >= 0.0 && cell.x < light.ncols() as f64 && cell.y < light.nrows() as f64 {
            light[(cell.y as usize, cell.x as usize)] += count - ground;
        }
    }
    for _ in 0..SMOOTHING {
        light = smooth(&light);
    }
    RefocusedImage { light, half_mm, cell_mm }
}

fn ground(image: ArrayView2<f32>) -> f64 {
    let mut sample: Vec<f32> =
        image.iter().step_by((image.len() / 100_000).max(1)).copied().filter(|count| count.is_finite()).collect();
    upper_median(&mut sample).map_or(0.0, f64::from)
}

/// One pass of the smoothing along both axes; edges repeat.
fn smooth(light: &Array2<f64>) -> Array2<f64> {
    let (rows, columns) = light.dim();
    let along = Array2::from_shape_fn((rows, columns), |(y, x)| {
        0.5 * light[(y, x)] + 0.25 * (light[(y, x.saturating_sub(1))] + light[(y, (x + 1).min(columns - 1))])
    });
    Array2::from_shape_fn((rows, columns), |(y, x)| {
        0.5 * along[(y, x)] + 0.25 * (along[(y.saturating_sub(1), x)] + along[((y + 1).min(rows - 1), x)])
    })
}

impl RefocusedImage {
    /// Heights and positions (mm) of the peaks that are the highest within `apart_mm`, the highest first.
    pub fn peaks(&self, apart_mm: f64) -> Vec<(f64, DVec2)> {
        let reach = (apart_mm / self.cell_mm).ceil() as usize;
        let (rows, columns) = self.light.dim();
        let mut found: Vec<(f64, DVec2)> = Vec::new();
        for ((y, x), &height) in self.light.indexed_iter() {
            if height <= 0.0 {
                continue;
            }
            let around = |at: usize, size: usize, reach: usize| at.saturating_sub(reach)..(at + reach + 1).min(size);
            // The test of the eight neighbours is cheap, and most pixels fail it.
            let beside = around(y, rows, 1).all(|v| around(x, columns, 1).all(|u| self.light[(v, u)] <= height));
            let highest = beside
                && around(y, rows, reach).all(|v| {
                    around(x, columns, reach).all(|u| {
                        let other = self.light[(v, u)];
                        other < height || (other == height && (v, u) >= (y, x))
                    })
                });
            if highest {
                found.push((height, self.centroid(x, y, (reach / 2).max(1))));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let bright = found.get((found.len() as f64 * (1.0 - BRIGHT)) as usize).map_or(0.0, |peak| peak.0);
        found.retain(|peak| peak.0 >= LEAST_PEAK * bright);
        found
    }

    /// Mean position of the light above half the height of a peak, mm.
    fn centroid(&self, x: usize, y: usize, reach: usize) -> DVec2 {
        let (rows, columns) = self.light.dim();
        let half = 0.5 * self.light[(y, x)];
        let (mut sum, mut light) = (DVec2::ZERO, 0.0);
        for v in y.saturating_sub(reach)..(y + reach + 1).min(rows) {
            for u in x.saturating_sub(reach)..(x + reach + 1).min(columns) {
                let above = (self.light[(v, u)] - half).max(0.0);
                sum += above * (DVec2::new(u as f64, v as f64) + 0.5);
                light += above;
            }
        }
        sum / light * self.cell_mm - self.half_mm
    }
}
