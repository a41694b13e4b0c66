//! From the lattice of lenslet images to the microlenses of a camera.
//!
//! A lenslet with centre c, mm from the sensor's middle, is imaged around c (1 + k): what leaves the middle of the stop
//! meets the array at c and the sensor k c farther out. k is the nominal camera's, for a white image alone cannot tell
//! a small k from a small pitch.

use crate::lattice::ImageLattice;
use glam::DVec2;
use lf_core::camera::{Aperture, Camera, Layout, Microlenses};
use serde_json::json;

/// The nominal camera with its microlenses replaced by measured ones, and what was measured under `calibration`.
///
/// Of the offsets that describe the same lattice it takes the one nearest to the nominal offset, of the rotations (the
/// same after 90 or 60 degrees) the one nearest to the nominal rotation. The nominal layout and pitch are not used.
pub fn calibrate(lattice: &ImageLattice, nominal: &Camera) -> Camera {
    let k = nominal.demagnification();
    let lens_mm_per_image_px = nominal.sensor.pixel_pitch_mm / (1.0 + k);
    let middle_px = 0.5 * DVec2::new(nominal.sensor.width as f64, nominal.sensor.height as f64);
    let centre_mm = (DVec2::from(lattice.origin_px) - middle_px) * lens_mm_per_image_px;
    let mut camera = nominal.clone();
    camera.microlenses = Microlenses {
        layout: lattice.layout,
        pitch_mm: lattice.pitch_px * lens_mm_per_image_px,
        focal_length_mm: nominal.microlenses.focal_length_mm,
        rotation_rad: nearest_turn(lattice.rotation_rad, nominal.microlenses.rotation_rad, lattice.layout),
        offset_mm: centre_mm.to_array(),
        gap_mm: nominal.microlenses.gap_mm,
    };
    camera.microlenses.offset_mm = nearest_offset(&camera, nominal.microlenses.offset_mm);
    let measured = json!({
        "layout": lattice.layout,
        "image_pitch_px": lattice.pitch_px,
        "image_basis_px": lattice.basis_px,
        "affine_departure_px": lattice.affine_departure_px,
        "residual_rms_px": lattice.residual_rms_px,
        "lenslets": lattice.kept(),
        "lenslets_rejected": lattice.centres.len() - lattice.kept(),
        "lenslets_in_frame": lattice.in_frame,
        "contrast": lattice.contrast,
        "nominal_demagnification": k,
        "standard_uncertainty": {
            "pitch_mm": lattice.pitch_uncertainty_px * lens_mm_per_image_px,
            "rotation_rad": lattice.rotation_uncertainty_rad,
            "offset_mm": lattice.origin_uncertainty_px * lens_mm_per_image_px,
        },
    });
    let calibration = camera.calibration.get_or_insert_with(|| json!({}));
    if !calibration.is_object() {
        *calibration = json!({});
    }
    calibration["lattice"] = measured;
    camera
}

/// Width of the stop's image over the distance between rows of lenslets, by a camera's own lens and lattice: above 1,
/// lenslet images overlap and a place between lenslets can be as symmetric as a lenslet.
pub fn overlap(camera: &Camera) -> f64 {
    let distance = match camera.main_lens.aperture {
        Aperture::Circle => camera.microlenses.pitch_mm,
        Aperture::Square => camera.lattice().row_pitch_mm(),
    };
    camera.demagnification() * camera.aperture_mm() / distance
}

/// The same rotation nearest to another.
fn nearest_turn(rotation_rad: f64, to_rad: f64, layout: Layout) -> f64 {
    let turn = match layout {
        Layout::Square => std::f64::consts::FRAC_PI_2,
        Layout::Hexagonal => std::f64::consts::FRAC_PI_3,
    };
    rotation_rad + turn * ((to_rad - rotation_rad) / turn).round()
}

/// The offset nearest to another that describes the lattice of a camera whose `offset_mm` is the centre of a lenslet.
fn nearest_offset(camera: &Camera, to_mm: [f64; 2]) -> [f64; 2] {
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
