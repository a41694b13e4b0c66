//! Where a camera stands: from the frame that several cameras share to the camera's own.

use crate::Refusal;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid motion from the common frame to the camera's own: `place in the camera = rotation * place + translation`.
///
/// The camera's own frame is that of [`crate::optics`]: its origin lies on the axis in the focal plane, and Z points
/// towards the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// The rotation, row by row: each row is an axis of the camera's frame in the common one.
    pub rotation: [[f64; 3]; 3],
    /// The place of the common origin in the camera's frame, mm.
    pub translation_mm: [f64; 3],
}

/// Largest departure of the rows' products from those of a rotation: digits that a file may lack.
const MOST_OFF: f64 = 1e-6;

const WANTED: &str = "wanted the rows of a rotation, to seven digits";

impl Default for Pose {
    fn default() -> Self {
        Self { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation_mm: [0.0; 3] }
    }
}

impl Pose {
    /// The motion from the frame of one camera to that of another. A camera without a pose stands in the common frame.
    pub fn between(from: Option<&Self>, to: Option<&Self>) -> Self {
        let (from, to) = (from.copied().unwrap_or_default(), to.copied().unwrap_or_default());
        let turn = to.matrix() * from.matrix().transpose();
        let shift = DVec3::from(to.translation_mm) - turn * DVec3::from(from.translation_mm);
        let rows = turn.transpose();
        let rotation = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.to_array());
        Self { rotation, translation_mm: shift.to_array() }
    }

    /// The rotation as a matrix.
    pub fn matrix(&self) -> DMat3 {
        let [x, y, z] = self.rotation.map(DVec3::from);
        DMat3::from_cols(x, y, z).transpose()
    }

    /// A place of the common frame in the camera's, mm.
    #[inline]
    pub fn to_camera(&self, place_mm: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = place_mm;
        std::array::from_fn(|n| {
            let [a, b, c] = self.rotation[n];
            a * x + b * y + c * z + self.translation_mm[n]
        })
    }

    /// A place of the camera's frame in the common one, mm.
    pub fn to_common(&self, place_mm: [f64; 3]) -> [f64; 3] {
        let place = DVec3::from(place_mm) - DVec3::from(self.translation_mm);
        (self.matrix().transpose() * place).to_array()
    }

    /// Refuses numbers that are not finite, a matrix that is no rotation, and one that mirrors.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let is_finite = self.rotation.iter().flatten().chain(&self.translation_mm).all(|value| value.is_finite());
        Refusal::unless(is_finite, || "pose has a number that is not finite", WANTED)?;
        let turn = self.matrix();
        let off = (turn * turn.transpose() - DMat3::IDENTITY).to_cols_array();
        let most = off.iter().fold(0f64, |most, value| most.max(value.abs()));
        let found = || format!("pose.rotation has rows whose lengths or angles are off by {most:.1e}");
        Refusal::unless(most <= MOST_OFF, found, WANTED)?;
        Refusal::unless(turn.determinant() > 0.0, || "pose.rotation mirrors the frame", WANTED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Aperture, Camera, tests::seed};
    use crate::lattice::Layout;

    /// Turned by 0.6 rad about (1, 2, 2) / 3.
    fn tilted() -> Pose {
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.6).transpose();
        let rotation = [turn.x_axis, turn.y_axis, turn.z_axis].map(|row| row.to_array());
        Pose { rotation, translation_mm: [1.0, -2.0, 0.5] }
    }

    /// At 90 degrees about y: the camera stands on the side of x, sees z to the left and y upwards.
    const ASIDE: Pose =
        Pose { rotation: [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], translation_mm: [0.0; 3] };

    fn is_near(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|n| (a[n] - b[n]).abs() < 1e-12)
    }

    #[test]
    fn places_come_back_and_poses_chain() {
        let (place, pose) = ([0.3, -1.2, 2.5], tilted());
        assert!(is_near(pose.to_common(pose.to_camera(place)), place));
        assert_eq!(ASIDE.to_camera(place), [-2.5, -1.2, 0.3]);
        let between = Pose::between(Some(&ASIDE), Some(&pose));
        assert!(is_near(between.to_camera(ASIDE.to_camera(place)), pose.to_camera(place)));
        assert_eq!(Pose::between(None, Some(&ASIDE)), ASIDE);
        assert!(between.check().is_ok());
    }

    #[test]
    fn a_file_keeps_a_pose_and_one_without_keeps_its_bytes() {
        let mut camera = seed(20, Aperture::Square, Layout::Square, 0.0);
        assert!(!camera.to_json().contains("pose"));
        camera.pose = Some(tilted());
        let read = Camera::from_json(&camera.to_json()).unwrap();
        // The last digit may be another.
        let Some(Pose { rotation, translation_mm }) = read.pose else { panic!("no pose") };
        assert!(
            (0..3).all(|n| is_near(rotation[n], tilted().rotation[n])) && is_near(translation_mm, [1.0, -2.0, 0.5])
        );
        assert_eq!(Camera { pose: None, ..read }, Camera { pose: None, ..camera });
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let mut camera = seed(20, Aperture::Square, Layout::Square, 0.0);
        let mut stretched = ASIDE;
        stretched.rotation[1][1] = 1.001;
        let mut mirrored = ASIDE;
        mirrored.rotation[1][1] = -1.0;
        let mut far = ASIDE;
        far.translation_mm[0] = f64::INFINITY;
        for (pose, named) in [(stretched, "off by 2.0e-3"), (mirrored, "mirrors"), (far, "not finite")] {
            camera.pose = Some(pose);
            let refusal = camera.check().unwrap_err();
            assert!(refusal.found.contains(named), "{refusal}");
        }
    }
}
