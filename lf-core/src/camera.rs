//! The camera: its JSON, its checks, and the lattice of its microlenses.
//!
//! | symbol | key | derived here |
//! | --- | --- | --- |
//! | `pp` | `sensor.pixel_pitch_mm` | |
//! | `p` | `microlenses.pitch_mm` | |
//! | `f_l` | `microlenses.focal_length_mm` | |
//! | `f`, `m` | `main_lens.focal_length_mm`, `main_lens.magnification` | |
//! | `s_i`, `s_o` | | [`Camera::image_distance_mm`], [`Camera::object_distance_mm`] |
//! | `N_w`, `D` | `main_lens.working_f_number` | [`Camera::aperture_mm`] |
//! | `g` | `microlenses.gap_mm`; f_l where absent | |
//! | `k` | | [`Camera::demagnification`] |

use crate::lattice::{Centres, Lattice};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A plenoptic camera whose sensor sits one microlens focal length behind the array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// The pixels.
    pub sensor: Sensor,
    /// The main lens.
    pub main_lens: MainLens,
    /// The microlens array.
    pub microlenses: Microlenses,
    /// Distortion of the main lens; absent, none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Distortion>,
    /// Tilt of the sensor against the array; absent, none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tilt: Option<Tilt>,
    /// What the camera looks into; absent, air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub medium: Option<Medium>,
    /// Measured departure of the lenslets from the perfect lattice; absent, none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centres: Option<Centres>,
    /// A flat-field image: what each pixel counts of the light that it should; absent, all of it. Seen from the folder of
    /// the camera's file; see [`crate::image::open_frame`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vignetting: Option<PathBuf>,
    /// What a calibration learned: residuals and their units. Kept, and read by no tool.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<serde_json::Value>,
}

/// The pixels behind the array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Pixel columns.
    pub width: usize,
    /// Pixel rows.
    pub height: usize,
    /// Distance between pixels, mm.
    pub pixel_pitch_mm: f64,
}

/// A thin main lens focused on the plane Z = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MainLens {
    /// Focal length, mm.
    pub focal_length_mm: f64,
    /// Size of the magnification, |M|.
    pub magnification: f64,
    /// Image distance over aperture diameter.
    pub working_f_number: f64,
    /// Shape of the stop.
    pub aperture: Aperture,
}

/// Shape of the main lens's stop; its diameter or side is [`Camera::aperture_mm`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Aperture {
    /// A disc.
    Circle,
    /// A square, sides along x and y.
    Square,
}

/// The lattice of the microlenses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Microlenses {
    /// Square or hexagonal.
    pub layout: Layout,
    /// Distance between neighbouring lenslets, mm.
    pub pitch_mm: f64,
    /// Focal length, mm; also the distance to the sensor.
    pub focal_length_mm: f64,
    /// Turn of the lattice about `offset_mm`, from x towards y, rad.
    pub rotation_rad: f64,
    /// Place of the lattice's origin, mm; see [`Lattice`].
    pub offset_mm: [f64; 2],
    /// Distance from the array to the sensor on the axis, mm; absent, the focal length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap_mm: Option<f64>,
}

/// Distortion of the main lens after Brown (1966): radial, and tangential by a decentred element. It moves a point's whole
/// image by what its chief ray is moved; see [`crate::optics`] for the equation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distortion {
    /// k1, k2, k3: coefficients of r^2, r^4, r^6, r the tangent of the chief ray behind the lens.
    #[serde(default)]
    pub radial: [f64; 3],
    /// p1, p2.
    #[serde(default)]
    pub tangential: [f64; 2],
}

/// Tilt of the sensor against the array: the gap between them widens by tan(x_rad) along x and by tan(y_rad) along y.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tilt {
    /// Along x, rad.
    pub x_rad: f64,
    /// Along y, rad.
    pub y_rad: f64,
}

/// A medium behind a flat window at right angles to the axis; the camera stands in air. Z = 0 is the plane in the medium
/// that rays near the axis come from which meet on the array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Medium {
    /// Index of refraction of the medium, relative to air.
    pub index: f64,
    /// Z of the window's wet face, mm.
    pub window_z_mm: f64,
    /// Thickness of the window, mm; absent, the medium ends in air.
    #[serde(default)]
    pub window_thickness_mm: f64,
    /// Index of refraction of the window, relative to air.
    #[serde(default = "one")]
    pub window_index: f64,
}

fn one() -> f64 {
    1.0
}

/// How the lenslets are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Rows and columns one pitch apart.
    Square,
    /// Rows `pitch sqrt(3)/2` apart, odd rows shifted by half a pitch.
    Hexagonal,
}

/// A lattice turned by less than moves any lenslet of the sensor by this many pixels counts as not turned. Particle
/// images spread over 0.6 px and more, and calibration on white images errs by some thousandths.
pub const IN_LINE_PX: f64 = 0.02;

impl Camera {
    /// Reads and checks a camera file; `-` is standard input.
    pub fn open(path: &Path) -> Result<Self> {
        let text = crate::io::open_text(path).map_err(|mut error| {
            if error.found.ends_with("no text") {
                error.wanted = "wanted a camera.json".to_string();
            }
            error
        })?;
        Self::from_json(&text).map_err(|(found, wanted)| Error::new(crate::io::name(path), found, wanted))
    }

    /// Reads and checks a camera; the error is (found, wanted).
    pub fn from_json(text: &str) -> std::result::Result<Self, (String, String)> {
        const WANTED: &str = "wanted a camera.json";
        let value: serde_json::Value =
            serde_json::from_str(text).map_err(|error| (format!("not JSON ({error})"), WANTED.to_string()))?;
        let camera: Self = serde_json::from_value(value).map_err(|error| (error.to_string(), WANTED.to_string()))?;
        camera.check().map_err(|found| (found, WANTED.to_string()))?;
        Ok(camera)
    }

    /// The camera as indented JSON with a final line end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("a camera is plain data");
        text.push('\n');
        text
    }

    /// Checks that every length is usable.
    ///
    /// # Errors
    /// Says which key is wrong.
    pub fn check(&self) -> std::result::Result<(), String> {
        let positive = [
            ("sensor.pixel_pitch_mm", self.sensor.pixel_pitch_mm),
            ("main_lens.focal_length_mm", self.main_lens.focal_length_mm),
            ("main_lens.magnification", self.main_lens.magnification),
            ("main_lens.working_f_number", self.main_lens.working_f_number),
            ("microlenses.pitch_mm", self.microlenses.pitch_mm),
            ("microlenses.focal_length_mm", self.microlenses.focal_length_mm),
        ];
        for (key, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} is {value}, not a positive length or number"));
            }
        }
        let (width, height) = (self.sensor.width, self.sensor.height);
        if width == 0 || height == 0 || width > 1 << 20 || height > 1 << 20 {
            return Err(format!("sensor is {width} x {height} px, outside 1 to 1048576 a side"));
        }
        if self.microlenses.pitch_mm < self.sensor.pixel_pitch_mm {
            return Err(format!(
                "microlenses.pitch_mm {} is smaller than a pixel ({} mm)",
                self.microlenses.pitch_mm, self.sensor.pixel_pitch_mm
            ));
        }
        let [x, y] = self.microlenses.offset_mm;
        if !(self.microlenses.rotation_rad.is_finite() && x.is_finite() && y.is_finite()) {
            return Err("microlenses.rotation_rad or offset_mm is not finite".to_string());
        }
        if let Some(gap) = self.microlenses.gap_mm
            && !(gap.is_finite() && gap > 0.0)
        {
            return Err(format!("microlenses.gap_mm is {gap}, not a positive length"));
        }
        if let Some(Distortion { radial, tangential }) = &self.distortion
            && !radial.iter().chain(tangential).all(|number| number.is_finite())
        {
            return Err("distortion has a number that is not finite".to_string());
        }
        if let Some(Tilt { x_rad, y_rad }) = self.tilt
            && !(x_rad.abs() < 0.5 && y_rad.abs() < 0.5)
        {
            return Err(format!("tilt ({x_rad}, {y_rad}) rad is not within half a radian"));
        }
        let gap = self.gap_mm();
        if let Some(Tilt { x_rad, y_rad }) = self.tilt {
            let half = [width, height].map(|pixels| 0.5 * pixels as f64 * self.sensor.pixel_pitch_mm);
            let nearer = x_rad.abs().tan() * half[0] + y_rad.abs().tan() * half[1];
            if nearer >= gap {
                return Err(format!("tilt brings the sensor {nearer:.3} mm towards an array {gap:.3} mm before it"));
            }
        }
        if let Some(medium) = &self.medium {
            medium.check(self.object_distance_mm())?;
        }
        if let Some(centres) = &self.centres {
            centres.check()?;
        }
        if self.demagnification() >= 0.5 {
            return Err(format!(
                "microlens focal length {} mm is not small beside the image distance {} mm",
                self.microlenses.focal_length_mm,
                self.image_distance_mm()
            ));
        }
        Ok(())
    }

    /// The first of the camera's blocks by which light does not go in straight lines to lenslets at their focal length.
    pub fn bends(&self) -> Option<&'static str> {
        let blocks = [
            (self.medium.is_some(), "medium"),
            (self.tilt.is_some(), "tilt"),
            (self.microlenses.gap_mm.is_some(), "microlenses.gap_mm"),
            (self.distortion.is_some(), "distortion"),
        ];
        blocks.into_iter().find_map(|(given, name)| given.then_some(name))
    }

    /// The camera with its lattice exactly in line with the pixels, where it has a square lattice turned by so little that
    /// no lenslet moves by more than [`IN_LINE_PX`], and nothing else that bends its columns.
    pub fn in_line(&self) -> Option<Self> {
        if self.off_line().is_some() {
            return None;
        }
        let mut straight = self.clone();
        straight.microlenses.rotation_rad = 0.0;
        Some(straight)
    }

    /// What keeps the lattice from being in line with the pixels, in words; none of [`Camera::in_line`].
    pub fn off_line(&self) -> Option<String> {
        if let Some(block) = self.bends().or(self.centres.is_some().then_some("centres")) {
            return Some(format!("the camera has '{block}'"));
        }
        if self.microlenses.layout != Layout::Square {
            return Some("the lattice is hexagonal".to_string());
        }
        let turn = self.microlenses.rotation_rad.abs();
        let drift_px = 0.5 * self.sensor.width.max(self.sensor.height) as f64 * turn;
        let turned = || format!("the lattice is turned, by {drift_px:.2} px at the sensor's sides");
        (drift_px > IN_LINE_PX).then(turned)
    }

    /// The keys of the optional blocks that it has, each of which is modelled only where it is given.
    pub fn blocks(&self) -> Vec<&'static str> {
        let blocks = [
            ("medium", self.medium.is_some()),
            ("tilt", self.tilt.is_some()),
            ("microlenses.gap_mm", self.microlenses.gap_mm.is_some()),
            ("distortion", self.distortion.is_some()),
            ("centres", self.centres.is_some()),
            ("vignetting", self.vignetting.is_some()),
        ];
        blocks.into_iter().filter_map(|(name, given)| given.then_some(name)).collect()
    }

    /// What `-v` tells of it: its lattice, its stop, and which optional blocks are modelled.
    pub fn about(&self) -> String {
        let layout = match self.microlenses.layout {
            Layout::Square => "square",
            Layout::Hexagonal => "hexagonal",
        };
        let stop = match self.main_lens.aperture {
            Aperture::Circle => "round",
            Aperture::Square => "square",
        };
        let blocks = match self.blocks().as_slice() {
            [] => "nothing beyond a thin lens is modelled".to_string(),
            blocks => format!("modelled beyond a thin lens: {}", blocks.join(", ")),
        };
        format!("{layout} lattice of {:.2} px, {stop} stop; {blocks}", self.pitch_px())
    }

    /// The flat-field image of a camera that was read from `file`: `vignetting` seen from its folder.
    pub fn flat_field(&self, file: &Path) -> Option<PathBuf> {
        let flat = self.vignetting.as_deref()?;
        Some(file.parent().map_or_else(|| flat.to_path_buf(), |folder| folder.join(flat)))
    }

    /// Refuses an image of another size than the sensor.
    pub fn check_image(&self, name: &str, width: usize, height: usize) -> Result<()> {
        if (width, height) == (self.sensor.width, self.sensor.height) {
            return Ok(());
        }
        Err(Error::new(
            name,
            format!("image of {width} x {height} px"),
            format!("wanted the camera's {} x {} px", self.sensor.width, self.sensor.height),
        ))
    }

    /// s_i = f (1 + m), mm.
    pub fn image_distance_mm(&self) -> f64 {
        self.main_lens.focal_length_mm * (1.0 + self.main_lens.magnification)
    }

    /// s_o = f (1 + 1/m), mm.
    pub fn object_distance_mm(&self) -> f64 {
        self.main_lens.focal_length_mm * (1.0 + 1.0 / self.main_lens.magnification)
    }

    /// D = s_i / N_w: diameter of a round stop, side of a square one, mm.
    pub fn aperture_mm(&self) -> f64 {
        self.image_distance_mm() / self.main_lens.working_f_number
    }

    /// Distance from the array to the sensor on the axis, mm.
    pub fn gap_mm(&self) -> f64 {
        self.microlenses.gap_mm.unwrap_or(self.microlenses.focal_length_mm)
    }

    /// k = f_l / s_i: size of the aperture's image under a lenslet over the aperture's; the gap in place of f_l where
    /// they differ.
    pub fn demagnification(&self) -> f64 {
        self.gap_mm() / self.image_distance_mm()
    }

    /// Lenslet pitch in pixels.
    pub fn pitch_px(&self) -> f64 {
        self.microlenses.pitch_mm / self.sensor.pixel_pitch_mm
    }

    /// The microlens lattice.
    pub fn lattice(&self) -> Lattice {
        Lattice::new(&self.microlenses, self.centres.as_ref())
    }

    /// What the sensor sees of the focal plane: half width and half height, mm.
    pub fn half_view_mm(&self) -> [f64; 2] {
        let scale = 0.5 * self.sensor.pixel_pitch_mm / self.main_lens.magnification;
        [self.sensor.width as f64 * scale, self.sensor.height as f64 * scale]
    }

    /// Side of a pixel seen at the focal plane, mm.
    pub fn pixel_in_focus_mm(&self) -> f64 {
        self.sensor.pixel_pitch_mm / self.main_lens.magnification
    }

    /// Spacing of a grid of `pixels_per_voxel` at the focal plane, mm.
    pub fn voxel_spacing_mm(&self, pixels_per_voxel: [f64; 3]) -> [f64; 3] {
        pixels_per_voxel.map(|ratio| ratio * self.sensor.pixel_pitch_mm / self.main_lens.magnification)
    }
}

impl Medium {
    /// Thicknesses and indices of what a ray from Z passes before the air: medium, window.
    pub fn layers_from(&self, z_mm: f64) -> [(f64, f64); 2] {
        [(self.window_z_mm - z_mm, self.index), (self.window_thickness_mm, self.window_index)]
    }

    /// Distance from the window to the main lens, mm, for a lens focused on the object distance `s_o` in air.
    pub fn air_mm(&self, object_distance_mm: f64) -> f64 {
        object_distance_mm - self.layers_from(0.0).iter().map(|(thickness, index)| thickness / index).sum::<f64>()
    }

    fn check(&self, object_distance_mm: f64) -> std::result::Result<(), String> {
        for (key, index) in [("index", self.index), ("window_index", self.window_index)] {
            if !(1.0..=4.0).contains(&index) {
                return Err(format!("medium.{key} is {index}, outside 1 to 4"));
            }
        }
        if !(self.window_thickness_mm.is_finite() && self.window_thickness_mm >= 0.0) {
            return Err(format!("medium.window_thickness_mm is {}, not a length", self.window_thickness_mm));
        }
        let air = self.air_mm(object_distance_mm);
        if !air.is_finite() || air <= 0.0 {
            return Err(format!("medium.window_z_mm {} leaves the main lens no air before it", self.window_z_mm));
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The seed camera of the simulations: 77 um lenslets of 0.308 mm behind a 200 mm lens at m = 1, N_w = 4.
    pub(crate) fn seed(lenslets: usize, aperture: Aperture, layout: Layout, rotation_rad: f64) -> Camera {
        Camera {
            sensor: Sensor { width: 14 * lenslets, height: 14 * lenslets, pixel_pitch_mm: 0.0055 },
            main_lens: MainLens { focal_length_mm: 200.0, magnification: 1.0, working_f_number: 4.0, aperture },
            microlenses: Microlenses {
                layout,
                pitch_mm: 0.077,
                focal_length_mm: 0.308,
                rotation_rad,
                offset_mm: [0.0, 0.0],
                gap_mm: None,
            },
            distortion: None,
            tilt: None,
            medium: None,
            centres: None,
            vignetting: None,
            calibration: None,
        }
    }

    #[test]
    fn seed_camera_is_matched() {
        let camera = seed(20, Aperture::Square, Layout::Square, 0.0);
        assert!((camera.aperture_mm() - 100.0).abs() < 1e-12);
        assert!((camera.demagnification() * camera.aperture_mm() - camera.microlenses.pitch_mm).abs() < 1e-12);
    }
}
