//! The list of cameras that see the particles.
//!
//! The frame of the first camera is that of the particles: its pose is the identity. A fit of one camera has a list of
//! one.

use super::defects::Defects;
use super::noise::{MOST_PIXELS, Noise};
use super::shape::{SHAPES, Shape};
use crate::particle::Particle;
use lf_core::camera::Pose;
use lf_core::particle_image::ParticleModel;
use lf_core::{Camera, Grid, Optics, Refusal};
use ndarray::{ArcArray2, Array2, s};
use rayon::prelude::*;
use std::ops::Range;

/// A camera, its image, and what the fit has found of it.
#[derive(Debug, Clone)]
pub struct CameraView<'a> {
    /// The camera, its lattice as it was calibrated.
    pub camera: &'a Camera,
    /// Size and drift.
    pub shape: Shape,
    /// Standard uncertainties of the shape, pixels; 0 for what is held, infinite if none was found.
    pub shape_std_px: [f64; SHAPES],
    /// The noise.
    pub noise: Noise,
    /// Its light of a particle over that of the first camera.
    pub light: f64,
    /// From the frame of the first camera to its own.
    pub pose: Pose,
    /// Standard uncertainties of a pose that was fitted: turns about the camera's axes, rad, and shifts along them, mm.
    pub pose_std: Option<([f64; 3], [f64; 3])>,
    /// Particles that it found alone.
    pub particles_alone: usize,
    /// Particles that it shares with the cameras before it.
    pub shared: usize,
    /// A pixel at its focal plane, mm.
    pub(crate) pixel_mm: f64,
    /// Depths between which particles are held, mm, in its own frame.
    pub(crate) depth_mm: [f64; 2],
    pub(crate) model: ParticleModel,
    /// Its image; NaN where a pixel is blind.
    pub(crate) image: ArcArray2<f32>,
    /// Defects of its sensor, which the fit has made blind.
    pub defects: Defects,
    /// The share of its light that each pixel counts; None if that is 1 everywhere.
    pub flat: Option<&'a Array2<f32>>,
    /// Expected counts of each pixel of the image.
    pub(crate) expected: Vec<f32>,
    /// Expected counts beside those of particles' images, which a pass over the particles holds: the far light of
    /// diffraction. None if nothing diffracts.
    pub(crate) far: Option<Vec<f32>>,
    /// Counts that waves at the rim of the stop add, held like it. None if waves are not followed.
    pub(crate) waves: Option<Vec<f32>>,
}

/// Particles may leave the depths of the volume by this number of pixels of the focal plane.
pub(crate) const BEYOND_PX: f64 = 40.0;
/// The scan reaches particles this many depths of focus from the focal plane.
const SCAN_DEPTHS: f64 = 22.0;
/// The misfit leaves out this number of lenslets at the image's edges: particles beside it, which no voxel stands for,
/// light them.
const RIM: f64 = 3.0;
/// The misfit counts pixels that are expected to be brighter than this many times the noise of a dark one, and cuts
/// each square at the second number.
const LIT: f32 = 3.0;
const MOST_SQUARE: f32 = 25.0;

/// Depths between which the particles of a volume are held, mm.
pub(crate) fn depths_mm(camera: &Camera, grid: &Grid) -> [f64; 2] {
    let beyond = BEYOND_PX * camera.pixel_in_focus_mm();
    [grid.centre_mm(2, 0) - beyond, grid.centre_mm(2, grid.shape[2] - 1) + beyond]
}

impl<'a> CameraView<'a> {
    /// A camera on its own, without light on its sensor yet.
    pub(crate) fn new(
        camera: &'a Camera,
        (image, flat): (&ArcArray2<f32>, Option<&'a Array2<f32>>),
        shape: Shape,
        depth_mm: [f64; 2],
        noise: Noise,
    ) -> Result<Self, Refusal> {
        let model = shape.model(camera, depth_mm)?;
        Ok(Self {
            camera,
            shape,
            shape_std_px: [f64::INFINITY; SHAPES],
            noise,
            light: 1.0,
            pose: Pose::default(),
            pose_std: None,
            particles_alone: 0,
            shared: 0,
            pixel_mm: camera.pixel_in_focus_mm(),
            depth_mm,
            far: model.halo().map(|_| vec![0.0; image.len()]),
            waves: model.follows_waves().then(|| vec![0.0; image.len()]),
            model,
            image: image.clone(),
            defects: Defects::default(),
            flat,
            expected: vec![0.0; image.len()],
        })
    }

    /// The camera with another shape and other depths, without expected counts.
    pub(crate) fn reshaped(&self, shape: Shape, depth_mm: [f64; 2]) -> Result<Self, Refusal> {
        let model = shape.model_after(&self.model, self.camera, depth_mm)?;
        let (image, defects) = (self.image.clone(), self.defects.clone());
        Ok(Self { shape, depth_mm, model, image, defects, expected: Vec::new(), far: None, waves: None, ..*self })
    }

    /// Takes a shape and its standard uncertainties.
    pub(crate) fn set_shape(&mut self, shape: Shape, std_px: [f64; SHAPES]) -> Result<(), Refusal> {
        self.model = shape.model_after(&self.model, self.camera, self.depth_mm)?;
        (self.shape, self.shape_std_px) = (shape, std_px);
        Ok(())
    }

    /// Forgets all expected counts but those of waves.
    pub(crate) fn darken(&mut self) {
        self.far.iter_mut().for_each(|far| far.fill(0.0));
        match &self.waves {
            Some(waves) => self.expected.copy_from_slice(waves),
            None => self.expected.fill(0.0),
        }
    }

    /// The light of a pixel that is held.
    pub(crate) fn held(&self, pixel: usize) -> f32 {
        [&self.far, &self.waves].into_iter().flatten().map(|light| light[pixel]).sum()
    }

    /// Takes the far light of diffraction away.
    pub(crate) fn take_far(&mut self) {
        if let Some(far) = &self.far {
            self.expected.iter_mut().zip(far).for_each(|(expected, far)| *expected -= far);
        }
    }

    /// Spreads the far light of diffraction anew, around the light that is expected now.
    pub(crate) fn spread_far(&mut self) {
        let (Some(far), Some(halo)) = (&mut self.far, self.model.halo()) else { return };
        *far = halo.around(&self.expected, self.image.ncols());
        self.expected.iter_mut().zip(&*far).for_each(|(expected, far)| *expected += far);
    }

    /// Puts the light of particles aside where waves are followed, to sum what the rim of the stop adds: from zero if
    /// this `is_anew`, and otherwise from the last sum.
    pub(crate) fn put_aside(&mut self, is_anew: bool) {
        let Some(waves) = &mut self.waves else { return };
        self.expected.iter_mut().zip(&*waves).for_each(|(expected, waves)| *expected -= waves);
        std::mem::swap(&mut self.expected, waves);
        if is_anew {
            self.expected.fill(0.0);
        }
    }

    /// Takes the light of particles back, and holds what was found.
    pub(crate) fn take_back(&mut self) {
        let Some(waves) = &mut self.waves else { return };
        std::mem::swap(&mut self.expected, waves);
        self.expected.iter_mut().zip(&*waves).for_each(|(expected, waves)| *expected += waves);
    }

    /// Columns and rows of its sensor.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.image.ncols(), self.image.nrows()]
    }

    /// A particle in the frame of this camera, with the light that it sends there.
    pub(crate) fn seen(&self, particle: &Particle) -> Particle {
        Particle { place_mm: self.pose.to_camera(particle.place_mm), light: self.light * particle.light, ..*particle }
    }

    /// The image as the fit explains it, counts; blind pixels have light too.
    pub fn expected(&self) -> Array2<f32> {
        Array2::from_shape_fn(self.image.dim(), |(row, column)| self.expected[row * self.image.ncols() + column])
    }

    /// The rotation that takes derivatives from the frame of this camera to that of the first; None for the identity.
    pub(crate) fn rotation(&self) -> Option<&[[f64; 3]; 3]> {
        let rotation = &self.pose.rotation;
        (*rotation != Pose::default().rotation).then_some(rotation)
    }

    /// Pixels of the array by which a small step in the frame of the first camera, mm, moves a ray at most.
    pub(crate) fn moved_px(&self, step_mm: [f64; 3]) -> f64 {
        let [x, y, z] = self.along(step_mm);
        (x / self.pixel_mm).abs().max((y / self.pixel_mm).abs()).max(self.model.spread_px(z))
    }

    /// Whether two places lie within `aside_mm` of each other sideways for this camera.
    fn is_beside(&self, between_mm: [f64; 3], aside_px: f64) -> bool {
        let [x, y, _] = self.along(between_mm);
        x.abs().max(y.abs()) < aside_px * self.pixel_mm
    }

    /// A step in the frame of the first camera, turned into the frame of this one.
    fn along(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        self.pose.rotation.map(|[a, b, c]| a * x + b * y + c * z)
    }

    /// Depth from focus over which a scan is worth its time, mm.
    pub(crate) fn near_focus_mm(&self) -> f64 {
        SCAN_DEPTHS * self.depth_of_focus_mm()
    }

    /// The depth that spreads a point by one pixel on the array.
    pub(crate) fn depth_of_focus_mm(&self) -> f64 {
        let optics = Optics::new(self.camera);
        let slope = (optics.alpha(0.05) - optics.alpha(-0.05)).abs() / 0.1;
        self.camera.sensor.pixel_pitch_mm / (slope * 2.0 * optics.half_aperture_mm)
    }

    /// Expected counts of the lit pixels, and the differences of the image. Takes every n-th row of a large image, for
    /// at most [`MOST_PIXELS`].
    pub(crate) fn noise_pairs(&self) -> Vec<(f32, f32)> {
        let apart = self.image.len().div_ceil(MOST_PIXELS);
        let rows = self.image.rows().into_iter().zip(self.expected.chunks(self.image.ncols())).step_by(apart);
        let pixels = rows.flat_map(|(seen, light)| seen.into_iter().zip(light));
        let lit = pixels.filter(|(seen, light)| !seen.is_nan() && **light > 0.0);
        lit.map(|(seen, light)| (*light, seen - light)).collect()
    }

    /// Makes the defects that its expected counts show blind. Returns whether there are new ones.
    pub(crate) fn blind_defects(&mut self) -> bool {
        self.defects.blind(&mut self.image, &self.expected, self.noise, self.camera.pitch_px())
    }

    /// -2 log likelihood of all pixels, each of a normal distribution: squares over variances, which are cut, and
    /// logarithms of variances. Without these, too much light looks good, because it explains large differences.
    pub(crate) fn deviance(&self) -> f64 {
        let width = self.image.ncols();
        let of_row = |row: usize| {
            let pixels = self.image.row(row).into_iter().zip(&self.expected[row * width..(row + 1) * width]);
            let terms = pixels.filter(|(seen, _)| !seen.is_nan()).map(|(seen, light)| {
                let variance = self.noise.variance(*light);
                f64::from(((seen - light).powi(2) / variance).min(MOST_SQUARE) + variance.ln())
            });
            terms.sum::<f64>()
        };
        // Rows are added up in their order, for the same sum by any number of threads.
        let rows: Vec<f64> = (0..self.image.nrows()).into_par_iter().map(of_row).collect();
        rows.iter().sum()
    }

    /// Squared differences over variances of the pixels that are expected to be lit, by row: sum and number of pixels.
    fn misfits(&self) -> Vec<(f64, usize)> {
        let of_row = |row: usize| {
            let squares = self.differences(row, self.lit()).into_iter().filter(|difference| !difference.is_nan());
            squares.fold((0.0, 0), |(sum, count), difference| (sum + f64::from(difference * difference), count + 1))
        };
        (0..self.image.nrows()).into_par_iter().map(of_row).collect()
    }

    /// Pixels along an axis of the image, 0 for rows, that particles outside it hardly light.
    fn inner(&self, axis: usize) -> Range<usize> {
        let size = self.image.shape()[axis];
        let rim = ((RIM * self.camera.pitch_px()) as usize).min(size / 4);
        rim..size - rim
    }

    /// Expected counts above which a pixel is lit.
    pub(crate) fn lit(&self) -> f32 {
        LIT * self.noise.gain.max(self.noise.read_variance.sqrt()) as f32
    }

    /// The differences of a row: see [`Self::difference`]. Empty beside the image's edges, without the pixels at its
    /// ends.
    pub(crate) fn differences(&self, row: usize, least: f32) -> Vec<f32> {
        if !self.inner(0).contains(&row) {
            return Vec::new();
        }
        let inner = self.inner(1);
        let expected = &self.expected[row * self.image.ncols()..][inner.clone()];
        let pixels = self.image.slice(s![row, inner]).into_iter().zip(expected);
        pixels.map(|(seen, light)| self.difference(*seen, *light, least)).collect()
    }

    /// The difference of a pixel over its standard deviation, cut at the root of the largest square; NaN if it is blind
    /// or expected to have no more than `least` counts.
    pub(crate) fn difference(&self, seen: f32, light: f32, least: f32) -> f32 {
        let most = MOST_SQUARE.sqrt();
        let difference = ((seen - light) / self.noise.variance(light).sqrt()).clamp(-most, most);
        if light > least { difference } else { f32::NAN }
    }
}

/// The cameras of a fit, the first one first.
#[derive(Debug, Clone)]
pub(crate) struct Cameras<'a> {
    pub(crate) views: Vec<CameraView<'a>>,
}

impl<'a> Cameras<'a> {
    /// The camera in whose frame the particles lie.
    pub(crate) fn first(&self) -> &CameraView<'a> {
        &self.views[0]
    }

    /// A pixel at the focal plane of the first camera, mm: the unit of all steps.
    pub(crate) fn pixel_mm(&self) -> f64 {
        self.views[0].pixel_mm
    }

    /// Whether two places lie within `aside_px` pixels of the focal plane, sideways for any of the cameras.
    pub(crate) fn is_beside(&self, one: [f64; 3], other: [f64; 3], aside_px: f64) -> bool {
        let between = std::array::from_fn(|axis| one[axis] - other[axis]);
        self.views.iter().any(|view| view.is_beside(between, aside_px))
    }

    /// Mean of squared differences over variances where light is expected.
    pub(crate) fn misfit(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        // Rows are added up in their order, for the same sum by any number of threads.
        for (more, pixels) in self.views.iter().flat_map(CameraView::misfits) {
            sum += more;
            count += pixels;
        }
        if count > 0 { sum / count as f64 } else { 1.0 }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::model::particle_image::{COUNTS, ParticleImage, UNKNOWNS};
    use crate::model::window::Window;

    pub(crate) const PIXEL_MM: f64 = 0.0055;
    pub(crate) const DEPTH_MM: [f64; 2] = [-3.0, 3.0];
    pub(crate) const NOISE: Noise = Noise { gain: 1.0, read_variance: 9.0 };
    /// At 90 degrees about y, its focal plane 1.2 mm beside the middle.
    pub(crate) const ASIDE: Pose =
        Pose { rotation: [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], translation_mm: [0.0, 0.0, 1.2] };

    /// A camera and its dark image.
    pub(crate) struct Sight {
        camera: Camera,
        image: ArcArray2<f32>,
    }

    impl Sight {
        pub(crate) fn new(lenslets: usize) -> Self {
            let side = 14 * lenslets;
            let camera = Camera::from_json(&format!(
                r#"{{"sensor": {{"width": {side}, "height": {side}, "pixel_pitch_mm": 0.0055}},
                "main_lens": {{"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0,
                    "aperture": "square"}},
                "microlenses": {{"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308, "rotation_rad": 0.0,
                    "offset_mm": [0.0, 0.0]}}}}"#
            ));
            Self { camera: camera.unwrap(), image: ArcArray2::zeros((side, side)) }
        }

        pub(crate) fn fill(&mut self, value: impl Fn(usize, usize) -> f32) {
            self.image = ArcArray2::from_shape_fn(self.image.dim(), |(row, column)| value(row, column));
        }
    }

    pub(crate) fn view(sight: &Sight, pose: Pose, light: f64) -> CameraView<'_> {
        let shape =
            Shape { sigma_px: 0.75, drift_px: [0.0; 2], blur_px: None, pattern: None, lens_px: Default::default() };
        let view = CameraView::new(&sight.camera, (&sight.image, None), shape, DEPTH_MM, NOISE).unwrap();
        CameraView { pose, light, ..view }
    }

    /// A window with all of all sensors.
    pub(crate) fn whole(cameras: &Cameras) -> Window {
        let rectangles: Vec<_> = cameras.views.iter().map(|view| [[0, 0], view.size()]).collect();
        Window::cut(&cameras.views, &rectangles)
    }

    /// The numbers of a particle's image by pixel.
    pub(crate) fn numbers(cameras: &Cameras, particle: &Particle, window: &Window) -> Vec<[f64; UNKNOWNS]> {
        let mut sums = vec![[0.0; UNKNOWNS]; window.seen.len()];
        ParticleImage::new(cameras, particle, window, &mut Default::default()).pixels(window.columns, |n, pixel| {
            (0..UNKNOWNS).for_each(|k| sums[n][k] += f64::from(pixel[k]));
        });
        sums
    }

    /// The counts of a flat field are its share of the light, and so are all derivatives.
    #[test]
    fn a_flat_field_takes_its_share() {
        let sight = Sight::new(12);
        let share = |column: usize| if column < 84 { 1.0 } else { 0.25 };
        let flat = Array2::from_shape_fn(sight.image.dim(), |(_, column)| share(column));
        let even = Cameras { views: vec![view(&sight, Pose::default(), 1.0)] };
        let shaded = Cameras { views: vec![CameraView { flat: Some(&flat), ..even.first().clone() }] };
        let window = whole(&even);
        let particle = Particle::new([0.01, -0.02, 0.8], 1e5);
        let [wanted, found] = [&even, &shaded].map(|cameras| numbers(cameras, &particle, &window));
        let slopes = |cameras: &Cameras| {
            let mut sums = vec![0f32; window.seen.len()];
            let (_, slopes) = ParticleImage::with_slopes(cameras, &particle, &window, &mut Default::default());
            slopes.iter().for_each(|(n, slopes)| sums[*n as usize] += slopes[0]);
            sums
        };
        let [wanted_size, found_size] = [slopes(&even), slopes(&shaded)];
        let mut lit = [0; 2];
        for n in 0..wanted.len() {
            let share = share(n % window.columns);
            lit[usize::from(share < 1.0)] += usize::from(wanted[n][COUNTS] > 100.0);
            for k in 0..UNKNOWNS {
                let off = found[n][k] - f64::from(share) * wanted[n][k];
                assert!(off.abs() <= 1e-5 * wanted[n][k].abs(), "{n} {k}: {off}");
            }
            assert!((found_size[n] - share * wanted_size[n]).abs() <= 1e-5 * wanted_size[n].abs());
        }
        assert!(lit.iter().all(|lit| *lit > 50), "{lit:?}");
    }

    /// A camera turned about no axis of the first, smaller and with half the light: derivatives by the place in the
    /// first camera's frame against differences.
    #[test]
    fn derivatives_of_a_posed_camera_are_those_of_its_light() {
        let turn = glam::DMat3::from_axis_angle(glam::DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.6).transpose();
        let rotation = [turn.x_axis, turn.y_axis, turn.z_axis].map(|row| row.to_array());
        let sights = [Sight::new(30), Sight::new(24)];
        let posed = view(&sights[1], Pose { rotation, translation_mm: [0.1, -0.2, 0.3] }, 0.5);
        let cameras = Cameras { views: vec![view(&sights[0], Pose::default(), 1.0), posed] };
        let window = whole(&cameras);
        let particle = Particle::new([0.21, -0.13, 0.9], 1e5);
        let found = numbers(&cameras, &particle, &window);
        let own = |lines: &[[f64; UNKNOWNS]], camera: usize| -> f64 {
            (0..lines.len()).filter(|n| window.camera_of(*n) == camera).map(|n| lines[n][COUNTS]).sum()
        };
        assert!((own(&found, 0) / 1e5 - 1.0).abs() < 1e-3 && (own(&found, 1) / 5e4 - 1.0).abs() < 1e-3);
        for axis in 0..3 {
            let step = 0.02;
            let there = |by: f64| {
                let mut particle = particle;
                particle.place_mm[axis] += by * PIXEL_MM;
                numbers(&cameras, &particle, &window)
            };
            let (before, after) = (there(-step), there(step));
            for camera in 0..2 {
                let (mut off, mut size) = (0.0, 0.0);
                for n in (0..found.len()).filter(|n| window.camera_of(*n) == camera) {
                    let slope = (after[n][COUNTS] - before[n][COUNTS]) / (2.0 * step);
                    off += (slope - found[n][axis]).powi(2);
                    size += slope * slope;
                }
                assert!(off < 1e-4 * size, "camera {camera}, axis {axis}: {:.1e}", (off / size).sqrt());
            }
        }
    }

    /// Two cameras without poses: the second one counts as turned by nothing, and sees what the first one sees.
    #[test]
    fn an_identity_turns_nothing() {
        let sight = Sight::new(20);
        let cameras = Cameras { views: vec![view(&sight, Pose::default(), 1.0), view(&sight, Pose::default(), 1.0)] };
        assert!(cameras.first().rotation().is_none());
        let window = whole(&cameras);
        let found = numbers(&cameras, &Particle::new([0.1, -0.05, 0.7], 1e5), &window);
        assert!(found[..found.len() / 2] == found[found.len() / 2..]);
    }
}
