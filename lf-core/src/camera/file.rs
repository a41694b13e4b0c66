//! `camera.json` from and to text, and which of its values are refused.

use super::model::{Aperture, Blur, Camera, Distortion, Medium, SensorNoise, Telecentric, Tilt};
use crate::{Error, Refusal, io, json};
use std::path::{Path, PathBuf};

const WANTED: &str = "wanted a camera.json as `lf-calib nominal` prints one";

impl Camera {
    /// Reads and checks a camera file; `-` is standard input.
    pub fn open(path: &Path) -> crate::Result<Self> {
        let text = io::open_text(path).map_err(|error| match error.found.ends_with("no text") {
            true => Error { wanted: WANTED.to_string(), ..error },
            false => error,
        })?;
        Self::from_json(&text).map_err(|refusal| refusal.about(io::name(path)))
    }

    /// Reads and checks a camera.
    pub fn from_json(text: &str) -> Result<Self, Refusal> {
        let value: serde_json::Value =
            serde_json::from_str(text).map_err(|error| Refusal::new(format!("not JSON ({error})"), WANTED))?;
        let camera: Self = json::read(&value).map_err(|found| Refusal::new(found, WANTED))?;
        camera.check().map(|()| camera)
    }

    /// The camera as indented JSON with a final line end.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a camera is plain data") + "\n"
    }

    /// Path of the flat-field image of a camera that was read from `file`: `vignetting`, relative to the file's folder.
    pub fn flat_field(&self, file: &Path) -> Option<PathBuf> {
        self.vignetting.as_ref().map(|flat| file.parent().unwrap_or(Path::new("")).join(flat))
    }

    /// Checks that an image is as large as the sensor. `name` is its name in the message.
    pub fn check_image(&self, name: &str, width: usize, height: usize) -> crate::Result<()> {
        let wanted = format!("wanted the camera's {} x {} px", self.sensor.width, self.sensor.height);
        let fits = (width, height) == (self.sensor.width, self.sensor.height);
        Refusal::unless(fits, || format!("image of {width} x {height} px"), wanted)
            .map_err(|refusal| refusal.about(name))
    }
}

/// Largest width or height of a sensor, px.
const MOST_PIXELS: usize = 1 << 20;

/// Largest tilt of the sensor, rad.
const MOST_TILT_RAD: f64 = 0.5;

/// Largest k = f_l / l: the thin-lens equations hold for microlenses that are short beside the exit pupil's distance.
const MOST_DEMAGNIFICATION: f64 = 0.5;

/// Largest sine of a ray before a telecentric lens: the best oil objectives have 0.96.
const MOST_SINE: f64 = 0.97;

fn positive(key: &str, value: f64) -> Result<(), Refusal> {
    Refusal::unless(value.is_finite() && value > 0.0, || format!("{key} is {value}"), "wanted a positive number")
}

pub(super) fn finite(key: &str, values: &[f64]) -> Result<(), Refusal> {
    let is_finite = |value: &f64| {
        Refusal::unless(value.is_finite(), || format!("{key} has the number {value}"), "wanted finite numbers")
    };
    values.iter().try_for_each(is_finite)
}

impl Camera {
    /// Refuses numbers that are not finite or have the wrong sign, more than 2^20 px a side, lengths that no plenoptic
    /// camera has, a tilt that brings the sensor to the array, no air before the lens, and microlenses whose focal
    /// length is half the image distance.
    pub fn check(&self) -> Result<(), Refusal> {
        positive("sensor.pixel_pitch_mm", self.sensor.pixel_pitch_mm)?;
        positive("main_lens.focal_length_mm", self.main_lens.focal_length_mm)?;
        positive("main_lens.magnification", self.main_lens.magnification)?;
        positive("main_lens.working_f_number", self.main_lens.working_f_number)?;
        self.main_lens.pupil_distance_mm.map_or(Ok(()), |mm| positive("main_lens.pupil_distance_mm", mm))?;
        self.check_pupil()?;
        let (width, height) = (self.sensor.width, self.sensor.height);
        let fits = [width, height].iter().all(|side| (1..=MOST_PIXELS).contains(side));
        let wanted = format!("wanted 1 to {MOST_PIXELS} px a side");
        Refusal::unless(fits, || format!("sensor is {width} x {height} px"), wanted)?;
        self.check_microlenses()?;
        self.check_plausible()?;
        if let Some(Distortion { radial, tangential }) = &self.distortion {
            finite("distortion.radial", radial)?;
            finite("distortion.tangential", tangential)?;
        }
        self.check_aberrations()?;
        if let Some(tilt) = &self.tilt {
            self.check_tilt(tilt)?;
        }
        if let Some(medium) = &self.medium {
            medium.check(self.object_distance_mm())?;
        }
        if let Some(pose) = &self.pose {
            pose.check()?;
        }
        if let Some(blur) = &self.blur {
            self.check_blur(blur)?;
        }
        if let Some(SensorNoise { gain_counts, read_noise_counts }) = self.sensor_noise {
            positive("sensor_noise.gain_counts", gain_counts)?;
            positive("sensor_noise.read_noise_counts", read_noise_counts)?;
        }
        if let Some(centres) = &self.centres {
            centres.check()?;
        }
        if let Some(blades) = &self.blades {
            blades.check()?;
            let found = || "blades, and main_lens.aperture is 'square'";
            Refusal::unless(self.main_lens.aperture == Aperture::Circle, found, "wanted 'circle' with blades")?;
        }
        if let Some(stop) = &self.second_stop {
            stop.check()?;
        }
        let found = || format!("microlens focal length {} mm", self.microlenses.focal_length_mm);
        let from =
            if self.main_lens.pupil_distance_mm.is_some() { "distance of the exit pupil" } else { "image distance" };
        let wanted = format!("wanted less than half the {from} of {} mm", self.stop_distance_mm());
        Refusal::unless(self.demagnification() < MOST_DEMAGNIFICATION, found, wanted)
    }

    /// Refuses an exit pupil that is given twice or stands near the array, and a telecentric lens that takes in light
    /// from beside it.
    fn check_pupil(&self) -> Result<(), Refusal> {
        if let Some(vergence) = self.main_lens.pupil_vergence_per_mm {
            finite("main_lens.pupil_vergence_per_mm", &[vergence])?;
            let is_twice = self.main_lens.pupil_distance_mm.is_some();
            let found = || "main_lens has 'pupil_distance_mm' and 'pupil_vergence_per_mm'";
            Refusal::unless(!is_twice, found, "wanted one of the two")?;
            let found = || format!("main_lens.pupil_vergence_per_mm is {vergence}");
            let most = MOST_DEMAGNIFICATION / self.gap_mm();
            let wanted = format!("wanted -{most:.4} to {most:.4}, half of 1 over the gap behind the array");
            Refusal::unless(self.image_growth().abs() < MOST_DEMAGNIFICATION, found, wanted)?;
        }
        let Some(Telecentric { index }) = self.main_lens.telecentric else { return Ok(()) };
        let found = || format!("main_lens.telecentric.index is {index}");
        Refusal::unless((1.0..=4.0).contains(&index), found, "wanted 1 to 4")?;
        let found = || "a telecentric lens and 'medium'";
        Refusal::unless(self.medium.is_none(), found, "wanted the medium as main_lens.telecentric.index")?;
        let (sine, number) = (self.steepest_sine(), self.main_lens.working_f_number);
        let found = || format!("main_lens.working_f_number {number} asks for rays of sine {sine:.2} before the lens");
        Refusal::unless(sine < MOST_SINE, found, format!("wanted a sine of at most {MOST_SINE}"))
    }

    /// Refuses a blur that is not finite, and one that is wider than a quarter of a lenslet.
    fn check_blur(&self, blur: &Blur) -> Result<(), Refusal> {
        let Blur { sigma_px, wavelength_nm, pattern } = *blur;
        let is_length = sigma_px.is_finite() && sigma_px >= 0.0;
        Refusal::unless(is_length, || format!("blur.sigma_px is {sigma_px}"), "wanted 0 or more")?;
        let is_light = wavelength_nm.is_none_or(|nm| (100.0..=20_000.0).contains(&nm));
        let found = || format!("blur.wavelength_nm is {}", wavelength_nm.unwrap_or_default());
        Refusal::unless(is_light, found, "wanted 100 to 20000 nm, such as 532")?;
        let is_seen = pattern.is_none() || wavelength_nm.is_some();
        Refusal::unless(is_seen, || "blur.pattern without blur.wavelength_nm".to_string(), "wanted both")?;
        let (core_px, most_px) = (self.blur_core_px(), 0.25 * self.pitch_px());
        let found = || format!("the blur has a standard deviation of {core_px:.2} px");
        Refusal::unless(core_px <= most_px, found, format!("wanted at most a quarter of a lenslet, {most_px:.2} px"))
    }

    fn check_microlenses(&self) -> Result<(), Refusal> {
        let lenslets = &self.microlenses;
        positive("microlenses.pitch_mm", lenslets.pitch_mm)?;
        positive("microlenses.focal_length_mm", lenslets.focal_length_mm)?;
        finite("microlenses.rotation_rad", &[lenslets.rotation_rad])?;
        finite("microlenses.offset_mm", &lenslets.offset_mm)?;
        lenslets.gap_mm.map_or(Ok(()), |gap_mm| positive("microlenses.gap_mm", gap_mm))
    }

    fn check_tilt(&self, Tilt { x_rad, y_rad }: &Tilt) -> Result<(), Refusal> {
        let is_small = x_rad.abs() < MOST_TILT_RAD && y_rad.abs() < MOST_TILT_RAD;
        let wanted = format!("wanted less than {MOST_TILT_RAD} rad each way");
        Refusal::unless(is_small, || format!("tilt is ({x_rad}, {y_rad}) rad"), wanted)?;
        let [half_width, half_height] =
            [self.sensor.width, self.sensor.height].map(|pixels| 0.5 * pixels as f64 * self.sensor.pixel_pitch_mm);
        let (nearer, gap) = (x_rad.abs().tan() * half_width + y_rad.abs().tan() * half_height, self.gap_mm());
        let found = || format!("tilt brings the sensor {nearer:.3} mm nearer to the array");
        Refusal::unless(nearer < gap, found, format!("wanted less than the gap of {gap:.3} mm"))
    }
}

impl Medium {
    fn check(&self, object_distance_mm: f64) -> Result<(), Refusal> {
        for (key, index) in [("index", self.index), ("window_index", self.window_index)] {
            Refusal::unless((1.0..=4.0).contains(&index), || format!("medium.{key} is {index}"), "wanted 1 to 4")?;
        }
        let thickness = self.window_thickness_mm;
        let found = || format!("medium.window_thickness_mm is {thickness}");
        Refusal::unless(thickness.is_finite() && thickness >= 0.0, found, "wanted 0 or more")?;
        let air = self.air_mm(object_distance_mm);
        let found = || format!("medium.window_z_mm is {}", self.window_z_mm);
        Refusal::unless(air.is_finite() && air > 0.0, found, "wanted air between the window and the main lens")
    }
}
