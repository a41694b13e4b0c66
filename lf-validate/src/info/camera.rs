//! Description of a camera.

use super::description::Description;
use super::numbers::{figures, product, whole};
use lf_core::camera::{Aperture, Layout};
use lf_core::{Camera, frame, lattice::MOST_DEGREE};
use serde_json::Value;

/// Largest k D / p - 1 that counts as matched: a tenth of a pixel, with lenslets of 14 pixels.
const MATCHED: f64 = 0.007;

/// Describes a camera, with the lengths that follow from it.
pub fn camera(camera: &Camera) -> Description {
    let mut about = Description::new("plenoptic camera (camera.json)");
    about.line(frame::KEY, frame::MARK);
    sensor_and_lens(&mut about, camera);
    lenslets(&mut about, camera);
    resolution(&mut about, camera);
    blocks(&mut about, camera);
    if let Some(calibration) = camera.calibration.as_ref().and_then(Value::as_object) {
        let steps: Vec<&str> = calibration.keys().map(String::as_str).filter(|key| *key != "history").collect();
        about.line("calibration", steps.join(", "));
        let history = calibration.get("history").and_then(|steps| serde_json::from_value(steps.clone()).ok());
        about.history(&history.unwrap_or_default());
    }
    about
}

/// Width and height of the sensor.
fn sides_mm(camera: &Camera) -> [f64; 2] {
    [camera.sensor.width, camera.sensor.height].map(|n| n as f64 * camera.sensor.pixel_pitch_mm)
}

fn sensor_and_lens(about: &mut Description, camera: &Camera) {
    let (sensor, lens) = (&camera.sensor, &camera.main_lens);
    let [pixel, sides] = [figures(sensor.pixel_pitch_mm), product(&sides_mm(camera))];
    about.line("sensor", format!("{} x {} px of {pixel} mm = {sides} mm", sensor.width, sensor.height));
    let [focal, magnification] = [lens.focal_length_mm, lens.magnification].map(figures);
    about.line("main lens", format!("f {focal} mm, |M| {magnification}"));
    about.line("image distance s_i", format!("{} mm", figures(camera.image_distance_mm())));
    about.line("object distance s_o", format!("{} mm", figures(camera.object_distance_mm())));
    let stop = match (lens.aperture, camera.blades) {
        (Aperture::Circle, Some(blades)) => format!("an iris of {} blades", blades.count),
        (Aperture::Circle, None) => "round".to_string(),
        (Aperture::Square, _) => "square".to_string(),
    };
    if let Some(pupil) = lens.pupil_distance_mm {
        about.line("exit pupil", format!("{} mm from the array", figures(pupil)));
    }
    if let Some(vergence) = lens.pupil_vergence_per_mm {
        let distance = figures(camera.pupil_distance_mm().abs());
        let place = match vergence {
            0.0 => "at infinity".to_string(),
            behind if behind < 0.0 => format!("{distance} mm behind the array"),
            _ => format!("{distance} mm from the array"),
        };
        about.line("exit pupil", place);
    }
    if let Some(telecentric) = lens.telecentric {
        let index = figures(telecentric.index);
        about.line("telecentric", format!("towards the object, in a medium of index {index}"));
    }
    let number = figures(lens.working_f_number);
    about.line("aperture D", format!("{} mm, {stop}, working f-number {number}", figures(camera.aperture_mm())));
}

fn lenslets(about: &mut Description, camera: &Camera) {
    let (array, lattice, sides) = (&camera.microlenses, camera.lattice(), sides_mm(camera));
    let layout = match array.layout {
        Layout::Square => "square",
        Layout::Hexagonal => "hexagonal",
    };
    let pitch = figures(array.pitch_mm);
    about.line("lenslets", format!("{layout}, pitch {pitch} mm = {} px", figures(camera.pitch_px())));
    let turn = figures(1e3 * array.rotation_rad);
    about.line("", format!("turned {turn} mrad, offset {} mm", array.offset_mm.map(figures).join(", ")));
    let across = [sides[0] / array.pitch_mm, sides[1] / lattice.row_pitch_mm()];
    let total = sides[0] * sides[1] / lattice.cell_area_mm2();
    about.line("lenslets on the sensor", format!("{}, about {}", product(&across), whole(total.round() as u64)));
    about.line("demagnification k", figures(camera.demagnification()));
    let fill = camera.demagnification() * camera.aperture_mm() / array.pitch_mm;
    let verdict = match fill - 1.0 {
        over if over > MATCHED => "not matched: lenslet images overlap",
        under if under < -MATCHED => "not matched: gaps between lenslet images",
        _ => "matched",
    };
    about.line("lenslet image k D", format!("{} of the pitch: {verdict}", figures(fill)));
}

/// Adds the field of view, and the resolution at and about the focal plane.
fn resolution(about: &mut Description, camera: &Camera) {
    let view = camera.half_view_mm().map(|half| 2.0 * half);
    about.line("seen in focus", format!("{} mm", product(&view)));
    let pixel = camera.pixel_in_focus_mm();
    about.line("pixel in focus", format!("{} mm", figures(pixel)));
    let widths = [("pixel", camera.sensor.pixel_pitch_mm), ("lenslet", camera.microlenses.pitch_mm)];
    for (name, width) in widths {
        let depth = camera.depth_of_width_mm(width);
        let text = format!("{} mm = {} px in focus, of spread on the array", figures(depth), figures(depth / pixel));
        about.line(format!("depth for one {name}"), text);
    }
    let [away, towards] = camera.useful_depth_mm().map(figures);
    about.line("useful depth", format!("z from {away} to {towards} mm"));
}

/// Adds the parts of the camera beyond a thin lens and a perfect lattice.
fn blocks(about: &mut Description, camera: &Camera) {
    if let Some(medium) = &camera.medium {
        let window = match medium.window_thickness_mm {
            0.0 => String::new(),
            thick => format!(" behind {} mm of index {}", figures(thick), figures(medium.window_index)),
        };
        let (index, z) = (figures(medium.index), figures(medium.window_z_mm));
        about.line("medium", format!("index {index}{window}, its face at z = {z} mm"));
    }
    if let Some(tilt) = &camera.tilt {
        let [x, y] = [tilt.x_rad, tilt.y_rad].map(|turn| figures(1e3 * turn));
        about.line("tilt of the sensor", format!("{x} mrad along x, {y} mrad along y"));
    }
    if let Some(gap) = camera.microlenses.gap_mm {
        about.line("gap to the sensor", format!("{} mm, and not the focal length", figures(gap)));
    }
    if let Some(distortion) = &camera.distortion {
        let list = |numbers: &[f64]| numbers.iter().map(|&number| figures(number)).collect::<Vec<_>>().join(", ");
        let (radial, tangential) = (list(&distortion.radial), list(&distortion.tangential));
        about.line("distortion", format!("radial {radial}; tangential {tangential}"));
    }
    if let Some(terms) = camera.aberrations {
        let terms = [
            ("spherical", terms.spherical_px),
            ("secondary spherical", terms.secondary_spherical_px),
            ("coma", terms.coma_px),
            ("coma by mm of depth", terms.coma_px_per_mm),
            ("astigmatism", terms.astigmatism_px),
            ("field curvature", terms.field_curvature_px),
        ];
        let named = terms.iter().filter(|(_, px)| *px != 0.0).map(|(name, px)| format!("{name} {}", figures(*px)));
        let terms: Vec<String> = named.collect();
        about.line("aberrations", format!("{}: px at the rim of the stop and the sensor's corner", terms.join(", ")));
    }
    if let Some(blur) = camera.blur {
        let light = blur
            .wavelength_nm
            .map_or_else(|| "no diffraction".to_string(), |nm| format!("diffraction at {} nm", figures(nm)));
        let light = if camera.fresnel().is_some() { format!("{light}, Fresnel's pattern") } else { light };
        about.line("blur", format!("{light}, and a Gaussian of {} px", figures(blur.sigma_px)));
    }
    if let Some(centres) = &camera.centres {
        let terms = centres.x_mm.len();
        let degree = (1..=MOST_DEGREE).find(|degree| lf_core::lattice::terms(*degree) == terms);
        let degree = degree.map_or_else(|| format!("{terms} terms"), |degree| format!("degree {degree}"));
        about.line("lenslets depart", format!("from the perfect lattice, by a polynomial of {degree}"));
    }
    if let Some(flat) = &camera.vignetting {
        about.line("flat field", flat.display().to_string());
    }
    if camera.blocks().is_empty() {
        about.line(
            "beyond a thin lens",
            "nothing: no medium, tilt, gap, distortion, aberrations, blur, departures or flat field",
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::info::description::assert_shows;

    const SEED: &str = r#"{
        "sensor": {"width": 280, "height": 280, "pixel_pitch_mm": 0.0055},
        "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": "square"},
        "microlenses": {"layout": "square", "pitch_mm": 0.077, "focal_length_mm": 0.308,
                        "rotation_rad": 0.0, "offset_mm": [0.0, 0.0]}
    }"#;

    #[test]
    fn the_seed_camera_in_figures() {
        let seed = Camera::from_json(SEED).unwrap();
        let text = self::camera(&seed).to_string();
        assert_shows(&text, &["280 x 280 px of 0.0055 mm = 1.54 x 1.54 mm", "400 mm", "100 mm, square", "= 14 px"]);
        assert_shows(&text, &["20 x 20, about 400", "0.00077", "1 of the pitch: matched", "1.54 x 1.54 mm"]);
        assert_shows(&text, &["nothing: no medium", "z from -4.3", " to 4.2"]);
        let unmatched = SEED.replace("\"working_f_number\": 4.0", "\"working_f_number\": 8.0");
        let text = self::camera(&Camera::from_json(&unmatched).unwrap()).to_string();
        assert!(text.contains("0.5 of the pitch: not matched: gaps"), "{text}");
    }

    #[test]
    fn every_block_has_its_line() {
        let blocks = r#","medium": {"index": 1.333, "window_z_mm": 100}, "tilt": {"x_rad": 0.001, "y_rad": 0},
            "distortion": {"radial": [0.5, 0, 0]}, "aberrations": {"coma_px": 0.4}, "blur": {"wavelength_nm": 532, "sigma_px": 0.3},
            "centres": {"radius_mm": 1, "x_mm": [0, 0, 0, 0, 0], "y_mm": [0, 0, 0, 0, 0]},
            "vignetting": "flat.exr", "calibration": {"lattice": {}, "history": []}}"#;
        let text = SEED.trim().strip_suffix('}').unwrap().replace("0.308,", "0.308, \"gap_mm\": 0.31,") + blocks;
        let camera = Camera::from_json(&text).unwrap();
        assert_eq!(camera.blocks().len(), 8);
        let text = self::camera(&camera).to_string();
        assert_shows(
            &text,
            &[
                "index 1.333, its",
                "1 mrad along x",
                "0.31 mm",
                "radial 0.5, 0, 0",
                "coma 0.4: px at the rim",
                "532 nm, and a Gaussian of 0.3 px",
            ],
        );
        assert_shows(&text, &["degree 2", "flat.exr", "lattice\n"]);
    }
}
