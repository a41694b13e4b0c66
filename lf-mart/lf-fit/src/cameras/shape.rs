//! The unknowns that all particles share in one camera: their size, the drift of the camera's lattice, the blur of its
//! sensor, and corrections of its parameters.
//!
//! Another such unknown needs a field here with its lines in `values`, `moved`, `scales` and `model`, its flag in
//! [`Free`], and its derivative among [`lf_core::particle_image::QUANTITIES`]. A parameter of the camera needs only an
//! entry in [`lf_core::camera::PARAMETERS`].

use super::lens::{LENSES, corrections};
use lf_core::camera::{Blur, COUNT, Correction, GREEN_NM, LensletPattern, PARAMETERS, stepped};
use lf_core::particle_image::ParticleModel;
use lf_core::{Camera, Refusal};

/// Number of unknowns in a shape, the parameters of the camera last, and of those before.
pub(crate) const SHAPES: usize = ANALYTIC + LENSES;
pub(crate) const ANALYTIC: usize = 4;
/// A parameter of the camera is off by at least this number of standard uncertainties, and by this number of pixels:
/// spare particles of a first fit look like less.
const SURE: f64 = 5.0;
pub(crate) const LEAST_PX: f64 = 0.02;
/// Smallest and largest size, pixels.
const SIZES_PX: [f64; 2] = [0.15, 5.0];
/// Smallest and largest blur, pixels. A smaller one cannot be seen, and has no slope to grow by.
const BLURS_PX: [f64; 2] = [0.05, 3.0];
/// Standard deviation of the blur that is tried where no camera file names one, pixels. Its light is green.
const UNNAMED_PX: f64 = 0.15;

/// Size, drift and blur, pixels: of the focal plane, and of the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Standard deviation of a particle, pixels of the focal plane.
    pub sigma_px: f64,
    /// Shift of the lattice against the camera's, pixels.
    pub drift_px: [f64; 2],
    /// Standard deviation of the blur's Gaussian, pixels of the sensor; None for a sharp camera.
    pub blur_px: Option<f64>,
    /// The pattern of a lenslet that explains the image better than the camera's; None for the camera's own.
    pub pattern: Option<LensletPattern>,
    /// Corrections of the camera's parameters, pixels by which they move light at most.
    pub lens_px: [f64; LENSES],
}

/// The shared unknowns that are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Free {
    /// The size.
    pub size: bool,
    /// Sizes of the particles' own, where they differ.
    pub sizes: bool,
    /// The drift.
    pub drift: bool,
    /// The blur, of a camera that has one or whose image shows one.
    pub blur: bool,
    /// Parameters of a camera that does not explain its image.
    pub camera: bool,
    /// The parameters of the camera that are fitted now.
    pub lens: [bool; LENSES],
    /// The poses of further cameras.
    pub pose: bool,
}

impl Free {
    /// Whether each unknown of a shape is fitted.
    pub(crate) fn shapes(&self, shape: &Shape) -> [bool; SHAPES] {
        let own = [self.size, self.drift, self.drift, self.blur && shape.blur_px.is_some()];
        std::array::from_fn(|k| if k < ANALYTIC { own[k] } else { self.lens[k - ANALYTIC] })
    }
}

impl Shape {
    /// The model of particles of this shape.
    pub(crate) fn model(&self, camera: &Camera, depth_mm: [f64; 2]) -> Result<ParticleModel, Refusal> {
        ParticleModel::new(&self.camera(camera), self.sigma_px * camera.pixel_in_focus_mm(), depth_mm)
    }

    /// Like [`Self::model`], from the model of another shape of the camera.
    pub(crate) fn model_after(
        &self,
        other: &ParticleModel,
        camera: &Camera,
        depth_mm: [f64; 2],
    ) -> Result<ParticleModel, Refusal> {
        other.reshaped(&self.camera(camera), self.sigma_px * camera.pixel_in_focus_mm(), depth_mm)
    }

    /// The first shape of a camera: its own blur.
    pub(crate) fn first(&self, camera: &Camera) -> Self {
        let blur_px = camera.blur.map(|blur| blur.sigma_px.clamp(BLURS_PX[0], BLURS_PX[1]));
        Self { blur_px, ..*self }
    }

    /// The shape from which the blur of a camera that names none is searched.
    pub(crate) fn blurred(&self) -> Self {
        Self { blur_px: Some(UNNAMED_PX), ..*self }
    }

    /// The unknowns that stand at an end of their range, with the end, px.
    pub fn at_bounds(&self) -> Vec<(&'static str, f64)> {
        // Means of steps and of logarithms end beside it by rounding.
        let is_at = |px: f64, end: f64| (px / end - 1.0).abs() < 1e-6;
        let size = SIZES_PX.iter().find(|end| is_at(self.sigma_px, **end)).map(|end| ("size", *end));
        let blur = self.blur_px.filter(|px| is_at(*px, BLURS_PX[1])).map(|px| ("blur", px));
        size.into_iter().chain(blur).collect()
    }

    /// Whether a parameter of the camera is surely off.
    pub(crate) fn is_corrected(&self, lens: usize, std_px: [f64; SHAPES]) -> bool {
        self.lens_px[lens].abs() > (SURE * std_px[ANALYTIC + lens]).max(LEAST_PX)
    }

    /// The parameters of the camera that were corrected; `std_px` are the standard uncertainties of the shape.
    pub fn corrections(&self, camera: &Camera, std_px: [f64; SHAPES]) -> Vec<Correction> {
        corrections(camera, self.lens_px, &std_px[ANALYTIC..])
    }

    /// The camera with its lattice, its blur and its parameters as they are found.
    pub fn camera(&self, camera: &Camera) -> Camera {
        let [_, steps @ ..] = Self { blur_px: None, ..*self }.values();
        let mut moved = stepped(camera, PARAMETERS.iter().zip(steps));
        if let Some(sigma_px) = self.blur_px {
            let green_nm = camera.wavelength_of_nm(GREEN_NM);
            let green = Blur { wavelength_nm: Some(green_nm), ..Blur::default() };
            let blur = camera.blur.unwrap_or(green);
            moved.blur = Some(Blur { sigma_px, pattern: self.pattern.or(blur.pattern), ..blur });
        }
        moved
    }

    /// The steps from the camera's parameters to those that were found, px.
    pub(crate) fn steps_px(&self, camera: &Camera) -> [f64; COUNT] {
        let [_, mut steps @ ..] = self.values();
        steps[2] -= camera.blur.map_or(0.0, |blur| blur.sigma_px);
        steps
    }

    fn values(&self) -> [f64; SHAPES] {
        let own = [self.sigma_px, self.drift_px[0], self.drift_px[1], self.blur_px.unwrap_or(0.0)];
        std::array::from_fn(|k| if k < ANALYTIC { own[k] } else { self.lens_px[k - ANALYTIC] })
    }

    /// Whether an unknown differs from that of another shape by more than its standard uncertainty.
    pub(crate) fn is_beyond(&self, other: &Self, std: [f64; SHAPES]) -> bool {
        let (own, other) = (self.values(), other.values());
        (0..SHAPES).any(|k| (own[k] - other[k]).abs() > std[k])
    }

    /// Which unknowns a step takes out of their ranges.
    pub(crate) fn beyond_range(&self, step: [f64; SHAPES]) -> [bool; SHAPES] {
        let is_beyond =
            |value: f64, step: f64, [low, high]: [f64; 2]| step != 0.0 && !(low..=high).contains(&(value + step));
        let blur = self.blur_px.is_some_and(|px| is_beyond(px, step[3], BLURS_PX));
        let size = is_beyond(self.sigma_px, step[0], SIZES_PX);
        std::array::from_fn(|k| (k == 0 && size) || (k == 3 && blur))
    }

    /// The shape after a step.
    pub(crate) fn moved(&self, step: [f64; SHAPES]) -> Self {
        let [size, x, y, blur, ..] = step;
        let sigma_px = (self.sigma_px + size).clamp(SIZES_PX[0], SIZES_PX[1]);
        let blur_px = self.blur_px.map(|px| (px + blur).clamp(BLURS_PX[0], BLURS_PX[1]));
        let lens_px = std::array::from_fn(|k| self.lens_px[k] + step[ANALYTIC + k]);
        Self { sigma_px, drift_px: [self.drift_px[0] + x, self.drift_px[1] + y], blur_px, lens_px, ..*self }
    }

    /// A step of one pixel in the units of the model's derivatives: mm, and for the blur pixels of its middle.
    pub(crate) fn scales(&self, camera: &Camera) -> [f64; ANALYTIC] {
        let pitch_mm = camera.sensor.pixel_pitch_mm;
        let core_px = self.camera(camera).blur_core_px();
        let by_core = self.blur_px.map_or(0.0, |px| px / core_px);
        [camera.pixel_in_focus_mm(), pitch_mm, pitch_mm, by_core]
    }
}
