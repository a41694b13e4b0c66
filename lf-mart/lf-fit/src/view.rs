//! A further camera that sees the same particles.

use super::noise::Noise;
use super::spot::Spot;
use lf_core::camera::Pose;
use lf_core::particle_image::ParticleModel;

/// A camera beside the first one.
#[derive(Debug, Clone)]
pub(super) struct View {
    pub(super) model: ParticleModel,
    /// From the frame of the first camera to its own.
    pub(super) pose: Pose,
    /// Its light of a particle over that of the first camera.
    pub(super) light: f64,
    pub(super) noise: Noise,
    /// A pixel at its focal plane, mm.
    pub(super) pixel_mm: f64,
}

impl View {
    /// A particle in this camera's frame, with the light that it sends there.
    pub(super) fn seen(&self, spot: &Spot) -> Spot {
        Spot { place_mm: self.pose.to_camera(spot.place_mm), light: self.light * spot.light }
    }

    /// Derivatives by the place in the first camera's frame, from those by the place in this one's: the chain rule.
    #[inline(always)]
    pub(super) fn turned(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = &self.pose.rotation;
        [a[0] * x + b[0] * y + c[0] * z, a[1] * x + b[1] * y + c[1] * z, a[2] * x + b[2] * y + c[2] * z]
    }

    /// How far a small step in the first camera's frame, mm, moves a ray on this camera's array, px at most.
    pub(super) fn moved_px(&self, step_mm: [f64; 3]) -> f64 {
        let [x, y, z] = self.along(step_mm);
        (x / self.pixel_mm).abs().max((y / self.pixel_mm).abs()).max(self.model.spread_px(z))
    }

    /// How far apart two places are sideways for this camera, pixels at its focal plane.
    pub(super) fn aside_px(&self, between_mm: [f64; 3]) -> f64 {
        let [x, y, _] = self.along(between_mm);
        x.abs().max(y.abs()) / self.pixel_mm
    }

    /// A step of the first camera's frame in this one's.
    fn along(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        self.pose.rotation.map(|[a, b, c]| a * x + b * y + c * z)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::buffers::Buffers;
    use crate::image::UNKNOWNS;
    use crate::joint::Setting;
    use crate::window::{Rectangle, Sheet, Window};
    use lf_core::Camera;
    use ndarray::Array2;

    pub(crate) const PIXEL_MM: f64 = 0.0055;
    pub(crate) const DEPTH_MM: [f64; 2] = [-3.0, 3.0];
    pub(crate) const NOISE: Noise = Noise { gain: 1.0, read_variance: 9.0 };
    /// At 90 degrees about y, its focal plane 1.2 mm beside the middle.
    pub(crate) const ASIDE: Pose =
        Pose { rotation: [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], translation_mm: [0.0, 0.0, 1.2] };

    pub(crate) fn model(lenslets: usize) -> ParticleModel {
        let side = 14 * lenslets;
        let camera = Camera::from_json(&format!(
            r#"{{"sensor": {{"width": {side}, "height": {side}, "pixel_pitch_mm": 0.0055}},
            "main_lens": {{"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0,
                "aperture": "square"}},
            "microlenses": {{"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308, "rotation_rad": 0.0,
                "offset_mm": [0.0, 0.0]}}}}"#
        ));
        ParticleModel::new(&camera.unwrap(), 0.75 * PIXEL_MM, DEPTH_MM).unwrap()
    }

    pub(crate) fn view(model: &ParticleModel, pose: Pose, light: f64) -> View {
        View { model: model.clone(), pose, light, noise: NOISE, pixel_mm: PIXEL_MM }
    }

    /// A window with all of both sensors.
    pub(crate) fn whole(first: &ParticleModel, further: &ParticleModel) -> Window {
        let images = [first, further].map(|model| {
            let [width, height] = model.sensor_px();
            Array2::<f32>::zeros((height, width))
        });
        let light: Vec<Vec<f32>> = images.iter().map(|image| vec![0.0; image.len()]).collect();
        let sheet = |n: usize| -> (Sheet, Rectangle) {
            ((images[n].view(), &light[n]), [[0, 0], [images[n].ncols(), images[n].nrows()]])
        };
        Window::cut_all(&[sheet(0), sheet(1)])
    }

    /// The numbers of a spot's image by pixel.
    pub(crate) fn numbers(setting: &Setting, spot: &Spot, window: &Window) -> Vec<[f64; UNKNOWNS]> {
        let mut sums = vec![[0.0; UNKNOWNS]; window.seen.len()];
        setting.image(spot, window, &mut Buffers::default()).pixels(window.columns, |n, pixel| {
            (0..UNKNOWNS).for_each(|k| sums[n][k] += f64::from(pixel[k]));
        });
        sums
    }

    /// A camera turned about no axis of the first, smaller and with half the light: derivatives by the place in the
    /// first camera's frame against differences.
    #[test]
    fn derivatives_of_a_posed_camera_are_those_of_its_light() {
        let turn = glam::DMat3::from_axis_angle(glam::DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.6).transpose();
        let rotation = [turn.x_axis, turn.y_axis, turn.z_axis].map(|row| row.to_array());
        let (first, small) = (model(30), model(24));
        let views = [view(&small, Pose { rotation, translation_mm: [0.1, -0.2, 0.3] }, 0.5)];
        let setting = Setting { model: &first, views: &views, noise: NOISE, pixel_mm: PIXEL_MM, depth_mm: DEPTH_MM };
        let window = whole(&first, &small);
        let spot = Spot { place_mm: [0.21, -0.13, 0.9], light: 1e5 };
        let said = numbers(&setting, &spot, &window);
        let own = |lines: &[[f64; UNKNOWNS]], camera: usize| -> f64 {
            (0..lines.len()).filter(|n| window.camera_of(*n) == camera).map(|n| lines[n][3]).sum()
        };
        assert!((own(&said, 0) / 1e5 - 1.0).abs() < 1e-3 && (own(&said, 1) / 5e4 - 1.0).abs() < 1e-3);
        for axis in 0..3 {
            let step = 0.02;
            let there = |by: f64| {
                let mut spot = spot;
                spot.place_mm[axis] += by * PIXEL_MM;
                numbers(&setting, &spot, &window)
            };
            let (before, after) = (there(-step), there(step));
            for camera in 0..2 {
                let (mut off, mut size) = (0.0, 0.0);
                for n in (0..said.len()).filter(|n| window.camera_of(*n) == camera) {
                    let slope = (after[n][3] - before[n][3]) / (2.0 * step);
                    off += (slope - said[n][axis]).powi(2);
                    size += slope * slope;
                }
                assert!(off < 1e-4 * size, "camera {camera}, axis {axis}: {:.1e}", (off / size).sqrt());
            }
        }
    }
}
