//! What to render: `scene.json`. An effect without a key is not modelled and costs nothing.

use crate::diffraction::Diffraction;
use crate::dots::Dots;
use crate::light::{SecondStop, Sheet};
use crate::render::{Glow, Rays};
use crate::samples::Shape;
use crate::sensor::SensorNoise;
use lf_core::camera::Camera;
use lf_core::flow::Flows;
use lf_core::grid::Grid;
use lf_core::scene::{CameraSource, Frames, Volume, WANTED};
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
    /// Blur by diffraction at the lenslets; absent, none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diffraction: Option<Diffraction>,
    /// A second stop on the axis, which cuts the beam away from it (cat's-eye vignetting).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_stop: Option<SecondStop>,
    /// Where particles are lit.
    pub volume: Volume,
    /// The particles.
    pub particles: Particles,
    /// Brightness along z; absent, even.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<Sheet>,
    /// How they move from frame to frame; absent, they stay. Several flows add up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<Flows>,
    /// Number of frames, a unit of time apart, or their times.
    #[serde(default)]
    pub frames: Frames,
    /// What the sensor makes of the light; absent, the exact expectation is written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_noise: Option<SensorNoise>,
    /// The exact volumes and displacements written beside the frames; absent, none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<Truth>,
    /// The flat field.
    #[serde(default)]
    pub white: White,
    /// The dot target.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dots: Option<Dots>,
    /// Seed of all that is random.
    #[serde(default)]
    pub seed: u64,
}

/// The particles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// Particles for each lenslet that the volume covers at the focal plane; this or `count` or `csv`, or none of them
    /// where the flow is of tracks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub per_lenslet: Option<f64>,
    /// Particles in the volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// Particles of the first frame from a `particles.csv`, path from the scene's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub csv: Option<PathBuf>,
    /// Standard deviation of a Gaussian particle image at the focal plane, px; this or `diameter_px`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_px: Option<f64>,
    /// Diameter of an even disc as particle image at the focal plane, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diameter_px: Option<f64>,
    /// Standard deviation of the particle images' sizes over their mean, log-normal; absent, all are the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_spread: Option<f64>,
    /// Counts that one particle sends through the aperture.
    #[serde(default = "default_intensity")]
    pub intensity: f64,
    /// Standard deviation of the particles' intensities over their mean, log-normal; absent, all are the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intensity_spread: Option<f64>,
    /// Noise of the ray tracing wanted: root mean square error of a frame's lit pixels over its brightest pixel; this or
    /// `rays`, and 0.01 without either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ray_noise: Option<f64>,
    /// Rays cast for each particle and frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rays: Option<u32>,
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

impl Default for White {
    fn default() -> Self {
        Self { counts: 1000.0, rays_per_lenslet: 40_000, working_f_number: None }
    }
}

fn default_intensity() -> f64 {
    1e5
}

/// Rays that leave a relative noise below 0.01: `--measure-noise` finds 0.007 to 0.009 in the ready scenes core, core-round,
/// core-hexagonal and demo, and 0.001 with the rays that the power law gives for that.
const RAYS_AT_HUNDREDTH: f64 = 15_000.0;

/// Rays for a particle of average brightness that leave `noise`.
fn rays_for_noise(noise: f64) -> u32 {
    (RAYS_AT_HUNDREDTH * (0.01 / noise).powf(4.0 / 3.0)).clamp(256.0, 2e7) as u32
}

impl Scene {
    /// Reads and checks a scene and its camera; `-` is standard input. Paths in it come back as seen from here, and the
    /// files it takes are listed.
    pub fn open(path: &Path) -> Result<(Self, Camera, Vec<PathBuf>)> {
        let name = lf_core::io::name(path);
        let text = lf_core::io::open_text(path)?;
        let wrong = |found: String| Error::new(name.clone(), found, WANTED);
        let mut scene: Self = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut files = Vec::new();
        if let Some(csv) = &mut scene.particles.csv {
            *csv = folder.join(&*csv);
            files.push(csv.clone());
        }
        if let Some(flow) = &mut scene.flow {
            flow.join(folder);
            files.extend(flow.sampled().into_iter().chain(flow.tracks()).map(Path::to_path_buf));
        }
        if let Some(noise) = &mut scene.sensor_noise {
            noise.join(folder);
            files.extend(noise.background.clone());
        }
        files.extend(scene.camera.file(folder));
        let camera = scene.camera.open(folder, &name)?;
        scene.check(&camera).map_err(wrong)?;
        Ok((scene, camera, files))
    }

    /// The volume's bounds along x, y, z, mm.
    pub fn bounds_mm(&self) -> [[f64; 2]; 3] {
        self.volume.bounds_mm()
    }

    /// The grid of the exact volumes; none where the scene asks for no truth.
    ///
    /// # Errors
    /// Where it has no voxel.
    pub fn grid(&self, camera: &Camera) -> std::result::Result<Option<Grid>, String> {
        let in_bounds = |truth: &Truth| {
            Grid::in_bounds(self.bounds_mm(), camera.voxel_spacing_mm(truth.pixels_per_voxel))
                .map_err(|found| format!("truth: {found}"))
        };
        self.truth.as_ref().map(in_bounds).transpose()
    }

    /// What a particle sends out.
    pub fn glow(&self, camera: &Camera) -> Glow {
        let p = &self.particles;
        let pixel_mm = camera.pixel_in_focus_mm();
        let (shape, size_px) = match (p.sigma_px, p.diameter_px) {
            (_, Some(diameter)) => (Shape::Disc, 0.5 * diameter),
            (sigma, None) => (Shape::Gaussian, sigma.unwrap_or(0.0)),
        };
        Glow { shape, size_mm: size_px * pixel_mm, rays: self.rays(p.intensity) }
    }

    /// Rays of a particle; `intensity` is an average one.
    pub fn rays(&self, intensity: f64) -> Rays {
        match (self.particles.rays, self.particles.ray_noise) {
            (Some(rays), _) => Rays::Each(rays),
            (None, noise) => Rays::At(rays_for_noise(noise.unwrap_or(0.01)), intensity),
        }
    }

    /// Checks what the types do not.
    fn check(&self, camera: &Camera) -> std::result::Result<(), String> {
        if camera.vignetting.is_some() {
            return Err(
                "camera.vignetting is a measured flat field, which is not rendered: a key second_stop is".to_string()
            );
        }
        self.check_volume(camera)?;
        self.check_particles(camera)?;
        self.frames.check()?;
        if let Some(diffraction) = &self.diffraction {
            diffraction.check()?;
        }
        if let Some(stop) = &self.second_stop {
            stop.check(camera)?;
        }
        if let Some(light) = &self.light {
            light.check()?;
        }
        if let Some(flow) = &self.flow {
            flow.check()?;
        }
        if let Some(noise) = &self.sensor_noise {
            noise.check()?;
        }
        if let Some(dots) = &self.dots {
            dots.check(camera.half_view_mm())?;
            for depth in &dots.depths_mm {
                check_depth(camera, *depth).map_err(|found| format!("dots.depths_mm {found}"))?;
            }
        }
        positive("white.counts", self.white.counts)?;
        positive("white.working_f_number", self.white.working_f_number.unwrap_or(1.0))?;
        if self.white.rays_per_lenslet == 0 {
            return Err("white.rays_per_lenslet must be at least 1".to_string());
        }
        if let Some(truth) = &self.truth {
            positive("truth.sigma_vox", truth.sigma_vox)?;
            // Narrower than this, a particle could fall between voxels.
            if !(0.2..=5.0).contains(&truth.sigma_vox) {
                return Err(format!("truth.sigma_vox {} is outside 0.2 to 5", truth.sigma_vox));
            }
            if truth.vectors.iter().any(|n| *n < 2 || *n > 4096) {
                return Err(format!("truth.vectors {:?} is outside 2 to 4096", truth.vectors));
            }
        }
        self.grid(camera).map(|_| ())
    }

    fn check_volume(&self, camera: &Camera) -> std::result::Result<(), String> {
        self.volume.check()?;
        check_depth(camera, self.volume.z_mm[1]).map_err(|found| format!("volume.z_mm reaches {found}"))
    }

    fn check_particles(&self, camera: &Camera) -> std::result::Result<(), String> {
        let p = &self.particles;
        let given = [p.per_lenslet.is_some(), p.count.is_some(), p.csv.is_some()];
        let given = given.iter().filter(|given| **given).count();
        if self.flow.as_ref().is_some_and(|flow| flow.tracks().is_some()) {
            if given > 0 {
                return Err(
                    "particles come from the flow's tracks, not from 'per_lenslet', 'count' or 'csv'".to_string()
                );
            }
        } else if given != 1 {
            return Err("particles must have one of 'per_lenslet', 'count' and 'csv'".to_string());
        }
        if p.sigma_px.is_some() == p.diameter_px.is_some() {
            return Err("particles must have one of 'sigma_px' and 'diameter_px'".to_string());
        }
        if p.rays.is_some() && p.ray_noise.is_some() {
            return Err("particles has both 'rays' and 'ray_noise'".to_string());
        }
        if let Some(density) = p.per_lenslet.filter(|density| !(0.0..=100.0).contains(density)) {
            return Err(format!("particles.per_lenslet {density} is outside 0 to 100"));
        }
        if self.particle_count(camera) > 1e8 {
            return Err(format!("particles: asks for {:.0} particles, more than 1e8", self.particle_count(camera)));
        }
        positive("particles.sigma_px", p.sigma_px.unwrap_or(1.0))?;
        positive("particles.diameter_px", p.diameter_px.unwrap_or(1.0))?;
        positive("particles.intensity", p.intensity)?;
        for (key, spread) in [("size_spread", p.size_spread), ("intensity_spread", p.intensity_spread)] {
            if let Some(spread) = spread.filter(|spread| !(0.0..=3.0).contains(spread)) {
                return Err(format!("particles.{key} {spread} is outside 0 to 3"));
            }
        }
        if let Some(noise) = p.ray_noise.filter(|noise| !(1e-4..=1.0).contains(noise)) {
            return Err(format!("particles.ray_noise {noise} is outside 0.0001 to 1"));
        }
        match p.rays {
            Some(rays @ (0 | 20_000_001..)) => Err(format!("particles.rays {rays} is outside 1 to 20000000")),
            _ => Ok(()),
        }
    }

    /// Particles in the volume, from the density or the count; not used with a `csv` or tracks.
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

fn positive(key: &str, value: f64) -> std::result::Result<(), String> {
    if value.is_finite() && value > 0.0 && value < 1e12 {
        return Ok(());
    }
    Err(format!("{key} is {value}, not a positive number"))
}

/// Whether the main lens makes an image of what is at a depth.
fn check_depth(camera: &Camera, z_mm: f64) -> std::result::Result<(), String> {
    if !z_mm.is_finite() {
        return Err(format!("{z_mm}, not a length"));
    }
    if let Some(medium) = &camera.medium {
        return if z_mm < medium.window_z_mm {
            Ok(())
        } else {
            Err(format!("{z_mm} mm, beyond the window's wet face at {} mm", medium.window_z_mm))
        };
    }
    let (focal, lens) = (camera.main_lens.focal_length_mm, camera.object_distance_mm());
    if lens - z_mm > focal {
        return Ok(());
    }
    Err(format!("{z_mm} mm, within the focal length ({focal} mm) of the main lens at {lens:.1} mm"))
}
