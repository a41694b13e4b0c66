//! The parameters that a calibration can change.

use lf_core::Camera;

/// Largest change of a length that a careful data sheet needs: three standard deviations.
pub(crate) const LARGEST_CHANGE: f64 = 0.08;
/// Standard deviation of the distance of an exit pupil, which data sheets hardly give, as a share of it.
const PUPIL_STD: f64 = 0.3;

macro_rules! parameters {
    ($($variant:ident $name:literal,)*) => {
        /// A number of the camera or of the target's pose. `Lattice` ones move the images; turns are from x to y.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(crate) enum Parameter { $($variant,)* }

        impl Parameter {
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// Its name in reports, which ends in its unit.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }
        }
    };
}

parameters! {
    TargetX "target_x_mm",
    TargetY "target_y_mm",
    // From the given depths to depths from the focal plane.
    FocusOffset "focus_offset_mm",
    // Its z grows along its x, or its y.
    TargetLeanX "target_lean_x_rad",
    TargetLeanY "target_lean_y_rad",
    TargetTurn "target_turn_rad",
    // Motion of the traverse along x, or y, for each unit of motion along z.
    SkewX "traverse_skew_x_rad",
    SkewY "traverse_skew_y_rad",
    Magnification "magnification",
    FocalLength "focal_length_mm",
    // Distance from the array to the sensor. With the distance of the exit pupil it gives k.
    Gap "gap_mm",
    // Distance from the exit pupil to the array. Where images of lenslets are known, it gives where the lenslets are.
    Pupil "pupil_distance_mm",
    // 1 over that distance, in its place for far pupils and telecentric lenses.
    Vergence "pupil_vergence_per_mm",
    LatticeX "offset_x_mm",
    LatticeY "offset_y_mm",
    LatticeTurn "rotation_rad",
    TiltX "tilt_x_rad",
    TiltY "tilt_y_rad",
    K1 "k1",
    K2 "k2",
    K3 "k3",
    P1 "p1",
    P2 "p2",
    Spherical "spherical_px",
    SecondarySpherical "secondary_spherical_px",
    Coma "coma_px",
    ComaGrowth "coma_px_per_mm",
    Astigmatism "astigmatism_px",
    FieldCurvature "field_curvature_px",
    Index "index",
    Window "window_z_mm",
}

impl Parameter {
    /// Its unit in reports.
    pub fn unit(self) -> &'static str {
        match self.name() {
            name if name.ends_with("_px_per_mm") => "px/mm",
            name if name.ends_with("_per_mm") => "1/mm",
            name if name.ends_with("_mm") => "mm",
            name if name.ends_with("_rad") => "rad",
            name if name.ends_with("_px") => "px",
            _ => "1",
        }
    }

    /// Standard deviation of what a careful data sheet says. None if none says it.
    pub fn sheet_std(self, camera: &Camera) -> Option<f64> {
        match self {
            Self::FocalLength => Some(LARGEST_CHANGE / 3.0 * camera.main_lens.focal_length_mm),
            Self::Gap => Some(LARGEST_CHANGE / 3.0 * camera.gap_mm()),
            Self::Pupil => Some(PUPIL_STD * camera.pupil_distance_mm()),
            Self::Vergence => Some(PUPIL_STD / camera.image_distance_mm()),
            _ => None,
        }
    }

    /// Step of the numerical derivatives: it moves sub-images by a hundredth of a pixel to a few pixels.
    pub fn step(self, camera: &Camera) -> f64 {
        // Distortion is a power of the tangent of the chief ray; this is the tangent at the frame's corner.
        let half = 0.5 * camera.sensor.pixel_pitch_mm * (camera.sensor.width as f64).hypot(camera.sensor.height as f64);
        let corner = half / camera.image_distance_mm();
        match self {
            Self::TargetX | Self::TargetY | Self::FocusOffset => 1e-3,
            Self::TargetLeanX | Self::TargetLeanY | Self::TargetTurn | Self::SkewX | Self::SkewY => 1e-4,
            Self::Magnification => 1e-4,
            Self::FocalLength => 1e-3 * camera.main_lens.focal_length_mm,
            Self::Gap => 1e-3 * camera.gap_mm(),
            Self::Pupil => 1e-2 * camera.pupil_distance_mm(),
            Self::Vergence => 1e-2 / camera.image_distance_mm(),
            Self::LatticeX | Self::LatticeY => 0.05 * camera.sensor.pixel_pitch_mm,
            Self::LatticeTurn => 1e-4,
            Self::TiltX | Self::TiltY => 1e-3,
            Self::K1 => 1e-4 / corner.powi(2),
            Self::K2 => 1e-4 / corner.powi(4),
            Self::K3 => 1e-4 / corner.powi(6),
            Self::P1 | Self::P2 => 1e-4 / corner,
            Self::Spherical | Self::SecondarySpherical | Self::Coma | Self::Astigmatism | Self::FieldCurvature => 0.3,
            Self::ComaGrowth => 0.1,
            Self::Index => 1e-3,
            Self::Window => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_know_their_numbers_and_units() {
        for (n, parameter) in Parameter::ALL.iter().enumerate() {
            assert_eq!(*parameter as usize, n);
        }
        let units = [Parameter::Gap, Parameter::TiltX, Parameter::Coma, Parameter::Magnification].map(Parameter::unit);
        assert_eq!(units, ["mm", "rad", "px", "1"]);
    }
}
