//! What a calibration may change: of the camera, and of where the target stands.

use crate::lens_centres::{Drift, keep_images};
use glam::{DMat3, DVec2, DVec3};
use lf_core::camera::{Camera, Distortion, Tilt};

/// One number of the camera or of the target's pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(usize)]
pub enum Parameter {
    /// Shift of the target along x.
    TargetX,
    /// Shift of the target along y.
    TargetY,
    /// Shift of the target along z: what the depths given leave to where the focal plane is.
    FocusOffset,
    /// Lean of the target: its z grows along its x.
    TargetLeanX,
    /// Lean of the target: its z grows along its y.
    TargetLeanY,
    /// Turn of the target from x to y.
    TargetTurn,
    /// Way along x that the traverse goes aside for each way along z.
    SkewX,
    /// Way along y that the traverse goes aside for each way along z.
    SkewY,
    /// Magnification.
    Magnification,
    /// Focal length of the main lens.
    FocalLength,
    /// Distance from the array to the sensor; with the image distance, k and the distance of the exit pupil.
    Gap,
    /// Shift of the lenslets' images along x.
    LatticeX,
    /// Shift of the lenslets' images along y.
    LatticeY,
    /// Turn of the lenslets' images about the sensor's middle.
    LatticeTurn,
    /// Tilt of the sensor against the array along x.
    TiltX,
    /// Tilt of the sensor against the array along y.
    TiltY,
    /// First radial coefficient.
    K1,
    /// Second radial coefficient.
    K2,
    /// Third radial coefficient.
    K3,
    /// First tangential coefficient.
    P1,
    /// Second tangential coefficient.
    P2,
    /// Index of the medium.
    Index,
    /// Place of the window.
    Window,
}

/// How many parameters there are.
pub const COUNT: usize = 23;

impl Parameter {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; COUNT] = [
        Self::TargetX,
        Self::TargetY,
        Self::FocusOffset,
        Self::TargetLeanX,
        Self::TargetLeanY,
        Self::TargetTurn,
        Self::SkewX,
        Self::SkewY,
        Self::Magnification,
        Self::FocalLength,
        Self::Gap,
        Self::LatticeX,
        Self::LatticeY,
        Self::LatticeTurn,
        Self::TiltX,
        Self::TiltY,
        Self::K1,
        Self::K2,
        Self::K3,
        Self::P1,
        Self::P2,
        Self::Index,
        Self::Window,
    ];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::TargetX => "target_x_mm",
            Self::TargetY => "target_y_mm",
            Self::FocusOffset => "focus_offset_mm",
            Self::TargetLeanX => "target_lean_x_rad",
            Self::TargetLeanY => "target_lean_y_rad",
            Self::TargetTurn => "target_turn_rad",
            Self::SkewX => "traverse_skew_x_rad",
            Self::SkewY => "traverse_skew_y_rad",
            Self::Magnification => "magnification",
            Self::FocalLength => "focal_length_mm",
            Self::Gap => "gap_mm",
            Self::LatticeX => "offset_x_mm",
            Self::LatticeY => "offset_y_mm",
            Self::LatticeTurn => "rotation_rad",
            Self::TiltX => "tilt_x_rad",
            Self::TiltY => "tilt_y_rad",
            Self::K1 => "k1",
            Self::K2 => "k2",
            Self::K3 => "k3",
            Self::P1 => "p1",
            Self::P2 => "p2",
            Self::Index => "index",
            Self::Window => "window_z_mm",
        }
    }

    /// A change that moves spots by a hundredth of a pixel to some pixels: what slopes are taken over.
    pub(crate) fn step(self, camera: &Camera) -> f64 {
        // Tangent of the chief ray at the corner of the frame: what distortion is a power of.
        let half = 0.5 * camera.sensor.pixel_pitch_mm * (camera.sensor.width as f64).hypot(camera.sensor.height as f64);
        let corner = half / camera.image_distance_mm();
        match self {
            Self::TargetX | Self::TargetY | Self::FocusOffset => 1e-3,
            Self::TargetLeanX | Self::TargetLeanY | Self::TargetTurn | Self::SkewX | Self::SkewY => 1e-4,
            Self::Magnification => 1e-4,
            Self::FocalLength => 1e-3 * camera.main_lens.focal_length_mm,
            Self::Gap => 1e-3 * camera.gap_mm(),
            Self::LatticeX | Self::LatticeY => 0.05 * camera.sensor.pixel_pitch_mm,
            Self::LatticeTurn => 1e-4,
            Self::TiltX | Self::TiltY => 1e-3,
            Self::K1 => 1e-4 / corner.powi(2),
            Self::K2 => 1e-4 / corner.powi(4),
            Self::K3 => 1e-4 / corner.powi(6),
            Self::P1 | Self::P2 => 1e-4 / corner,
            Self::Index => 1e-3,
            Self::Window => 1.0,
        }
    }

    fn number(self) -> usize {
        self as usize
    }
}

/// Changes of all parameters against the camera given and a target where it was said to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Changes([f64; COUNT]);

impl Changes {
    /// None.
    pub const NONE: Self = Self([0.0; COUNT]);

    pub fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter.number()]
    }

    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter.number()] = value;
    }

    /// One parameter moved.
    pub fn plus(&self, parameter: Parameter, step: f64) -> Self {
        let mut moved = *self;
        moved.0[parameter.number()] += step;
        moved
    }

    /// The camera with these changes. Blocks that would say nothing are left out.
    pub fn camera(&self, before: &Camera) -> Camera {
        use Parameter as P;
        let mut camera = before.clone();
        camera.main_lens.magnification += self.get(P::Magnification);
        camera.main_lens.focal_length_mm += self.get(P::FocalLength);
        if self.get(P::Gap) != 0.0 {
            camera.microlenses.gap_mm = Some(before.gap_mm() + self.get(P::Gap));
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

    /// Where the target's dots are.
    pub fn pose(&self) -> Pose {
        use Parameter as P;
        let turn = DVec3::new(self.get(P::TargetLeanY), -self.get(P::TargetLeanX), self.get(P::TargetTurn));
        Pose {
            turn: if turn == DVec3::ZERO {
                DMat3::IDENTITY
            } else {
                DMat3::from_axis_angle(turn.normalize(), turn.length())
            },
            skew: DVec2::new(self.get(P::SkewX), self.get(P::SkewY)),
            shift_mm: DVec3::new(self.get(P::TargetX), self.get(P::TargetY), self.get(P::FocusOffset)),
        }
    }

    /// Value of a parameter that a report gives: the camera's where it is the camera's.
    pub fn value(&self, parameter: Parameter, before: &Camera) -> f64 {
        use Parameter as P;
        let camera = self.camera(before);
        let distortion = camera.distortion.unwrap_or(Distortion { radial: [0.0; 3], tangential: [0.0; 2] });
        match parameter {
            P::Magnification => camera.main_lens.magnification,
            P::FocalLength => camera.main_lens.focal_length_mm,
            P::Gap => before.gap_mm() + self.get(P::Gap),
            P::LatticeX => camera.microlenses.offset_mm[0],
            P::LatticeY => camera.microlenses.offset_mm[1],
            P::LatticeTurn => camera.microlenses.rotation_rad,
            P::TiltX => camera.tilt.map_or(0.0, |tilt| tilt.x_rad),
            P::TiltY => camera.tilt.map_or(0.0, |tilt| tilt.y_rad),
            P::K1 | P::K2 | P::K3 => distortion.radial[parameter.number() - P::K1.number()],
            P::P1 | P::P2 => distortion.tangential[parameter.number() - P::P1.number()],
            P::Index => camera.medium.map_or(1.0, |medium| medium.index),
            P::Window => camera.medium.map_or(0.0, |medium| medium.window_z_mm),
            _ => self.get(parameter),
        }
    }
}

/// Where a target stands against the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    turn: DMat3,
    skew: DVec2,
    shift_mm: DVec3,
}

impl Pose {
    /// Place before the camera of a place on the target at its depth, mm.
    pub fn place_mm(&self, target_mm: DVec3) -> DVec3 {
        let aside = (self.skew * target_mm.z).extend(0.0);
        self.turn * (target_mm + aside) + self.shift_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sight::tests::seed;
    use lf_core::camera::Layout;

    #[test]
    fn parameters_know_their_numbers() {
        for (n, parameter) in Parameter::ALL.into_iter().enumerate() {
            assert_eq!(parameter.number(), n);
        }
    }

    #[test]
    fn no_change_is_the_same_camera_and_one_change_is_one_number() {
        let before = seed(40, Layout::Square);
        assert_eq!(Changes::NONE.camera(&before), before);
        let mut wanted = before.clone();
        wanted.distortion = Some(Distortion { radial: [0.0, 3.0, 0.0], tangential: [0.0; 2] });
        assert_eq!(Changes::NONE.plus(Parameter::K2, 3.0).camera(&before), wanted);
        for parameter in Parameter::ALL {
            let step = parameter.step(&before);
            let changed = Changes::NONE.plus(parameter, step);
            let grown = changed.value(parameter, &before) - Changes::NONE.value(parameter, &before);
            // Without a medium there is no index to change; an offset is the lenslet's, k nearer to the axis than its image.
            let wanted = if matches!(parameter, Parameter::Index | Parameter::Window) { 0.0 } else { step };
            assert!((grown - wanted).abs() < 1e-3 * step, "{parameter:?} {grown} {step}");
            changed.camera(&before).check().unwrap();
        }
    }

    #[test]
    fn a_target_leans_turns_and_goes_aside_by_hand() {
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
