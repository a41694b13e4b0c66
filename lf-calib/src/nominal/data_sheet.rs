//! From the data sheets to a camera, also to one in air that stands for one before a liquid.

use lf_core::camera::{Aperture, Blur, Layout, MainLens, Medium, Microlenses, Sensor, Telecentric};
use lf_core::{Camera, Refusal};

/// A camera as data sheets describe it.
#[derive(Debug, Clone, PartialEq)]
pub struct DataSheet {
    /// Columns and rows of the sensor.
    pub sensor_px: [usize; 2],
    /// Distance between pixels, mm.
    pub pixel_mm: f64,
    /// Focal length of the main lens, mm.
    pub focal_length_mm: f64,
    /// Magnification at the focal plane, without its sign.
    pub magnification: f64,
    /// Working f-number: image distance over the stop's diameter.
    pub working_f_number: f64,
    /// Shape of the stop.
    pub aperture: Aperture,
    /// Index of what a lens that is telecentric towards the object looks into; None for a thin lens.
    pub telecentric_index: Option<f64>,
    /// Wavelength of the light, nm; None if the lenslets do not diffract.
    pub wavelength_nm: Option<f64>,
    /// How the lenslets are packed.
    pub layout: Layout,
    /// Distance between neighbouring lenslets, mm.
    pub pitch_mm: f64,
    /// Focal length of the lenslets, mm.
    pub lenslet_focal_length_mm: f64,
}

/// A liquid that the camera looks into.
#[derive(Debug, Clone, PartialEq)]
pub enum Liquid {
    /// A camera in air stands for the one before the liquid.
    InAir {
        /// Index of the liquid, relative to air.
        index: f64,
    },
    /// The exact rays through liquid and window.
    Exact(Medium),
}

impl DataSheet {
    /// The camera of the data sheets. Refuses values that no camera has.
    pub fn camera(&self, liquid: Option<&Liquid>) -> Result<Camera, Refusal> {
        let mut camera = Camera {
            frame: Default::default(),
            sensor: Sensor { width: self.sensor_px[0], height: self.sensor_px[1], pixel_pitch_mm: self.pixel_mm },
            main_lens: MainLens {
                focal_length_mm: self.focal_length_mm,
                magnification: self.magnification,
                working_f_number: self.working_f_number,
                aperture: self.aperture,
                pupil_distance_mm: None,
                pupil_vergence_per_mm: None,
                telecentric: self.telecentric_index.map(|index| Telecentric { index }),
            },
            microlenses: Microlenses {
                layout: self.layout,
                pitch_mm: self.pitch_mm,
                focal_length_mm: self.lenslet_focal_length_mm,
                rotation_rad: 0.0,
                offset_mm: [0.0, 0.0],
                gap_mm: None,
            },
            distortion: None,
            aberrations: None,
            tilt: None,
            medium: None,
            centres: None,
            blades: None,
            second_stop: None,
            vignetting: None,
            blur: self.wavelength_nm.map(|nm| Blur { sigma_px: 0.0, wavelength_nm: Some(nm), ..Blur::default() }),
            sensor_noise: None,
            pose: None,
            calibration: None,
        };
        // Lengths are judged as typed; those of an equivalent camera are longer.
        camera.check()?;
        match liquid {
            None => {}
            Some(Liquid::InAir { index }) => camera = in_air(&camera, *index),
            Some(Liquid::Exact(medium)) => camera.medium = Some(medium.clone()),
        }
        camera.check().map(|()| camera)
    }
}

/// The camera in air that sees the same paraxial rays as a camera before a liquid of this index does.
///
/// In the liquid, a depth Z is Z / n deep for the lens: `beta = s_i / (s_o - Z / n) = n s_i / (n s_o - Z)`. So all
/// lengths along the axis grow by n: the focal lengths of the lens and of the lenslets, the gap, and the distance of
/// the exit pupil. The stop keeps its size, so the f-number grows by n too. The magnification is the same. The spot of
/// diffraction, which is the wavelength times the gap over the pitch, stays by a wavelength that is shorter by n.
pub fn in_air(camera: &Camera, index: f64) -> Camera {
    let mut camera = camera.clone();
    // Twelve digits: 200 mm times 1.333 are 266.6 mm, and not 266.59999999999997.
    let grown = |length: f64| format!("{:.11e}", length * index).parse().unwrap_or(length * index);
    camera.main_lens.focal_length_mm = grown(camera.main_lens.focal_length_mm);
    camera.main_lens.pupil_distance_mm = camera.main_lens.pupil_distance_mm.map(grown);
    camera.main_lens.pupil_vergence_per_mm = camera.main_lens.pupil_vergence_per_mm.map(|vergence| vergence / index);
    camera.main_lens.working_f_number = grown(camera.main_lens.working_f_number);
    camera.microlenses.focal_length_mm = grown(camera.microlenses.focal_length_mm);
    camera.microlenses.gap_mm = camera.microlenses.gap_mm.map(grown);
    if let Some(nm) = camera.blur.as_mut().and_then(|blur| blur.wavelength_nm.as_mut()) {
        *nm /= index;
    }
    camera.medium = None;
    camera
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::DVec2;
    use lf_core::Optics;

    /// The data sheets of the simulations' camera.
    pub fn seed() -> DataSheet {
        DataSheet {
            sensor_px: [1092, 1092],
            pixel_mm: 0.0055,
            focal_length_mm: 200.0,
            magnification: 1.0,
            working_f_number: 4.0,
            aperture: Aperture::Circle,
            telecentric_index: None,
            wavelength_nm: None,
            layout: Layout::Square,
            pitch_mm: 0.077,
            lenslet_focal_length_mm: 0.308,
        }
    }

    #[test]
    fn a_camera_in_air_sees_the_paraxial_rays_of_one_before_water() {
        let medium = Medium { index: 1.333, window_z_mm: 80.0, window_thickness_mm: 10.0, window_index: 1.5 };
        let sheet = DataSheet { wavelength_nm: Some(532.0), ..seed() };
        let before = sheet.camera(Some(&Liquid::Exact(medium))).unwrap();
        let in_air = sheet.camera(Some(&Liquid::InAir { index: 1.333 })).unwrap();
        let [spot_px, same_px] = [&before, &in_air].map(|camera| camera.diffraction().unwrap().unit_px);
        assert!((spot_px - same_px).abs() < 1e-9 && spot_px > 0.3, "{spot_px} {same_px}");
        let [exact, equivalent] = [&before, &in_air].map(Optics::new);
        for z in [-5.0, 0.0, 3.0] {
            for (object, aperture) in [(0.02, 0.1), (-0.03, 0.2), (0.01, -0.3)] {
                let [object, aperture] = [object, aperture].map(|x| DVec2::new(x, 0.5 * x));
                let [a, b] = [&exact, &equivalent].map(|optics| optics.array_from_object(object, z, aperture));
                assert!(a.distance(b) < 1e-7, "{z}: {a} {b}");
                let centre = DVec2::new(0.0385, 0.0385);
                let [a, b] = [&exact, &equivalent].map(|optics| optics.sensor_through(centre, a, aperture));
                assert!(a.distance(b) < 1e-9, "{z}: {a} {b}");
            }
        }
    }

    #[test]
    fn mistakes_of_a_unit_are_judged_as_typed() {
        let typed = DataSheet { pitch_mm: 77.0, ..seed() };
        let refused = typed.camera(Some(&Liquid::InAir { index: 1.333 })).unwrap_err();
        assert!(refused.found.starts_with("microlenses.pitch_mm is 77 (77 um are 0.077 mm)"), "{refused}");
    }
}
