//! The keys of a `scene.json`. An effect without a key is not modelled and costs no time.

use super::dots::Dots;
use crate::rays::{Diffraction, Glow, RayCount, SecondStop, Shape, ThickLens};
use crate::{particles::Sheet, sensor::SensorNoise};
use lf_core::scene::{CameraSource, Frames, LitVolume};
use lf_core::{Camera, Grid, Refusal, flow::Flows, frame::Frame};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// A description of the scene in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
    /// The frame of the volume, the particles and the flow. A scene may lack it.
    #[serde(default)]
    pub frame: Frame,
    /// The camera, or the path of its file from the scene's folder.
    pub camera: CameraSource,
    /// Diffraction at the lenslets that the written camera does not know of. `camera.blur` is blur that it knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diffraction: Option<Diffraction>,
    /// Whether the light of a particle is one wave in the stop and the lenslets. Else each lenslet diffracts alone.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub coherent_light: bool,
    /// A second stop on the axis, which cuts the beam off the axis (cat's-eye vignetting).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_stop: Option<SecondStop>,
    /// The main lens by its surfaces, in place of the camera's. The written camera describes it as a data sheet would.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thick_lens: Option<ThickLens>,
    /// The volume in which particles are lit.
    pub volume: LitVolume,
    /// The particles.
    pub particles: Particles,
    /// The laser sheet. If absent, the light is even along z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<Sheet>,
    /// The flow that moves the particles; several flows add up. If absent, the particles stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<Flows>,
    /// Number of frames, a unit of time apart; or their times.
    #[serde(default)]
    pub frames: Frames,
    /// The sensor. If absent, frames hold the expected counts without noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_noise: Option<SensorNoise>,
    /// The exact volumes and displacements that are written beside the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<Truth>,
    /// The white image.
    #[serde(default)]
    pub white: White,
    /// The dot target.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dots: Option<Dots>,
    /// Seed of all random numbers.
    #[serde(default)]
    pub seed: u64,
}

/// The particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// Particles for each lenslet that the volume covers at the focal plane. A scene has this or `count` or `csv`; none
    /// of them if its flow is a table of tracks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub per_lenslet: Option<f64>,
    /// Number of particles in the volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// Path, from the scene's folder, of a `particles.csv` with the particles of the first frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub csv: Option<PathBuf>,
    /// Standard deviation of a Gaussian particle image at the focal plane, px. A scene has this or `diameter_px`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_px: Option<f64>,
    /// Diameter of an even disc as the particle image at the focal plane, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diameter_px: Option<f64>,
    /// Standard deviation of the image sizes over their mean, log-normal. If absent, all are the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_spread: Option<f64>,
    /// Counts that one particle sends through the aperture.
    #[serde(default = "super::dots::default_intensity")]
    pub intensity: f64,
    /// Standard deviation of the intensities over their mean, log-normal. If absent, all are the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intensity_spread: Option<f64>,
    /// Wanted noise of the ray tracing: root mean square error of a frame's lit pixels over its brightest pixel. A
    /// scene has this or `rays`; 0.01 if it has neither.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ray_noise: Option<f64>,
    /// Rays for each particle and frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rays: Option<u32>,
}

/// Sizes of the exact volumes and displacements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Pixels per voxel along x, y, z.
    pub pixels_per_voxel: [f64; 3],
    /// Standard deviation of a particle in the exact volume, voxels. The paper's particles, 3 voxels wide, have 0.75.
    pub sigma_vox: f64,
    /// Number of vectors of the exact displacement along x, y, z. The outermost lie on the bounds.
    pub vectors: [usize; 3],
}

/// The white image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct White {
    /// Counts of a pixel that sees only lit aperture.
    pub counts: f64,
    /// Rays for each lenslet.
    pub rays_per_lenslet: u32,
    /// Working f-number of the lens for the white image. If absent, that of the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub working_f_number: Option<f64>,
}

impl Default for White {
    fn default() -> Self {
        Self { counts: 1000.0, rays_per_lenslet: 40_000, working_f_number: None }
    }
}

impl Scene {
    /// Takes relative paths from a folder, except that of the camera. Returns the files that the scene needs.
    pub fn join(&mut self, folder: &Path) -> Vec<PathBuf> {
        let mut files = Vec::new();
        if let Some(csv) = &mut self.particles.csv {
            *csv = folder.join(&*csv);
            files.push(csv.clone());
        }
        if let Some(flow) = &mut self.flow {
            flow.join(folder);
            files.extend(flow.sampled().into_iter().chain(flow.tracks()).map(Path::to_path_buf));
        }
        if let Some(noise) = &mut self.sensor_noise {
            noise.background = noise.background.take().map(|file| folder.join(file));
            files.extend(noise.background.clone());
        }
        files.extend(self.camera.file(folder));
        files
    }

    /// The grid of the exact volumes. None if the scene asks for no truth. Refuses a grid without voxels.
    pub fn grid(&self, camera: &Camera) -> Result<Option<Grid>, Refusal> {
        let in_bounds = |truth: &Truth| {
            Grid::in_bounds(self.volume.bounds_mm(), camera.voxel_spacing_mm(truth.pixels_per_voxel))
                .map_err(|Refusal { found, wanted }| Refusal::new(format!("truth: {found}"), wanted))
        };
        self.truth.as_ref().map(in_bounds).transpose()
    }

    /// The light that a particle sends out.
    pub fn glow(&self, camera: &Camera) -> Glow {
        let p = &self.particles;
        let (shape, size_px) = match p.diameter_px {
            Some(diameter) => (Shape::Disc, 0.5 * diameter),
            None => (Shape::Gaussian, p.sigma_px.unwrap_or(0.0)),
        };
        Glow { shape, size_mm: size_px * camera.pixel_in_focus_mm(), rays: self.rays(p.intensity) }
    }

    /// Number of rays of a particle, from the average intensity.
    pub fn rays(&self, average_intensity: f64) -> RayCount {
        let Particles { rays, ray_noise, .. } = self.particles;
        rays.map_or_else(|| RayCount::for_noise(ray_noise.unwrap_or(0.01), average_intensity), RayCount::Fixed)
    }

    /// Number of particles in the volume, from the density or the count. Not for scenes with a `csv` or tracks.
    pub fn particle_count(&self, camera: &Camera) -> f64 {
        let Particles { count, per_lenslet, .. } = self.particles;
        let on_array = |[low, high]: [f64; 2]| (high - low) * camera.main_lens.magnification;
        let lenslets = on_array(self.volume.x_mm) * on_array(self.volume.y_mm) / camera.lattice().cell_area_mm2();
        count.map_or((per_lenslet.unwrap_or(0.0) * lenslets).round(), |count| count as f64)
    }

    /// Share, 0 to 1, of the volume's cross-section at the focal plane that the sensor does not see.
    pub fn unseen_share(&self, camera: &Camera) -> f64 {
        let seen = |[low, high]: [f64; 2], half: f64| ((high.min(half) - low.max(-half)) / (high - low)).max(0.0);
        let [half_x, half_y] = camera.half_view_mm();
        let [x_mm, y_mm, _] = self.seen_bounds_mm(camera);
        1.0 - seen(x_mm, half_x) * seen(y_mm, half_y)
    }
}
