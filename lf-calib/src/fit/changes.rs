//! A set of parameter changes: the camera and the target's pose that result from it.

use super::{keep_images::Drift, keep_images::keep_images, parameter::Parameter};
use glam::{DMat3, DVec2, DVec3};
use lf_core::{Camera, camera::Distortion, camera::Tilt};
use serde_json::{Value, json};

/// Changes of all parameters, against the given camera and the stated position of the target.
#[derive(Clone, Copy)]
pub(crate) struct Changes([f64; Parameter::ALL.len()]);

impl Changes {
    pub const NONE: Self = Self([0.0; Parameter::ALL.len()]);

    pub fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter as usize]
    }

    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter as usize] = value;
    }

    /// These changes with one parameter moved by `step`.
    pub fn plus(&self, parameter: Parameter, step: f64) -> Self {
        let mut moved = *self;
        moved.0[parameter as usize] += step;
        moved
    }

    /// The camera with these changes. Blocks such as `tilt` are added only if they are not 0.
    pub fn camera(&self, before: &Camera) -> Camera {
        use Parameter as P;
        let mut camera = before.clone();
        let is_lattice = |parameter| matches!(parameter, P::LatticeX | P::LatticeY | P::LatticeTurn);
        for &parameter in Parameter::ALL.iter().filter(|p| self.get(**p) != 0.0 && !is_lattice(**p)) {
            number_of(&mut camera, parameter).into_iter().for_each(|number| *number += self.get(parameter));
        }
        let drift = Drift {
            shift_mm: DVec2::new(self.get(P::LatticeX), self.get(P::LatticeY)),
            turn_rad: self.get(P::LatticeTurn),
        };
        keep_images(&mut camera, before, drift);
        if is_stop_measured(before) {
            // The stop's image under a lenslet is as wide as the gap over the f-number.
            camera.main_lens.working_f_number *= camera.gap_mm() / before.gap_mm();
        }
        camera
    }

    pub fn pose(&self) -> TargetPose {
        use Parameter as P;
        let turn = DVec3::new(self.get(P::TargetLeanY), -self.get(P::TargetLeanX), self.get(P::TargetTurn));
        TargetPose {
            turn: if turn == DVec3::ZERO {
                DMat3::IDENTITY
            } else {
                DMat3::from_axis_angle(turn.normalize(), turn.length())
            },
            skew: DVec2::new(self.get(P::SkewX), self.get(P::SkewY)),
            shift_mm: DVec3::new(self.get(P::TargetX), self.get(P::TargetY), self.get(P::FocusOffset)),
        }
    }

    /// The value for a report: of the camera or, if the parameter does not belong to it, of the target.
    pub fn value(&self, parameter: Parameter, before: &Camera) -> f64 {
        match number_of(&mut self.camera(before), parameter) {
            Some(number) => *number,
            // A camera without a medium.
            None if matches!(parameter, Parameter::Index | Parameter::Window) => 0.0,
            None => self.get(parameter),
        }
    }
}

/// Whether a white image has shown the lenslets of a camera.
pub(crate) fn is_white_known(camera: &Camera) -> bool {
    white_results(camera).is_some()
}

/// Results of the calibration by white images.
fn white_results(camera: &Camera) -> Option<&Value> {
    camera.calibration.as_ref()?.get("lattice")
}

/// Whether a white image has shown the f-number of a camera.
fn is_stop_measured(camera: &Camera) -> bool {
    let shown = white_results(camera).and_then(|results| results.get("working_f_number")?.as_f64());
    // Numbers that went through a file.
    shown.is_some_and(|shown| (shown / camera.main_lens.working_f_number - 1.0).abs() < 1e-9)
}

/// The number of a camera that a parameter stands for, which is added if it is missing. None for a target's parameter,
/// and for one of a medium if the camera has none.
fn number_of(camera: &mut Camera, parameter: Parameter) -> Option<&mut f64> {
    use Parameter as P;
    let (gap_mm, pupil_mm) = (camera.gap_mm(), camera.pupil_distance_mm());
    let Camera { main_lens, microlenses, tilt, distortion, aberrations, medium, .. } = camera;
    let (level, straight) = (Tilt { x_rad: 0.0, y_rad: 0.0 }, Distortion { radial: [0.0; 3], tangential: [0.0; 2] });
    Some(match parameter {
        P::Magnification => &mut main_lens.magnification,
        P::FocalLength => &mut main_lens.focal_length_mm,
        P::Gap => microlenses.gap_mm.get_or_insert(gap_mm),
        P::Pupil => main_lens.pupil_distance_mm.get_or_insert(pupil_mm),
        P::Vergence => main_lens.pupil_vergence_per_mm.get_or_insert(1.0 / pupil_mm),
        P::LatticeX => &mut microlenses.offset_mm[0],
        P::LatticeY => &mut microlenses.offset_mm[1],
        P::LatticeTurn => &mut microlenses.rotation_rad,
        P::TiltX => &mut tilt.get_or_insert(level).x_rad,
        P::TiltY => &mut tilt.get_or_insert(level).y_rad,
        P::K1 | P::K2 | P::K3 => &mut distortion.get_or_insert(straight).radial[parameter as usize - P::K1 as usize],
        P::P1 | P::P2 => &mut distortion.get_or_insert(straight).tangential[parameter as usize - P::P1 as usize],
        P::Spherical => &mut aberrations.get_or_insert_default().spherical_px,
        P::SecondarySpherical => &mut aberrations.get_or_insert_default().secondary_spherical_px,
        P::Coma => &mut aberrations.get_or_insert_default().coma_px,
        P::ComaGrowth => &mut aberrations.get_or_insert_default().coma_px_per_mm,
        P::Astigmatism => &mut aberrations.get_or_insert_default().astigmatism_px,
        P::FieldCurvature => &mut aberrations.get_or_insert_default().field_curvature_px,
        P::Index => &mut medium.as_mut()?.index,
        P::Window => &mut medium.as_mut()?.window_z_mm,
        _ => return None,
    })
}

/// Where the target stands in front of the camera.
pub(crate) struct TargetPose {
    turn: DMat3,
    skew: DVec2,
    shift_mm: DVec3,
}

impl TargetPose {
    /// Position in front of the camera, mm, of a point on the target at its stated depth.
    pub fn place_mm(&self, target_mm: DVec3) -> DVec3 {
        let aside = (self.skew * target_mm.z).extend(0.0);
        self.turn * (target_mm + aside) + self.shift_mm
    }
}

/// Writes `found` as `calibration.<task>`. A `calibration` that is no JSON object is replaced.
pub(crate) fn record(camera: &mut Camera, task: &str, found: Value) {
    let calibration = camera.calibration.get_or_insert_with(|| json!({}));
    if !calibration.is_object() {
        *calibration = json!({});
    }
    calibration[task] = found;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::view::tests::seed;
    use lf_core::camera::Layout;

    #[test]
    fn no_change_is_the_same_camera_and_one_change_is_one_number() {
        let before = seed(40, Layout::Square);
        assert_eq!(Changes::NONE.camera(&before), before);
        let mut wanted = before.clone();
        wanted.distortion = Some(Distortion { radial: [0.0, 3.0, 0.0], tangential: [0.0; 2] });
        assert_eq!(Changes::NONE.plus(Parameter::K2, 3.0).camera(&before), wanted);
        for &parameter in Parameter::ALL {
            let step = parameter.step(&before);
            let changed = Changes::NONE.plus(parameter, step);
            let grown = changed.value(parameter, &before) - Changes::NONE.value(parameter, &before);
            // Without a medium its index cannot change. The lenslets are nearer to the axis than their images.
            let wanted = if matches!(parameter, Parameter::Index | Parameter::Window) { 0.0 } else { step };
            assert!((grown - wanted).abs() < 1e-3 * step, "{parameter:?} {grown} {step}");
            changed.camera(&before).check().unwrap();
        }
    }

    #[test]
    fn the_stop_keeps_the_width_that_a_white_image_has_shown() {
        let mut before = seed(40, Layout::Square);
        let change = Changes::NONE.plus(Parameter::Gap, 0.1 * before.gap_mm());
        assert_eq!(change.camera(&before).main_lens.working_f_number, before.main_lens.working_f_number);
        let shown = json!({"working_f_number": before.main_lens.working_f_number});
        record(&mut before, "lattice", shown);
        let after = change.camera(&before).main_lens.working_f_number;
        assert!((after - 1.1 * before.main_lens.working_f_number).abs() < 1e-9, "{after}");
    }

    #[test]
    fn target_poses_by_hand() {
        let at = |parameter, place| Changes::NONE.plus(parameter, 1e-4).pose().place_mm(place);
        let corner = DVec3::new(2.0, -3.0, 4.0);
        let near = |found: DVec3, wanted: DVec3| assert!(found.distance(corner + 1e-4 * wanted) < 1e-7, "{found}");
        near(at(Parameter::TargetLeanX, corner), DVec3::new(-4.0, 0.0, 2.0));
        near(at(Parameter::TargetLeanY, corner), DVec3::new(0.0, -4.0, -3.0));
        near(at(Parameter::TargetTurn, corner), DVec3::new(3.0, 2.0, 0.0));
        near(at(Parameter::SkewX, corner), DVec3::new(4.0, 0.0, 0.0));
        near(at(Parameter::FocusOffset, corner), DVec3::new(0.0, 0.0, 1.0));
    }
}
