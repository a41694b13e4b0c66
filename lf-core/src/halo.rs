//! The far light of diffraction: the part of a lenslet's pattern that its Gaussian middle leaves out.
//!
//! In: the light of particles on the sensor, as [`crate::particle_image`] gives it, which is the middle alone. Out: the
//! light that diffraction spreads around it, by a convolution of the whole sensor. It is smooth and a few per cent of
//! all light, so a fit may hold it for a pass.
//!
//! Convention: pattern = middle + far light, where the middle is a Gaussian of the pattern's peak height. The kernel
//! holds the far light of each pixel over the light that stays in the pixel.

use crate::camera::{Camera, Diffraction};
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Far light around a pixel.
#[derive(Debug, Clone)]
pub struct Halo {
    /// Pixels on each side of the middle.
    reach: usize,
    /// Far light by pixel, row by row, over the light that stays in the middle pixel, which has 0 itself.
    kernel: Vec<f32>,
    middle_share: f64,
}

/// Reach of the pattern, in its unit. Light beyond is spread over that within.
const REACH: f64 = 16.0;
/// Largest reach of the kernel, px.
const MOST_REACH_PX: usize = 40;
/// Parts of a pixel a side over which the pattern is summed, and least steps for each unit of the pattern.
const PARTS: usize = 8;
const STEPS_PER_UNIT: f64 = 4.0;

impl Halo {
    /// The halo of a camera; None if its lenslets do not diffract.
    pub fn new(camera: &Camera) -> Option<Self> {
        let diffraction = camera.diffraction()?;
        let (unit, peak) = match diffraction {
            Diffraction::Square { unit_px } => (unit_px, 1.0),
            Diffraction::Disc { unit_px } => (unit_px, PI / 4.0),
        };
        let turn = DVec2::from_angle(-camera.microlenses.rotation_rad);
        let pattern = |place: DVec2| {
            let t = turn.rotate(place) / unit;
            match diffraction {
                _ if t.length() > REACH => 0.0,
                Diffraction::Square { .. } => sinc2(t.x) * sinc2(t.y),
                Diffraction::Disc { .. } => airy(t.length()),
            }
        };
        // A Gaussian of the pattern's height holds this share of its light.
        let core = diffraction.core_px();
        let share = peak * 2.0 * PI * core * core / (unit * unit);
        let gaussian = |place: DVec2| (-0.5 * place.length_squared() / (core * core)).exp();

        // Sum the pattern over each pixel; then take off the middle.
        let reach = ((REACH * unit).ceil() as usize).clamp(1, MOST_REACH_PX);
        let side = 2 * reach + 1;
        let parts = PARTS.max((STEPS_PER_UNIT / unit).ceil() as usize);
        let sums: Vec<[f64; 2]> = (0..side * side)
            .into_par_iter()
            .map(|n| {
                let corner = DVec2::new((n % side) as f64, (n / side) as f64) - (reach as f64 + 0.5);
                let points = (0..parts * parts)
                    .map(|k| corner + (DVec2::new((k % parts) as f64, (k / parts) as f64) + 0.5) / parts as f64);
                points.fold([0.0; 2], |[all, middle], point| [all + pattern(point), middle + gaussian(point)])
            })
            .collect();
        let [all, middle] = sums.iter().fold([0.0; 2], |sum, more| [sum[0] + more[0], sum[1] + more[1]]);
        let far: Vec<f64> = sums.iter().map(|sum| sum[0] / all - share * sum[1] / middle).collect();
        let centre = reach * side + reach;
        let middle_share = share + far[centre];
        let mut kernel: Vec<f32> = far.iter().map(|light| (light / middle_share) as f32).collect();
        kernel[centre] = 0.0;
        Some(Self { reach, kernel, middle_share })
    }

    /// Share of a particle's light that its own image holds; the rest is in the halo.
    pub fn middle_share(&self) -> f64 {
        self.middle_share
    }

    /// The far light around `light`, on a sensor of `width` columns, row by row.
    pub fn around(&self, light: &[f32], width: usize) -> Vec<f32> {
        let height = light.len() / width.max(1);
        let (reach, side) = (self.reach, 2 * self.reach + 1);
        let mut out = vec![0.0; light.len()];
        out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            for (dy, taps) in self.kernel.chunks(side).enumerate() {
                // Kernels are symmetric about their middle, so the sign of a step does not matter.
                let Some(from) = (y + dy).checked_sub(reach).filter(|from| *from < height) else { continue };
                let line = &light[from * width..(from + 1) * width];
                for (dx, tap) in taps.iter().enumerate() {
                    let (left, right) = (reach.saturating_sub(dx), (width + reach).saturating_sub(dx).min(width));
                    if left >= right {
                        continue;
                    }
                    let first = left + dx - reach;
                    let beside = &line[first..first + right - left];
                    row[left..right].iter_mut().zip(beside).for_each(|(sum, light)| *sum += tap * light);
                }
            }
        });
        out
    }
}

/// (sin(pi t) / (pi t))^2.
fn sinc2(t: f64) -> f64 {
    if t == 0.0 { 1.0 } else { ((PI * t).sin() / (PI * t)).powi(2) }
}

/// (2 J1(pi r) / (pi r))^2. J1 comes from Bessel's integral; the midpoint rule is exact for it at these arguments.
fn airy(r: f64) -> f64 {
    const POINTS: usize = 64;
    let x = PI * r;
    if x == 0.0 {
        return 1.0;
    }
    let angles = (0..POINTS).map(|n| PI * (n as f64 + 0.5) / POINTS as f64);
    let j1 = angles.map(|angle| (angle - x * angle.sin()).cos()).sum::<f64>() / POINTS as f64;
    (2.0 * j1 / x).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Aperture, Blur, tests::seed};
    use crate::lattice::Layout;

    /// Middle and halo hold all light, and a point's halo falls with the distance as sinc^2 does.
    #[test]
    fn no_light_is_lost() {
        for layout in [Layout::Square, Layout::Hexagonal] {
            let mut camera = seed(40, Aperture::Square, layout, 0.1);
            assert!(Halo::new(&camera).is_none());
            camera.blur = Some(Blur { sigma_px: 0.0, wavelength_nm: Some(532.0) });
            let halo = Halo::new(&camera).unwrap();
            let mut light = vec![0f32; 61 * 61];
            light[30 * 61 + 30] = halo.middle_share() as f32;
            let around = halo.around(&light, 61);
            let whole = around.iter().sum::<f32>() + light.iter().sum::<f32>();
            assert!((whole - 1.0).abs() < 1e-4, "{whole}");
            assert!((0.6..0.97).contains(&halo.middle_share()), "{}", halo.middle_share());
            assert!(around[30 * 61 + 31] > 5.0 * around[30 * 61 + 34].abs());
        }
    }

    #[test]
    fn a_corner_keeps_to_the_sensor() {
        let mut camera = seed(40, Aperture::Square, Layout::Square, 0.0);
        camera.blur = Some(Blur { sigma_px: 0.0, wavelength_nm: Some(532.0) });
        let halo = Halo::new(&camera).unwrap();
        let mut light = vec![0f32; 5 * 4];
        light[0] = 1.0;
        let around = halo.around(&light, 5);
        assert_eq!(around[1], halo.kernel[halo.reach * (2 * halo.reach + 1) + halo.reach + 1]);
        assert_eq!(around[0], 0.0);
    }
}
