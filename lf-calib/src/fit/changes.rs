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
        camera.main_lens.magnification += self.get(P::Magnification);
        camera.main_lens.focal_length_mm += self.get(P::FocalLength);
        if self.get(P::Gap) != 0.0 {
            camera.microlenses.gap_mm = Some(before.gap_mm() + self.get(P::Gap));
        }
        if self.get(P::Pupil) != 0.0 {
            camera.main_lens.pupil_distance_mm = Some(camera.pupil_distance_mm() + self.get(P::Pupil));
        }
        let [tilt_x, tilt_y] = [P::TiltX, P::TiltY].map(|p| self.get(p));
        if tilt_x != 0.0 || tilt_y != 0.0 {
            let tilt = camera.tilt.get_or_insert(Tilt { x_rad: 0.0, y_rad: 0.0 });
            tilt.x_rad += tilt_x;
            tilt.y_rad += tilt_y;
        }
        let radial = [P::K1, P::K2, P::K3].map(|p| self.get(p));
        let tangential = [P::P1, P::P2].map(|p| self.get(p));
        if radial.iter().chain(&tangential).any(|change| *change != 0.0) {
            let distortion = camera.distortion.get_or_insert(Distortion { radial: [0.0; 3], tangential: [0.0; 2] });
            distortion.radial.iter_mut().zip(radial).for_each(|(k, change)| *k += change);
            distortion.tangential.iter_mut().zip(tangential).for_each(|(p, change)| *p += change);
        }
        if let Some(medium) = &mut camera.medium {
            medium.index += self.get(P::Index);
            medium.window_z_mm += self.get(P::Window);
        }
        let drift = Drift {
            shift_mm: DVec2::new(self.get(P::LatticeX), self.get(P::LatticeY)),
            turn_rad: self.get(P::LatticeTurn),
        };
        keep_images(&mut camera, before, drift);
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
        use Parameter as P;
        let camera = self.camera(before);
        let pupil_mm = camera.pupil_distance_mm();
        let distortion = camera.distortion.unwrap_or(Distortion { radial: [0.0; 3], tangential: [0.0; 2] });
        match parameter {
            P::Magnification => camera.main_lens.magnification,
            P::FocalLength => camera.main_lens.focal_length_mm,
            P::Gap => before.gap_mm() + self.get(P::Gap),
            P::Pupil => pupil_mm,
            P::LatticeX => camera.microlenses.offset_mm[0],
            P::LatticeY => camera.microlenses.offset_mm[1],
            P::LatticeTurn => camera.microlenses.rotation_rad,
            P::TiltX => camera.tilt.map_or(0.0, |tilt| tilt.x_rad),
            P::TiltY => camera.tilt.map_or(0.0, |tilt| tilt.y_rad),
            P::K1 | P::K2 | P::K3 => distortion.radial[parameter as usize - P::K1 as usize],
            P::P1 | P::P2 => distortion.tangential[parameter as usize - P::P1 as usize],
            P::Index => camera.medium.map_or(1.0, |medium| medium.index),
            P::Window => camera.medium.map_or(0.0, |medium| medium.window_z_mm),
            _ => self.get(parameter),
        }
    }
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
