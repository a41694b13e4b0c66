//! Which lengths no plenoptic camera has. Most are slips of a unit, and the value that was meant is named.

use super::model::Camera;
use crate::Refusal;

/// Distance between pixels, mm. Image sensors have 0.0005 to 0.03, binned ones a few times more.
const PIXEL_MM: [f64; 2] = [2e-4, 0.2];
/// Pitch of the lenslets, px, and the range in which a guess is believed.
const PITCH_PX: [f64; 2] = [1.0, 1000.0];
const LIKELY_PITCH_PX: [f64; 2] = [4.0, 300.0];
/// Focal length of a lenslet over its pitch: its f-number.
const LENSLET_F_NUMBER: [f64; 2] = [0.3, 300.0];
const LIKELY_LENSLET_F_NUMBER: [f64; 2] = [1.0, 60.0];
/// Focal length of the main lens, mm: from a microscope's objective to a telescope.
const FOCAL_MM: [f64; 2] = [1.0, 20_000.0];
const LIKELY_FOCAL_MM: [f64; 2] = [2.0, 2000.0];
/// Magnification, and image distance over the stop's diameter.
const MAGNIFICATION: [f64; 2] = [1e-4, 1000.0];
const F_NUMBER: [f64; 2] = [0.3, 1000.0];
/// Smallest focal length of the main lens over its diameter f (1 + m) / N: 0.5 takes all light in air, 0.36 with the
/// best oil.
const LEAST_LENS_F_NUMBER: f64 = 0.3;
/// Distance of the exit pupil over the image distance: long for lenses that are telecentric towards the sensor.
const PUPIL: [f64; 2] = [0.1, 1e4];
/// Half the sensor's diagonal over the image distance: the tangent of half the field angle.
const MOST_FIELD: f64 = 3.0;
/// Distance from array to sensor over the lenslets' focal length.
const GAP: [f64; 2] = [0.1, 10.0];
/// Largest rotation of a lattice, rad: a whole turn.
const MOST_ROTATION_RAD: f64 = std::f64::consts::TAU;

/// Units that are written for mm by mistake, and their length in mm.
const UNITS: [(f64, &str); 3] = [(1e-3, "um"), (1e3, "m"), (10.0, "cm")];

fn is_within(value: f64, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&value)
}

/// A number with four digits, in the unit that it is in.
fn digits(value: f64) -> String {
    format!("{}", format!("{value:.3e}").parse::<f64>().unwrap_or(value))
}

/// Implausible values, and which values would be plausible.
#[derive(Default)]
struct Slips {
    found: Vec<String>,
    wanted: Vec<String>,
}

impl Slips {
    /// Checks a length in mm. Returns it, or the length that was probably meant.
    fn length(
        &mut self,
        key: &str,
        value: f64,
        range: [f64; 2],
        likely: [f64; 2],
        wanted: impl FnOnce() -> String,
    ) -> f64 {
        if is_within(value, range) {
            return value;
        }
        let meant = UNITS.iter().find(|(unit_mm, _)| is_within(value * unit_mm, likely));
        let guess = meant.map_or_else(String::new, |(unit_mm, unit)| {
            format!(" ({} {unit} are {} mm)", digits(value), digits(value * unit_mm))
        });
        self.found.push(format!("{key} is {}{guess}", digits(value)));
        self.wanted.push(wanted());
        meant.map_or(value, |(unit_mm, _)| value * unit_mm)
    }

    /// Checks a number that has no unit.
    fn number(&mut self, key: &str, value: f64, [low, high]: [f64; 2]) {
        if !is_within(value, [low, high]) {
            self.found.push(format!("{key} is {}", digits(value)));
            self.wanted.push(format!("{key} from {low} to {high}"));
        }
    }
}

impl Camera {
    /// Refuses lengths and numbers that no plenoptic camera has, all in one message. They must be positive.
    pub(super) fn check_plausible(&self) -> Result<(), Refusal> {
        let (lens, array) = (&self.main_lens, &self.microlenses);
        let mut slips = Slips::default();
        let [low, high] = PIXEL_MM;
        let pixels = || format!("pixels of {low} to {high} mm");
        let pixel = slips.length("sensor.pixel_pitch_mm", self.sensor.pixel_pitch_mm, PIXEL_MM, PIXEL_MM, pixels);
        let pitches = |bounds: [f64; 2], unit: f64| bounds.map(|bound| bound * unit);
        let (range, likely) = (pitches(PITCH_PX, pixel), pitches(LIKELY_PITCH_PX, pixel));
        let wide = || format!("lenslets of {} to {} pixels of {} mm", PITCH_PX[0], PITCH_PX[1], digits(pixel));
        let pitch = slips.length("microlenses.pitch_mm", array.pitch_mm, range, likely, wide);
        let (range, likely) = (pitches(LENSLET_F_NUMBER, pitch), pitches(LIKELY_LENSLET_F_NUMBER, pitch));
        let [low, high] = LENSLET_F_NUMBER;
        let short = || format!("a lenslet's focal length of {low} to {high} pitches");
        let focal = slips.length("microlenses.focal_length_mm", array.focal_length_mm, range, likely, short);
        if let Some(gap_mm) = array.gap_mm {
            let near = || "a gap near the lenslets' focal length".to_owned();
            let range = pitches(GAP, focal);
            slips.length("microlenses.gap_mm", gap_mm, range, range, near);
        }
        let [low, high] = FOCAL_MM;
        let lenses = || format!("a main lens of {low} to {high} mm");
        let key = "main_lens.focal_length_mm";
        let focal = slips.length(key, lens.focal_length_mm, FOCAL_MM, LIKELY_FOCAL_MM, lenses);
        slips.number("main_lens.magnification", lens.magnification, MAGNIFICATION);
        slips.number("main_lens.working_f_number", lens.working_f_number, F_NUMBER);
        let widest = lens.working_f_number / (1.0 + lens.magnification);
        if widest < LEAST_LENS_F_NUMBER
            && lens.magnification <= MAGNIFICATION[1]
            && lens.working_f_number >= F_NUMBER[0]
        {
            let (number, magnification) = (digits(lens.working_f_number), digits(lens.magnification));
            let found = format!("main_lens.working_f_number is {number} at magnification {magnification}");
            slips.found.push(format!("{found}, a lens {} times as wide as its focal length", digits(1.0 / widest)));
            slips.wanted.push(format!("at least {} (1 + m)", LEAST_LENS_F_NUMBER));
        }
        if let Some(pupil_mm) = lens.pupil_distance_mm {
            let range = pitches(PUPIL, focal * (1.0 + lens.magnification));
            let near = || format!("an exit pupil at {} to {} image distances, f (1 + m)", PUPIL[0], PUPIL[1]);
            slips.length("main_lens.pupil_distance_mm", pupil_mm, range, range, near);
        }
        let (half, far) = (0.5 * pixel * self.diagonal_px(), focal * (1.0 + lens.magnification));
        if half > MOST_FIELD * far {
            slips.found.push(format!("the sensor is {:.0} mm wide, {} mm from the main lens", 2.0 * half, digits(far)));
            slips.wanted.push(format!("at most {} times that distance", 2.0 * MOST_FIELD));
        }
        self.check_lattice_place(&mut slips, pixel, pitch);
        let plausible = slips.found.is_empty();
        Refusal::unless(plausible, || slips.found.join(", "), format!("wanted {}", slips.wanted.join(", ")))
    }

    /// Checks where the lattice is and how it is turned.
    fn check_lattice_place(&self, slips: &mut Slips, pixel_mm: f64, pitch_mm: f64) {
        let turn = self.microlenses.rotation_rad;
        if turn.abs() > MOST_ROTATION_RAD {
            let radians = digits(turn.to_radians());
            slips.found.push(format!("microlenses.rotation_rad is {turn} ({turn} degrees are {radians} rad)"));
            slips.wanted.push("at most a whole turn of 6.28 rad".to_owned());
        }
        // A lattice is the same a pitch aside, also on a sensor of a few pixels.
        let half_mm = (0.5 * pixel_mm * self.diagonal_px()).max(2.0 * pitch_mm);
        for offset in self.microlenses.offset_mm {
            let key = "microlenses.offset_mm";
            let on_sensor = || format!("an offset on the sensor, at most {} mm from its middle", digits(half_mm));
            slips.length(key, offset.abs(), [0.0, half_mm], [0.0, half_mm], on_sensor);
        }
    }

    pub(super) fn diagonal_px(&self) -> f64 {
        (self.sensor.width as f64).hypot(self.sensor.height as f64)
    }
}

#[cfg(test)]
mod tests {
    use crate::camera::tests::seed;
    use crate::camera::{Aperture, Camera, Layout};

    fn refused(change: impl FnOnce(&mut Camera)) -> String {
        let mut camera = seed(60, Aperture::Circle, Layout::Square, 0.0);
        change(&mut camera);
        camera.check().unwrap_err().to_string()
    }

    #[test]
    fn slips_of_a_unit_are_refused_with_the_value_meant() {
        assert_eq!(
            refused(|camera| camera.microlenses.pitch_mm = 77.0),
            "microlenses.pitch_mm is 77 (77 um are 0.077 mm); wanted lenslets of 1 to 1000 pixels of 0.0055 mm"
        );
        let text = refused(|camera| camera.microlenses.pitch_mm = 0.000_077);
        assert!(text.starts_with("microlenses.pitch_mm is 0.000077 (0.000077 m are 0.077 mm);"), "{text}");
        let text = refused(|camera| camera.main_lens.focal_length_mm = 0.2);
        assert!(text.starts_with("main_lens.focal_length_mm is 0.2 (0.2 m are 200 mm); wanted a main lens"), "{text}");
        let text = refused(|camera| camera.microlenses.focal_length_mm = 308.0);
        assert!(text.starts_with("microlenses.focal_length_mm is 308 (308 um are 0.308 mm); wanted"), "{text}");
        let text = refused(|camera| camera.microlenses.rotation_rad = 30.0);
        assert!(text.contains("30 degrees are 0.5236 rad"), "{text}");
        let text = refused(|camera| camera.microlenses.offset_mm = [0.0, -11.0]);
        assert!(text.starts_with("microlenses.offset_mm is 11 (11 um are 0.011 mm)"), "{text}");
        let text = refused(|camera| camera.microlenses.gap_mm = Some(310.0));
        assert!(text.starts_with("microlenses.gap_mm is 310 (310 um are 0.31 mm)"), "{text}");
    }

    /// Scar: light of such a lens covers millions of lenslets, and weights had no end.
    #[test]
    fn a_lens_wider_than_light_is_refused() {
        let text = refused(|camera| camera.main_lens.magnification = 63.0);
        let wanted = "main_lens.working_f_number is 4 at magnification 63, a lens 16 times as wide as its focal length";
        assert!(text.starts_with(wanted), "{text}");
    }

    /// Scar: light of a pupil this near covers millions of lenslets, and weights had no end.
    #[test]
    fn an_exit_pupil_at_the_array_is_refused() {
        let text = refused(|camera| {
            (camera.main_lens.magnification, camera.main_lens.working_f_number) = (64.0, 30.0);
            camera.main_lens.pupil_distance_mm = Some(350.0);
        });
        let wanted = "main_lens.pupil_distance_mm is 350 (350 m are 350000 mm); wanted an exit pupil at 0.1 to 10000";
        assert!(text.starts_with(wanted), "{text}");
    }

    #[test]
    fn all_slips_are_named_at_once() {
        let text = refused(|camera| {
            camera.sensor.pixel_pitch_mm = 5.5;
            camera.microlenses.pitch_mm = 77.0;
            camera.microlenses.focal_length_mm = 308.0;
        });
        for words in ["5.5 um are 0.0055 mm", "77 um are 0.077 mm", "308 um are 0.308 mm", "pixels of 0.0002 to 0.2 mm"]
        {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(!text.contains("the sensor is"), "{text}");
    }

    #[test]
    fn a_sensor_much_wider_than_its_distance_is_refused() {
        let text = refused(|camera| {
            camera.sensor.width = 30_000;
            camera.main_lens.focal_length_mm = 2.0;
        });
        assert!(text.starts_with("the sensor is 165 mm wide, 4 mm from the main lens;"), "{text}");
    }

    /// Cameras from phones to microscopes: pixel, pitch, lenslet's focal length, main focal length, magnification,
    /// working f-number.
    #[test]
    fn real_cameras_are_plausible() {
        for [pixel, pitch, short, focal, magnification, number] in [
            [0.0055, 0.077, 0.308, 200.0, 1.0, 4.0],
            [0.0014, 0.02, 0.04, 6.5, 0.05, 2.1],
            [0.00647, 0.1, 2.1, 4.5, 40.0, 21.0],
            [0.00645, 0.125, 2.5, 9.0, 20.0, 20.0],
            [0.009, 0.5, 1.7, 50.0, 0.1, 3.4],
            [0.0065, 1.3, 26.0, 180.0, 0.5, 20.0],
            [0.02, 0.06, 0.5, 100.0, 0.5, 8.0],
        ] {
            let mut camera = seed(60, Aperture::Circle, Layout::Square, 0.0);
            camera.sensor.pixel_pitch_mm = pixel;
            (camera.microlenses.pitch_mm, camera.microlenses.focal_length_mm) = (pitch, short);
            (camera.main_lens.focal_length_mm, camera.main_lens.magnification) = (focal, magnification);
            camera.main_lens.working_f_number = number;
            camera.check().unwrap();
        }
    }
}
