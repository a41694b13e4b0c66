//! The terms of a velocity field: one for each flow of a scene.

use super::kinds::{Axis, Case, Flow};
use super::ring::Ring;
use super::sampled::Sampled;
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// One of the velocity fields that add up. Lengths are mm, velocities mm in a unit of time.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Term {
    Uniform(DVec3),
    /// a cos(k . (r - centre) + phase): the real part of the paper's exponential about the middle of the volume.
    Wave {
        amplitude: DVec3,
        wavenumber: DVec3,
        centre: DVec3,
        phase: f64,
    },
    /// gradient (r - centre).
    Linear {
        gradient: DMat3,
        centre: DVec3,
    },
    Ring(Ring),
    Jet {
        centre: DVec3,
        axis: DVec3,
        radius: f64,
        shear_layer: f64,
        displacement: f64,
    },
    TaylorGreen {
        centre: DVec3,
        wavenumber: f64,
        amplitude: f64,
    },
    Abc {
        centre: DVec3,
        wavenumber: f64,
        amplitude: DVec3,
    },
    Sampled(Sampled),
}

impl Term {
    /// The field of a flow in a volume. `sampled` gives the fields of sampled flows in their order; `pixel_mm` is the
    /// side of a pixel at the focal plane.
    pub fn new(
        flow: &Flow,
        sampled: &mut impl Iterator<Item = Sampled>,
        bounds_mm: [[f64; 2]; 3],
        pixel_mm: f64,
    ) -> Self {
        match flow {
            Flow::Uniform { displacement_mm } => Self::Uniform(DVec3::from(*displacement_mm)),
            Flow::Wave { case, omega, amplitude_px, length_px, phase_rad } => {
                let extent_mm = bounds_mm.map(|[low, high]| length_px.map_or(high - low, |px| px * pixel_mm));
                let (direction, cycles) = wave(*case);
                Self::Wave {
                    amplitude: amplitude_px * pixel_mm * direction,
                    wavenumber: TAU * omega * cycles / DVec3::from(extent_mm),
                    centre: DVec3::from(bounds_mm.map(|[low, high]| 0.5 * (low + high))),
                    phase: *phase_rad,
                }
            }
            Flow::Rotation { centre_mm, axis, angle_rad } => {
                let spin = *angle_rad * DVec3::from(*axis).normalize();
                let gradient = DMat3::from_cols(spin.cross(DVec3::X), spin.cross(DVec3::Y), spin.cross(DVec3::Z));
                Self::Linear { gradient, centre: DVec3::from(*centre_mm) }
            }
            Flow::Shear { centre_mm, along, across, rate } => {
                let column = |axis: Axis| if axis == *across { *rate * along.unit() } else { DVec3::ZERO };
                let gradient = DMat3::from_cols(column(Axis::X), column(Axis::Y), column(Axis::Z));
                Self::Linear { gradient, centre: DVec3::from(*centre_mm) }
            }
            Flow::Ring { centre_mm, axis, radius_mm, core_mm, displacement_mm } => Self::Ring(Ring::new(
                DVec3::from(*centre_mm),
                DVec3::from(*axis),
                *radius_mm,
                *core_mm,
                *displacement_mm,
            )),
            Flow::Jet { centre_mm, axis, diameter_mm, shear_layer_mm, displacement_mm } => Self::Jet {
                centre: DVec3::from(*centre_mm),
                axis: DVec3::from(*axis).normalize(),
                radius: 0.5 * diameter_mm,
                shear_layer: *shear_layer_mm,
                displacement: *displacement_mm,
            },
            Flow::TaylorGreen { centre_mm, wavelength_mm, displacement_mm } => Self::TaylorGreen {
                centre: DVec3::from(*centre_mm),
                wavenumber: TAU / wavelength_mm,
                amplitude: *displacement_mm,
            },
            Flow::Abc { centre_mm, wavelength_mm, displacement_mm } => Self::Abc {
                centre: DVec3::from(*centre_mm),
                wavenumber: TAU / wavelength_mm,
                amplitude: DVec3::from(*displacement_mm),
            },
            Flow::Sampled { .. } => sampled.next().map_or(Self::Uniform(DVec3::ZERO), Self::Sampled),
            Flow::Tracks { .. } => Self::Uniform(DVec3::ZERO),
        }
    }

    /// Velocity at a place.
    pub fn at(&self, place: DVec3) -> DVec3 {
        match self {
            Self::Uniform(velocity) => *velocity,
            Self::Wave { amplitude, wavenumber, centre, phase } => {
                *amplitude * (wavenumber.dot(place - *centre) + phase).cos()
            }
            Self::Linear { gradient, centre } => *gradient * (place - *centre),
            Self::Ring(ring) => ring.at(place),
            Self::Jet { centre, axis, radius, shear_layer, displacement } => {
                let from_axis = (place - *centre).reject_from_normalized(*axis).length();
                0.5 * displacement * (1.0 + ((radius - from_axis) / (2.0 * shear_layer)).tanh()) * *axis
            }
            Self::TaylorGreen { centre, wavenumber, amplitude } => {
                let DVec3 { x, y, z } = *wavenumber * (place - *centre);
                *amplitude * z.cos() * DVec3::new(x.sin() * y.cos(), -x.cos() * y.sin(), 0.0)
            }
            Self::Abc { centre, wavenumber, amplitude } => {
                let DVec3 { x, y, z } = *wavenumber * (place - *centre);
                let DVec3 { x: a, y: b, z: c } = *amplitude;
                DVec3::new(a * z.sin() + c * y.cos(), b * x.sin() + a * z.cos(), c * y.sin() + b * x.cos())
            }
            Self::Sampled(field) => field.at(place),
        }
    }
}

/// Direction of a wave's velocity, and omega = 1 in cycles along each axis.
///
/// The paper prints k = 2 pi / (omega L), and sqrt(2) omega L for two axes, where L is sqrt(2) times longer. Its text
/// counts omega as cycles across the volume, so omega multiplies here.
fn wave(case: Case) -> (DVec3, DVec3) {
    let direction = match case {
        Case::A1 | Case::A2 | Case::A3 | Case::A4 => DVec3::X,
        Case::B1 | Case::B2 | Case::B3 | Case::B4 => DVec3::Z,
    };
    let cycles = match case {
        Case::A1 | Case::B1 => DVec3::X,
        Case::A2 | Case::B2 => DVec3::new(0.5, 0.5, 0.0),
        Case::A3 | Case::B3 => DVec3::new(0.5, 0.0, 0.5),
        Case::A4 | Case::B4 => DVec3::Z,
    };
    (direction, cycles)
}
