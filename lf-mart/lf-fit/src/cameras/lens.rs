//! The parameters of a camera that the images of particles determine, beside its drift and its blur.
//!
//! Magnification and focal lengths scale places and depths, which no particle shows. A lenslet's focal length that is
//! too long looks as an f-number that is too small, because depths follow. Field curvature moves depths too, and of
//! astigmatism only a little is left when depths follow: dots find them (`lf-calib volume`).

use lf_core::Camera;
use lf_core::camera::Aberrations;

/// Number of these parameters.
pub(crate) const LENSES: usize = 5;

/// A parameter of a camera.
pub(crate) struct Lens {
    /// Its name in messages, and in statistics.
    pub(crate) name: &'static str,
    pub(crate) key: &'static str,
    /// Its unit in messages.
    pub(crate) unit: &'static str,
    /// The step, in that unit, that moves light by a pixel at the rim of a lenslet image, or at the edge of the sensor.
    per_px: fn(&Camera) -> f64,
    /// Takes a step in that unit.
    change: fn(&mut Camera, f64),
}

/// Half of the longer side of the sensor, pixels.
fn edge_px(camera: &Camera) -> f64 {
    0.5 * camera.sensor.width.max(camera.sensor.height) as f64
}

fn aberrations(camera: &mut Camera) -> &mut Aberrations {
    camera.aberrations.get_or_insert_default()
}

/// The parameters.
pub(crate) const PARAMETERS: [Lens; LENSES] = [
    Lens {
        name: "f-number (or 1 / focal_length_mm of the lenslets)",
        key: "f_number_percent",
        unit: "%",
        per_px: |camera| 100.0 / (0.5 * camera.pitch_px()),
        change: |camera, by| camera.main_lens.working_f_number *= 1.0 + 0.01 * by,
    },
    Lens {
        name: "pitch of the lenslets",
        key: "pitch_percent",
        unit: "%",
        per_px: |camera| 100.0 / edge_px(camera),
        change: |camera, by| camera.microlenses.pitch_mm *= 1.0 + 0.01 * by,
    },
    Lens {
        name: "rotation of the lenslets",
        key: "rotation_mrad",
        unit: "mrad",
        per_px: |camera| 1000.0 / edge_px(camera),
        change: |camera, by| camera.microlenses.rotation_rad += 1e-3 * by,
    },
    Lens {
        name: "spherical aberration of the main lens",
        key: "spherical_px",
        unit: "px",
        per_px: |_| 1.0,
        change: |camera, by| aberrations(camera).spherical_px += by,
    },
    Lens {
        name: "coma of the main lens",
        key: "coma_px",
        unit: "px",
        per_px: |_| 1.0,
        change: |camera, by| aberrations(camera).coma_px += by,
    },
];

/// A camera after steps in pixels.
pub(crate) fn stepped(camera: &mut Camera, steps_px: [f64; LENSES]) {
    let given = camera.clone();
    for (lens, px) in PARAMETERS.iter().zip(steps_px).filter(|(_, px)| *px != 0.0) {
        (lens.change)(camera, px * (lens.per_px)(&given));
    }
}

/// A correction of a camera's parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// Its name in messages.
    pub name: &'static str,
    /// Its name in statistics, with its unit.
    pub key: &'static str,
    /// Its unit in messages.
    pub unit: &'static str,
    /// How far the parameter was too small, in that unit.
    pub step: f64,
    /// Its standard uncertainty, in that unit.
    pub std: f64,
}

/// The parameters that were corrected.
pub(crate) fn corrections(camera: &Camera, steps_px: [f64; LENSES], std_px: &[f64]) -> Vec<Correction> {
    let of = |(k, Lens { name, key, unit, per_px, .. }): (usize, &Lens)| {
        let scale = per_px(camera);
        Correction { name, key, unit, step: steps_px[k] * scale, std: std_px[k] * scale }
    };
    PARAMETERS.iter().enumerate().map(of).filter(|correction| correction.step != 0.0).collect()
}
