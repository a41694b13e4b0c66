//! The parameters of a camera that the images of particles determine, and the evidence of a frame on them, which goes
//! from lf-fit to `lf-calib refine`.
//!
//! Magnification and focal lengths scale places and depths, which no particle shows. Field curvature moves depths too,
//! and of astigmatism only a little is left when depths follow: dots find them (`lf-calib volume`). A sensor beyond the
//! focus of the lenslets shows where in a lenslet light arrives. Lenslets of another focal length show the same, and
//! leave depths as they are. White images see such a gap as another f-number.

use super::model::{Aberrations, Camera, Tilt};
use crate::lattice::{Centres, terms};
use crate::{Refusal, io, json};
use glam::DVec2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A parameter of a camera. Steps are in pixels by which they move light at most: at the rim of a lenslet image, or at
/// the edge of the sensor, half of its longer side from the middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name in messages.
    pub name: &'static str,
    /// Its name in files, with its unit.
    pub key: &'static str,
    /// Its unit.
    pub unit: &'static str,
    what: What,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum What {
    Drift(usize),
    Blur,
    FNumber,
    Gap,
    Pitch,
    Rotation,
    Tilt(usize),
    Spherical,
    Coma,
    /// Departure along an axis by a term of [`Centres`].
    Departure(usize, usize),
}

const fn of(what: What, name: &'static str, key: &'static str, unit: &'static str) -> Parameter {
    Parameter { name, key, unit, what }
}

/// Number of parameters.
pub const COUNT: usize = 19;

/// The parameters: drift and blur first.
pub const PARAMETERS: [Parameter; COUNT] = [
    of(What::Drift(0), "place of the lenslets along x", "drift_x_px", "px"),
    of(What::Drift(1), "place of the lenslets along y", "drift_y_px", "px"),
    of(What::Blur, "blur", "blur_px", "px"),
    of(What::FNumber, "f-number (or 1 / focal_length_mm of the lenslets)", "f_number_percent", "%"),
    of(What::Gap, "gap between lenslets and sensor (at the same width of lenslet images)", "gap_percent", "%"),
    of(What::Pitch, "pitch of the lenslets", "pitch_percent", "%"),
    of(What::Rotation, "rotation of the lenslets", "rotation_mrad", "mrad"),
    of(What::Tilt(0), "tilt of the sensor along x", "tilt_x_mrad", "mrad"),
    of(What::Tilt(1), "tilt of the sensor along y", "tilt_y_mrad", "mrad"),
    of(What::Spherical, "spherical aberration of the main lens", "spherical_px", "px"),
    of(What::Coma, "coma of the main lens", "coma_px", "px"),
    of(What::Departure(0, 0), "departure of the lenslets along x with x", "centres_x_with_x_px", "px"),
    of(What::Departure(0, 1), "departure of the lenslets along x with y", "centres_x_with_y_px", "px"),
    of(What::Departure(0, 2), "departure of the lenslets along x with x^2", "centres_x_with_xx_px", "px"),
    of(What::Departure(0, 3), "departure of the lenslets along x with x y", "centres_x_with_xy_px", "px"),
    of(What::Departure(0, 4), "departure of the lenslets along x with y^2", "centres_x_with_yy_px", "px"),
    of(What::Departure(1, 2), "departure of the lenslets along y with x^2", "centres_y_with_xx_px", "px"),
    of(What::Departure(1, 3), "departure of the lenslets along y with x y", "centres_y_with_xy_px", "px"),
    of(What::Departure(1, 4), "departure of the lenslets along y with y^2", "centres_y_with_yy_px", "px"),
];

/// [`What::Gap`] of a camera whose file gives the gap.
const FOCUS: Parameter = of(What::Gap, "1 / focal_length_mm of the lenslets", "lenslet_focus_percent", "%");

/// The powers of x and y in each term of a departure of the second degree.
const POWERS: [[i32; 2]; terms(2)] = [[1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

/// Half of the longer side of the sensor, pixels.
fn edge_px(camera: &Camera) -> f64 {
    0.5 * camera.sensor.width.max(camera.sensor.height) as f64
}

impl Parameter {
    /// The step, in the parameter's unit, that moves light by a pixel.
    pub fn per_px(&self, camera: &Camera) -> f64 {
        match self.what {
            What::FNumber | What::Gap => 100.0 / (0.5 * camera.pitch_px()),
            What::Pitch => 100.0 / edge_px(camera),
            What::Rotation => 1000.0 / edge_px(camera),
            What::Tilt(_) => 1000.0 * 2.0 * camera.main_lens.working_f_number / edge_px(camera),
            _ => 1.0,
        }
    }

    /// Whether a step changes the width of lenslet images or how far they stand apart.
    pub fn scales_images(&self) -> bool {
        matches!(self.what, What::FNumber | What::Gap | What::Pitch | What::Departure(_, 0 | 1))
    }

    /// Whether a camera can take a step, px: a blur does not fall below 0.
    pub fn allows(&self, camera: &Camera, step_px: f64) -> bool {
        self.what != What::Blur || camera.blur.map_or(0.0, |blur| blur.sigma_px) + step_px >= 0.0
    }

    /// Changes the parameter by a step in its unit.
    fn change(&self, camera: &mut Camera, by: f64) {
        let (pixel_mm, edge_px) = (camera.sensor.pixel_pitch_mm, edge_px(camera));
        match self.what {
            What::Drift(axis) => camera.microlenses.offset_mm[axis] += by * pixel_mm,
            What::Blur => {
                let blur = camera.blur.get_or_insert_default();
                blur.sigma_px = (blur.sigma_px + by).max(0.0);
            }
            What::FNumber => camera.main_lens.working_f_number *= 1.0 + 0.01 * by,
            // A gap that the file gives was measured; without it, it is the focal length of a data sheet.
            What::Gap if camera.microlenses.gap_mm.is_some() => camera.microlenses.focal_length_mm /= 1.0 + 0.01 * by,
            What::Gap => {
                // White images have shown the width and the pitch of the lenslet images.
                let growth = 1.0 + camera.image_growth();
                camera.microlenses.gap_mm = Some(camera.gap_mm() * (1.0 + 0.01 * by));
                camera.main_lens.working_f_number *= 1.0 + 0.01 * by;
                camera.microlenses.pitch_mm *= growth / (1.0 + camera.image_growth());
            }
            What::Pitch => camera.microlenses.pitch_mm *= 1.0 + 0.01 * by,
            What::Rotation => camera.microlenses.rotation_rad += 1e-3 * by,
            What::Tilt(axis) => {
                let tilt = camera.tilt.get_or_insert(Tilt { x_rad: 0.0, y_rad: 0.0 });
                *(if axis == 0 { &mut tilt.x_rad } else { &mut tilt.y_rad }) += 1e-3 * by;
            }
            What::Spherical => aberrations(camera).spherical_px += by,
            What::Coma => aberrations(camera).coma_px += by,
            What::Departure(axis, term) => {
                let radius_mm = 0.5 * pixel_mm * camera.diagonal_px();
                let none = || Centres { radius_mm, x_mm: Vec::new(), y_mm: Vec::new() };
                let centres = camera.centres.get_or_insert_with(none);
                let degree = POWERS[term][0] + POWERS[term][1];
                let scale = (centres.radius_mm / (edge_px * pixel_mm)).powi(degree);
                let size = centres.x_mm.len().max(POWERS.len());
                centres.x_mm.resize(size, 0.0);
                centres.y_mm.resize(size, 0.0);
                let along = if axis == 0 { &mut centres.x_mm } else { &mut centres.y_mm };
                along[term] += by * pixel_mm * scale;
            }
        }
    }

    /// How far a step of one pixel moves the lenslets at a pixel, px: a parameter of the lattice does only that. None
    /// for others. `from_middle_px` is the pixel's place from the middle of the sensor.
    pub fn shift_px(&self, camera: &Camera, from_middle_px: DVec2) -> Option<DVec2> {
        let at = from_middle_px / edge_px(camera) / (1.0 + camera.image_growth());
        match self.what {
            What::Drift(axis) => Some(DVec2::AXES[axis]),
            What::Pitch => Some(at),
            What::Rotation => Some(at.perp()),
            What::Departure(axis, term) => {
                let [x, y] = POWERS[term];
                Some(at.x.powi(x) * at.y.powi(y) * DVec2::AXES[axis])
            }
            _ => None,
        }
    }
}

/// A camera after steps of its parameters, px.
pub fn stepped<'p>(camera: &Camera, steps: impl IntoIterator<Item = (&'p Parameter, f64)>) -> Camera {
    let mut moved = camera.clone();
    for (parameter, px) in steps.into_iter().filter(|(_, px)| *px != 0.0) {
        // An f-number that changes too must not scale the step of a tilt.
        parameter.change(&mut moved, px * parameter.per_px(camera));
    }
    moved
}

/// A correction of a camera's parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// The parameter.
    pub parameter: Parameter,
    /// How far it was too small, in its unit.
    pub step: f64,
    /// Standard uncertainty, in that unit.
    pub std: f64,
}

impl Correction {
    /// A correction by a step and its standard uncertainty in pixels.
    pub fn new(parameter: Parameter, camera: &Camera, step_px: f64, std_px: f64) -> Self {
        let scale = parameter.per_px(camera);
        let is_known = parameter.what == What::Gap && camera.microlenses.gap_mm.is_some();
        let parameter = if is_known { FOCUS } else { parameter };
        Self { parameter, step: step_px * scale, std: std_px * scale }
    }

    /// Such as "pitch of the lenslets is 0.500 +- 0.012 % too large": the uncertainty with two digits.
    pub fn words(&self) -> String {
        let Parameter { name, unit, .. } = self.parameter;
        let how = if self.step > 0.0 { "small" } else { "large" };
        let digits = if self.std > 0.0 { (1.0 - self.std.log10().floor()).clamp(0.0, 9.0) as usize } else { 3 };
        format!("{name} is {:.digits$} +- {:.digits$} {unit} too {how}", self.step.abs(), self.std)
    }

    /// How the correction moves all depths, or another error that looks the same and leads to other depths.
    pub fn doubt(&self) -> Option<String> {
        let other = match self.parameter {
            Parameter { what: What::Spherical, .. } => {
                return Some(
                    "depths then count from the focus of the stop's middle, not from the sharpest plane".into(),
                );
            }
            FOCUS => "gap_mm that is as much off",
            Parameter { what: What::Gap, .. } => "focal length of the lenslets that is as much off",
            _ => return None,
        };
        Some(format!(
            "a {other}, or spherical aberration of the lenslets, looks the same, and depths would be {:.1} % off: dots show \
             which it is (lf-calib volume)",
            self.step.abs()
        ))
    }
}

fn aberrations(camera: &mut Camera) -> &mut Aberrations {
    camera.aberrations.get_or_insert_default()
}

/// The evidence of a frame's particles on their camera. Their places and lights are unknown too. About the values that
/// the fit found, -2 log L is `d' information d - 2 gradient' d` for a step d, px.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// The camera that was given to the fit.
    pub camera: Camera,
    /// Number of the frame.
    pub frame: usize,
    /// Particles whose images were compared.
    pub particles: usize,
    /// Mean squared difference over variance.
    pub chi2: f64,
    /// Keys of the parameters.
    pub parameters: Vec<String>,
    /// The steps that the fit found, from the given camera, px.
    pub value_px: Vec<f64>,
    /// The slope that is left, 1/px.
    pub gradient: Vec<f64>,
    /// The information, 1/px^2, by rows.
    pub information: Vec<Vec<f64>>,
}

/// The largest misfit that noise explains. Right models of real optics leave 0.95 to 1.06 under the noise of a sensor,
/// and up to 1.34 under that of few rays; an f-number 2 % off leaves 1.9, a pitch 0.03 % off 2.2.
pub const EXPLAINED: f64 = 1.4;
const WANTED: &str = "wanted what lf-fit --evidence wrote";

impl Evidence {
    /// Reads and checks a file; `-` is standard input.
    pub fn open(path: &Path) -> crate::Result<Self> {
        let text = io::open_text(path)?;
        let read = || {
            let value =
                serde_json::from_str(&text).map_err(|error| Refusal::new(format!("not JSON ({error})"), WANTED))?;
            let evidence: Self = json::read(&value).map_err(|found| Refusal::new(found, WANTED))?;
            evidence.check().map(|()| evidence)
        };
        read().map_err(|refusal| refusal.about(io::name(path)))
    }

    /// Whether this is about a camera. Its calibration and the path of its flat field do not count.
    pub fn is_about(&self, camera: &Camera) -> Result<bool, Refusal> {
        let known = |camera: &Camera| Camera { calibration: None, vignetting: None, ..camera.clone() };
        // A number that was written may come back with another last digit.
        Ok(known(&Camera::from_json(&camera.to_json())?) == known(&self.camera))
    }

    /// Checks that the numbers belong together.
    fn check(&self) -> Result<(), Refusal> {
        let count = self.parameters.len();
        if let Some(key) = self.parameters.iter().find(|key| of_key(key).is_none()) {
            return Err(Refusal::new(format!("parameter '{key}'"), WANTED));
        }
        let fits = |list: &Vec<f64>| list.len() == count && list.iter().all(|value| value.is_finite());
        let is_whole = fits(&self.value_px)
            && fits(&self.gradient)
            && self.information.len() == count
            && self.information.iter().all(fits);
        let found = || "its lists differ in length or are not numbers";
        Refusal::unless(count > 0 && is_whole, found, WANTED)
    }

    /// The parameters.
    pub fn known(&self) -> impl Iterator<Item = &'static Parameter> + '_ {
        self.parameters.iter().filter_map(|key| of_key(key))
    }
}

fn of_key(key: &str) -> Option<&'static Parameter> {
    PARAMETERS.iter().find(|parameter| parameter.key == key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::seed;
    use crate::camera::{Aperture, Layout};

    /// A step moves a lenslet as far as its slope says.
    #[test]
    fn slopes_are_those_of_the_lattice() {
        let given = seed(40, Aperture::Circle, Layout::Square, 0.003);
        let pixel_mm = given.sensor.pixel_pitch_mm;
        for parameter in PARAMETERS {
            for at in [DVec2::new(1.1, -0.4), DVec2::new(-0.2, 0.8)] {
                let before = given.lattice().nearest_centre_mm(at);
                let seen_px = before * (1.0 + given.image_growth()) / pixel_mm;
                let Some(slope) = parameter.shift_px(&given, seen_px) else { continue };
                let moved = stepped(&given, [(&parameter, 0.5)]);
                let after = moved.lattice().nearest_centre_mm(before);
                let found = 2.0 * (after - before) / pixel_mm;
                assert!((found - slope).abs().max_element() < 2e-3, "{}: {found}, {slope}", parameter.key);
                assert!(slope.length() > 1e-3);
            }
        }
    }

    #[test]
    fn steps_add_up_and_go_back() {
        let mut given = seed(40, Aperture::Circle, Layout::Square, 0.003);
        let gap = PARAMETERS.iter().find(|parameter| parameter.what == What::Gap).unwrap();
        let [before, after] = [given.clone(), stepped(&given, [(gap, 0.3)])].map(|camera| camera.microlenses);
        assert!(after.gap_mm.unwrap() > before.focal_length_mm && after.focal_length_mm == before.focal_length_mm);
        // A gap that is given stays, and the way back is that of the focal length.
        given.microlenses.gap_mm = Some(given.gap_mm());
        let after = stepped(&given, [(gap, 0.3)]).microlenses;
        assert!(after.gap_mm == given.microlenses.gap_mm && after.focal_length_mm < before.focal_length_mm);
        for parameter in PARAMETERS.iter().filter(|parameter| parameter.key != "blur_px") {
            let moved = stepped(&given, [(parameter, 0.3)]);
            assert_ne!(moved, given, "{}", parameter.key);
            let moved = stepped(&moved, [(parameter, -0.3)]);
            let lattice = |camera: &Camera| camera.lattice().nearest_centre_mm(DVec2::new(0.4, -0.2));
            assert!(lattice(&moved).distance(lattice(&given)) < 1e-6, "{}", parameter.key);
            let f_number = moved.main_lens.working_f_number / given.main_lens.working_f_number;
            assert!((f_number - 1.0).abs() < 0.01 && moved.check().is_ok());
        }
    }
}
