//! Different numbers for the same lattice: the rotation and the offset that are nearest to the nominal ones.

use glam::DVec2;
use lf_core::Camera;
use lf_core::camera::{Layout, Microlenses};

/// The rotation nearest to `to_rad` that gives the same lattice: 90 degrees (square) or 60 degrees (hexagonal) are a
/// symmetry.
pub(crate) fn nearest_turn(rotation_rad: f64, to_rad: f64, layout: Layout) -> f64 {
    let turn = match layout {
        Layout::Square => std::f64::consts::FRAC_PI_2,
        Layout::Hexagonal => std::f64::consts::FRAC_PI_3,
    };
    rotation_rad + turn * ((to_rad - rotation_rad) / turn).round()
}

/// The offset nearest to `to_mm` that gives the same lattice. In `camera`, `offset_mm` is the centre of a lenslet and
/// no lenslet departs from the perfect lattice.
pub(crate) fn nearest_offset(camera: &Camera, to_mm: [f64; 2]) -> [f64; 2] {
    let Microlenses { layout, pitch_mm, rotation_rad, offset_mm, .. } = camera.microlenses;
    let (centre, to) = (DVec2::from(offset_mm), DVec2::from(to_mm));
    match layout {
        Layout::Square => {
            let turn = DVec2::from_angle(rotation_rad);
            let offset = centre - turn.rotate(DVec2::splat(0.5 * pitch_mm));
            let steps = (DVec2::new(turn.x, -turn.y).rotate(to - offset) / pitch_mm).round();
            (offset + turn.rotate(steps * pitch_mm)).to_array()
        }
        Layout::Hexagonal => {
            // Every centre of a hexagonal lattice is an origin of the same lattice.
            let lattice = camera.lattice();
            let (i, j) = lattice.lenslet_at(to);
            lattice.centre_mm(i, j).to_array()
        }
    }
}
