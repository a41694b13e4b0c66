//! The depths that a camera resolves, and where a dot target should stand to calibrate it.

use crate::points::locate::{NARROWEST, nearest_depths_mm};
use crate::points::view::PointView;
use glam::DVec3;
use lf_core::{Camera, Optics};

/// A target nearer to focus than this many lenslets of light is not advised: with a few percent of error in the data
/// sheets it would light fewer than [`NARROWEST`].
const NEAREST_LENSLETS: f64 = 1.2 * NARROWEST;
/// Depths of the target on either side of focus.
const DEPTHS: usize = 3;
/// The farthest depth over the nearest, at least: magnification and focal length show in how sub-images spread.
const LEAST_SPREAD: f64 = 2.0;
/// Smallest distance of neighbouring dots in one lenslet's image, px, at the farthest depth.
const APART_PX: f64 = 4.0;
/// Dots over the shorter side of the view. More than some hundred dots in all add little.
const DOTS_ACROSS: f64 = 20.0;
/// Largest diameter of a dot in one lenslet's image, px, at the nearest depth.
const DOT_PX: f64 = 2.0;

/// Consequences of a camera's lengths for an experiment, mm. Depths are Z, towards the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// Depths within which the light that a pixel receives is narrower than a lenslet.
    pub useful_depth_mm: [f64; 2],
    /// Depths within which a point lights one lenslet and its depth is hardly seen.
    pub blind_depth_mm: [f64; 2],
    /// Steps in depth that move the outermost sub-images apart by a pixel, halfway to the end of the useful depth and
    /// at its end towards the camera.
    pub resolution_mm: [f64; 2],
    /// Pixels per voxel along x, y and z.
    pub pixels_per_voxel: [f64; 3],
    /// Depths of a dot target.
    pub target_mm: Vec<f64>,
    /// Spacing and largest diameter of its dots.
    pub dots_mm: [f64; 2],
}

/// Derives what a camera lets one measure.
pub fn advice(camera: &Camera) -> Advice {
    let optics = Optics::new(camera);
    let useful = camera.useful_depth_mm();
    let target_mm = target_mm(&optics, useful);
    let far = target_mm.iter().copied().fold(0.0, f64::max);
    let near = target_mm.iter().copied().filter(|z| *z > 0.0).fold(far, f64::min);
    let px_per_mm = |z: f64| PointView::new(&optics, DVec3::new(0.0, 0.0, z)).px_per_mm();
    let view_mm = camera.half_view_mm().map(|half| 2.0 * half).into_iter().fold(f64::INFINITY, f64::min);
    let spacing_mm = (APART_PX / px_per_mm(far)).max(view_mm / DOTS_ACROSS);
    Advice {
        useful_depth_mm: useful,
        blind_depth_mm: camera.depths_of_lenslets_mm(1.0),
        resolution_mm: [0.5, 1.0].map(|part| camera.depth_resolution_mm(part * useful[1])),
        pixels_per_voxel: camera.suggested_pixels_per_voxel(),
        dots_mm: [rounded(spacing_mm, f64::ceil), rounded(DOT_PX / px_per_mm(near), f64::floor)],
        target_mm,
    }
}

/// Depths from the nearest that is advised to the end of the useful depth, on both sides of focus, in rising order.
fn target_mm(optics: &Optics, useful: [f64; 2]) -> Vec<f64> {
    let nearest = nearest_depths_mm(optics, NEAREST_LENSLETS).map(f64::abs).into_iter().fold(0.0, f64::max);
    let step = 10f64.powf((nearest.log10() - 1.0).floor());
    let on_step = |depth: f64| (depth / step).round() * step;
    let near = (nearest / step).ceil() * step;
    let far = useful[1].min(-useful[0]).max(LEAST_SPREAD * near);
    let depth = |n: usize| {
        let depth = on_step(near + (far - near) * n as f64 / (DEPTHS - 1) as f64);
        // Removes what the product with the step leaves behind the last digit.
        format!("{depth:.9}").parse().unwrap_or(depth)
    };
    (0..DEPTHS).rev().map(|n| -depth(n)).chain((0..DEPTHS).map(depth)).collect()
}

/// A length with two digits, rounded by `how`.
fn rounded(length: f64, how: fn(f64) -> f64) -> f64 {
    let step = 10f64.powf(length.log10().floor() - 1.0);
    let value = how(length / step) * step;
    format!("{value:.9}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::data_sheet::{DataSheet, Liquid, tests::seed};
    use crate::points::locate::width_in_lenslets;
    use lf_core::camera::{Layout, Medium};

    #[test]
    fn dots_at_the_advised_depths_light_enough_lenslets() {
        let water = Medium { index: 1.333, window_z_mm: 30.0, window_thickness_mm: 5.0, window_index: 1.5 };
        let mut hexagonal = seed();
        hexagonal.layout = Layout::Hexagonal;
        hexagonal.working_f_number = 8.0;
        hexagonal.lenslet_focal_length_mm = 0.616;
        for camera in [
            seed().camera(None).unwrap(),
            seed().camera(Some(&Liquid::InAir { index: 1.333 })).unwrap(),
            seed().camera(Some(&Liquid::Exact(water))).unwrap(),
            hexagonal.camera(None).unwrap(),
        ] {
            let (optics, advice) = (Optics::new(&camera), advice(&camera));
            assert_eq!(advice.target_mm.len(), 6);
            for z in &advice.target_mm {
                let wide = width_in_lenslets(&optics, DVec3::new(0.0, 0.0, *z));
                assert!((6.0..=17.5).contains(&wide), "{z}: {wide}");
            }
            let [away, towards] = nearest_depths_mm(&optics, 5.0);
            for z in [away, towards] {
                let wide = width_in_lenslets(&optics, DVec3::new(0.0, 0.0, z));
                assert!((wide - 5.0).abs() < 1e-6, "{wide}");
            }
        }
    }

    #[test]
    fn advice_for_the_camera_of_the_simulations() {
        let advised = advice(&seed().camera(None).unwrap());
        assert_eq!(advised.target_mm, [-4.3, -3.1, -1.9, 1.9, 3.1, 4.3]);
        assert_eq!(advised.pixels_per_voxel, [1.0, 1.0, 10.0]);
        // k / alpha / 5.5 um: 13.0 px per mm at 4.3 mm, 29.5 px per mm at 1.9 mm. A twentieth of the view is 0.3003 mm.
        assert_eq!(advised.dots_mm, [0.31, 0.067]);
        let wide = advice(&DataSheet { sensor_px: [6600, 4400], ..seed() }.camera(None).unwrap());
        assert_eq!(wide.dots_mm, [1.3, 0.067]);
        assert!((advised.resolution_mm[1] - 0.305).abs() < 0.01, "{:?}", advised.resolution_mm);
    }

    #[test]
    fn advised_depths_in_water_are_deeper_by_its_index() {
        let [air, water] =
            [None, Some(Liquid::InAir { index: 1.333 })].map(|liquid| advice(&seed().camera(liquid.as_ref()).unwrap()));
        assert!((water.useful_depth_mm[1] / air.useful_depth_mm[1] - 1.333).abs() < 1e-3);
    }
}
