//! What to render: `scene.json`. An effect without a key is not modelled and costs nothing.

use crate::flow::Flow;
use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// What the scene stands for, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
    /// The camera, or the path of its file from the scene's folder.
    pub camera: CameraSource,
    /// Where particles are lit.
    pub volume: Volume,
    /// The particles.
    pub particles: Particles,
    /// How they move from frame to frame; absent, they stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<Flow>,
    /// Number of frames, one unit of time apart.
    #[serde(default = "two")]
    pub frames: usize,
    /// The exact volumes and displacements written beside the frames.
    #[serde(default)]
    pub truth: Truth,
    /// The flat field.
    #[serde(default)]
    pub white: White,
    /// Seed of all that is random.
    #[serde(default)]
    pub seed: u64,
}

/// A camera in place or by path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum CameraSource {
    /// Path of a camera file.
    Path(PathBuf),
    /// The camera itself.
    Camera(serde_json::Value),
}

/// Bounds of the lit volume, mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Volume {
    /// Low and high bound along x.
    pub x_mm: [f64; 2],
    /// Low and high bound along y.
    pub y_mm: [f64; 2],
    /// Low and high bound along z.
    pub z_mm: [f64; 2],
}

/// The particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// Particles for each lenslet that the volume covers at the focal plane; this or `count` or `csv`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub per_lenslet: Option<f64>,
    /// Particles in the volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// Particles of the first frame from a `particles.csv`, path from the scene's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub csv: Option<PathBuf>,
    /// Standard deviation of the Gaussian particle image at the focal plane, px.
    pub sigma_px: f64,
    /// Counts that one particle sends through the aperture.
    #[serde(default = "default_intensity")]
    pub intensity: f64,
    /// Rays cast for each particle and frame.
    #[serde(default = "default_rays")]
    pub rays: u32,
}

/// The exact volumes and displacements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Pixels per voxel along x, y, z.
    pub pixels_per_voxel: [f64; 3],
    /// Standard deviation of a particle in the exact volume, voxels. 0.75 makes the paper's particle 3 voxels across.
    pub sigma_vox: f64,
    /// Vectors of the exact displacement along x, y, z, from bound to bound.
    pub vectors: [usize; 3],
}

/// The flat field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct White {
    /// Counts of a pixel that sees nothing but lit aperture.
    pub counts: f64,
    /// Rays cast through each lenslet.
    pub rays_per_lenslet: u32,
    /// Working f-number the lens is stopped down to for the white image; absent, that of the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub working_f_number: Option<f64>,
}

impl Default for Truth {
    fn default() -> Self {
        Self { pixels_per_voxel: [1.0, 1.0, 10.0], sigma_vox: 0.75, vectors: [33, 33, 17] }
    }
}

impl Default for White {
    fn default() -> Self {
        Self { counts: 1000.0, rays_per_lenslet: 40_000, working_f_number: None }
    }
}

fn two() -> usize {
    2
}

fn default_intensity() -> f64 {
    1e5
}

fn default_rays() -> u32 {
    50_000
}

impl Scene {
    /// Reads and checks a scene and its camera; `-` is standard input.
    pub fn open(path: &Path) -> Result<(Self, Camera)> {
        let name = lf_core::io::name(path);
        let text = lf_core::io::open_text(path)?;
        let wrong =
            |found: String| Error::new(name.clone(), found, "wanted a scene.json as `lf-synth scene` prints them");
        let mut scene: Self = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(csv) = &mut scene.particles.csv {
            *csv = folder.join(&*csv);
        }
        let camera = match &scene.camera {
            CameraSource::Path(file) => Camera::open(&folder.join(file))?,
            CameraSource::Camera(value) => {
                Camera::from_json(&value.to_string()).map_err(|(found, _)| wrong(format!("camera: {found}")))?
            }
        };
        scene.check(&camera).map_err(wrong)?;
        Ok((scene, camera))
    }

    /// The volume's bounds along x, y, z, mm.
    pub fn bounds_mm(&self) -> [[f64; 2]; 3] {
        [self.volume.x_mm, self.volume.y_mm, self.volume.z_mm]
    }

    /// The grid of the exact volumes.
    ///
    /// # Errors
    /// Where it has no voxel.
    pub fn grid(&self, camera: &Camera) -> std::result::Result<Grid, String> {
        Grid::in_bounds(self.bounds_mm(), camera.voxel_spacing_mm(self.truth.pixels_per_voxel))
    }

    /// Checks what the types do not.
    fn check(&self, camera: &Camera) -> std::result::Result<(), String> {
        for (name, [low, high]) in ["x_mm", "y_mm", "z_mm"].iter().zip(self.bounds_mm()) {
            if !(low.is_finite() && high.is_finite() && low < high) {
                return Err(format!("volume.{name} [{low}, {high}] does not rise"));
            }
        }
        let nearest = 0.9 * camera.object_distance_mm();
        if self.volume.z_mm[1] > nearest {
            return Err(format!(
                "volume.z_mm reaches {} mm, beyond {nearest:.1} mm, where the main lens stands",
                self.volume.z_mm[1]
            ));
        }
        let p = &self.particles;
        let given = [p.per_lenslet.is_some(), p.count.is_some(), p.csv.is_some()];
        if given.iter().filter(|given| **given).count() != 1 {
            return Err("particles must have one of 'per_lenslet', 'count' and 'csv'".to_string());
        }
        if p.per_lenslet.is_some_and(|density| !(0.0..=100.0).contains(&density)) {
            return Err(format!("particles.per_lenslet {:?} is outside 0 to 100", p.per_lenslet.unwrap_or(0.0)));
        }
        if self.particle_count(camera) > 1e8 {
            return Err(format!("asks for {:.0} particles, more than 1e8", self.particle_count(camera)));
        }
        for (key, value) in [
            ("particles.sigma_px", p.sigma_px),
            ("particles.intensity", p.intensity),
            ("truth.sigma_vox", self.truth.sigma_vox),
            ("white.counts", self.white.counts),
            ("white.working_f_number", self.white.working_f_number.unwrap_or(1.0)),
        ] {
            if !(value.is_finite() && value > 0.0 && value < 1e12) {
                return Err(format!("{key} is {value}, not a positive number"));
            }
        }
        if p.rays == 0 || self.white.rays_per_lenslet == 0 {
            return Err("particles.rays and white.rays_per_lenslet must be at least 1".to_string());
        }
        if self.truth.sigma_vox > 5.0 {
            return Err(format!("truth.sigma_vox {} is above 5", self.truth.sigma_vox));
        }
        if self.truth.vectors.iter().any(|n| *n < 2 || *n > 4096) {
            return Err(format!("truth.vectors {:?} is outside 2 to 4096", self.truth.vectors));
        }
        if self.frames == 0 || self.frames > 10_000 {
            return Err(format!("frames is {}, outside 1 to 10000", self.frames));
        }
        if let Some(flow) = &self.flow {
            flow.check()?;
        }
        self.grid(camera).map(|_| ()).map_err(|found| format!("truth: {found}"))
    }

    /// Particles in the volume, from the density or the count; not used with a `csv`.
    pub fn particle_count(&self, camera: &Camera) -> f64 {
        let p = &self.particles;
        if let Some(count) = p.count {
            return count as f64;
        }
        let on_array = |[low, high]: [f64; 2]| (high - low) * camera.main_lens.magnification;
        let lenslets = on_array(self.volume.x_mm) * on_array(self.volume.y_mm) / camera.lattice().cell_area_mm2();
        (p.per_lenslet.unwrap_or(0.0) * lenslets).round()
    }

    /// Share of the volume's cross-section at the focal plane that the sensor does not see; 0 to 1.
    pub fn unseen_share(&self, camera: &Camera) -> f64 {
        let seen = |[low, high]: [f64; 2], half: f64| ((high.min(half) - low.max(-half)) / (high - low)).max(0.0);
        let [half_x, half_y] = camera.half_view_mm();
        1.0 - seen(self.volume.x_mm, half_x) * seen(self.volume.y_mm, half_y)
    }
}
