//! The flows of a scene, their keys, and which numbers are refused.

use crate::Refusal;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Largest number of a flow, in its unit.
const MOST: f64 = 1e9;

/// A steady flow. Displacements are per unit of time, the interval between frames. Axes need not have unit length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Flow {
    /// A uniform displacement.
    Uniform {
        /// Displacement along x, y, z, mm.
        displacement_mm: [f64; 3],
    },
    /// Cases A1 to A4 (u) and B1 to B4 (w) of Shi, Ding, New & Soria (2017), section 4.
    Wave {
        /// `A1` ... `A4`, `B1` ... `B4`.
        case: Case,
        /// Cycles of the velocity across the volume; 0.25 is a quarter of a cycle.
        omega: f64,
        /// Largest displacement, px at the focal plane.
        amplitude_px: f64,
        /// Length that holds omega cycles along every axis, px at the focal plane; the volume's extents if absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        length_px: Option<f64>,
        /// Phase in the middle of the volume, rad; 0, a crest, if absent.
        #[serde(default, skip_serializing_if = "crate::json::is_zero")]
        phase_rad: f64,
    },
    /// Solid-body rotation.
    Rotation {
        /// A point of the axis, mm; the origin if absent.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Direction of the axis; the rotation is right-handed about it.
        axis: [f64; 3],
        /// Angle in a unit of time, rad.
        angle_rad: f64,
    },
    /// Simple shear.
    Shear {
        /// A point at rest, mm; the origin if absent.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Axis of the displacement.
        along: Axis,
        /// Axis along which the displacement grows.
        across: Axis,
        /// Displacement per distance, mm per mm.
        rate: f64,
    },
    /// A vortex ring at rest, with the softened kernel 1 / (r^2 + core^2)^(3/2) of Rosenhead (1930) and Moore (1972).
    Ring {
        /// Centre of the ring, mm; the origin if absent.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Direction of the flow through the ring.
        axis: [f64; 3],
        /// Radius of the ring, mm.
        radius_mm: f64,
        /// Radius of the vortex core, mm; at least a hundredth of the ring's radius.
        core_mm: f64,
        /// Displacement at the centre, mm.
        displacement_mm: f64,
    },
    /// A round jet: `displacement / 2 (1 + tanh((diameter / 2 - r) / (2 shear_layer)))` at distance r from the axis.
    Jet {
        /// A point of the axis, mm; the origin if absent.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Direction of the axis and of the flow.
        axis: [f64; 3],
        /// Diameter at half the displacement, mm.
        diameter_mm: f64,
        /// Momentum thickness of the shear layer, mm.
        shear_layer_mm: f64,
        /// Displacement inside the jet, mm.
        displacement_mm: f64,
    },
    /// Taylor & Green (1937): u = A sin x cos y cos z, v = -A cos x sin y cos z, w = 0; lengths in wavelength / (2 pi).
    TaylorGreen {
        /// A point at which u and v are 0 and their gradients largest, mm; the origin if absent.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Wavelength, mm.
        wavelength_mm: f64,
        /// A, mm.
        displacement_mm: f64,
    },
    /// Arnold-Beltrami-Childress: u = A sin z + C cos y, v = B sin x + A cos z, w = C sin y + B cos x, with lengths in
    /// wavelength / (2 pi).
    Abc {
        /// Origin of the phases, mm; the frame's origin if absent.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Wavelength, mm.
        wavelength_mm: f64,
        /// A, B, C, mm.
        displacement_mm: [f64; 3],
    },
    /// Displacements from a file, trilinear between the vectors, constant beyond the outermost.
    Sampled {
        /// A [field](crate::field) in EXR without gaps; the path is relative to the scene's folder.
        path: PathBuf,
    },
    /// Particles whose places are given in every frame; it cannot be added to other flows.
    Tracks {
        /// A [`particles.csv`](crate::particles) of all frames; the path is relative to the scene's folder.
        path: PathBuf,
    },
}

/// An oscillating field of Shi, Ding, New & Soria (2017), section 4: A fields oscillate in u, B fields in w.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Case {
    A1,
    A2,
    A3,
    A4,
    B1,
    B2,
    B3,
    B4,
}

/// A coordinate axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    pub(super) fn unit(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }
}

impl Flow {
    /// Refuses numbers that cannot be used.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let checks = match self {
            Self::Uniform { displacement_mm } => vec![finite(displacement_mm)],
            Self::Wave { omega, amplitude_px, length_px, phase_rad, .. } => {
                let length = length_px.map_or(Ok(()), |px| length("length_px", px));
                vec![finite(&[*omega, *amplitude_px, *phase_rad]), length]
            }
            Self::Rotation { centre_mm, axis, angle_rad } => {
                vec![finite(centre_mm), finite(&[*angle_rad]), direction(axis)]
            }
            Self::Shear { centre_mm, rate, along, across } => {
                let found = || "flow.along and flow.across are the same axis";
                vec![Refusal::unless(along != across, found, "wanted two axes"), finite(centre_mm), finite(&[*rate])]
            }
            Self::Ring { centre_mm, axis, radius_mm, core_mm, displacement_mm } => {
                let wanted = format!("wanted at least a hundredth of flow.radius_mm {radius_mm}");
                let found = || format!("flow.core_mm is {core_mm}");
                let core =
                    length("core_mm", *core_mm).and(Refusal::unless(*core_mm >= 0.01 * radius_mm, found, wanted));
                let radius = length("radius_mm", *radius_mm);
                vec![finite(centre_mm), finite(&[*displacement_mm]), direction(axis), radius, core]
            }
            Self::Jet { centre_mm, axis, diameter_mm, shear_layer_mm, displacement_mm } => {
                let lengths = length("diameter_mm", *diameter_mm).and(length("shear_layer_mm", *shear_layer_mm));
                vec![finite(centre_mm), finite(&[*displacement_mm]), direction(axis), lengths]
            }
            Self::TaylorGreen { centre_mm, wavelength_mm, displacement_mm } => {
                vec![finite(centre_mm), finite(&[*displacement_mm]), length("wavelength_mm", *wavelength_mm)]
            }
            Self::Abc { centre_mm, wavelength_mm, displacement_mm } => {
                vec![finite(centre_mm), finite(displacement_mm), length("wavelength_mm", *wavelength_mm)]
            }
            Self::Sampled { .. } | Self::Tracks { .. } => Vec::new(),
        };
        checks.into_iter().collect()
    }

    pub(super) fn sampled(&self) -> Option<&Path> {
        if let Self::Sampled { path } = self { Some(path) } else { None }
    }
}

fn finite(numbers: &[f64]) -> Result<(), Refusal> {
    let wrong = numbers.iter().find(|number| !number.is_finite() || number.abs() > MOST);
    let refusal = |number| Refusal::new(format!("flow has the number {number}"), "wanted finite numbers up to 1e9");
    wrong.map_or(Ok(()), |number| Err(refusal(number)))
}

fn length(key: &str, length: f64) -> Result<(), Refusal> {
    let is_length = length.is_finite() && length > 0.0;
    Refusal::unless(is_length, || format!("flow.{key} is {length}"), "wanted a positive length")
}

fn direction(axis: &[f64; 3]) -> Result<(), Refusal> {
    let is_direction = (1e-9..MOST).contains(&DVec3::from(*axis).length());
    let wanted = "wanted a direction of a length within 1e-9 to 1e9";
    Refusal::unless(is_direction, || format!("flow.axis is {axis:?}"), wanted)
}
