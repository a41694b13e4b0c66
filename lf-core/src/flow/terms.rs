//! The terms of a velocity field: one function of the place for each flow of a scene.

use super::kinds::{Axis, Case, Flow};
use super::{ring::Ring, sampled::Sampled};
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// Velocity at a place, mm in a unit of time.
pub(super) type Term = Box<dyn Fn(DVec3) -> DVec3 + Send + Sync>;

/// The velocity of a flow in a volume. `sampled` gives the fields of sampled flows in their order; `pixel_mm` is the
/// side of a pixel at the focal plane.
pub(super) fn term(
    flow: &Flow,
    sampled: &mut impl Iterator<Item = Sampled>,
    bounds_mm: [[f64; 2]; 3],
    pixel_mm: f64,
) -> Term {
    match flow {
        Flow::Uniform { displacement_mm } => uniform(DVec3::from(*displacement_mm)),
        Flow::Wave { case, omega, amplitude_px, length_px, phase_rad } => {
            let extent_mm = bounds_mm.map(|[low, high]| length_px.map_or(high - low, |px| px * pixel_mm));
            let (direction, cycles) = wave(*case);
            let (amplitude, phase) = (amplitude_px * pixel_mm * direction, *phase_rad);
            let wavenumber = TAU * omega * cycles / DVec3::from(extent_mm);
            let centre = DVec3::from(bounds_mm.map(|[low, high]| 0.5 * (low + high)));
            // The real part of the paper's exponential about the middle of the volume.
            Box::new(move |place| amplitude * (wavenumber.dot(place - centre) + phase).cos())
        }
        Flow::Rotation { centre_mm, axis, angle_rad } => {
            let spin = *angle_rad * DVec3::from(*axis).normalize();
            linear(DMat3::from_cols(spin.cross(DVec3::X), spin.cross(DVec3::Y), spin.cross(DVec3::Z)), *centre_mm)
        }
        Flow::Shear { centre_mm, along, across, rate } => {
            let column = |axis: Axis| if axis == *across { *rate * along.unit() } else { DVec3::ZERO };
            linear(DMat3::from_cols(column(Axis::X), column(Axis::Y), column(Axis::Z)), *centre_mm)
        }
        Flow::Ring { centre_mm, axis, radius_mm, core_mm, displacement_mm } => {
            let (centre, axis) = (DVec3::from(*centre_mm), DVec3::from(*axis));
            let ring = Ring::new(centre, axis, *radius_mm, *core_mm, *displacement_mm);
            Box::new(move |place| ring.at(place))
        }
        Flow::Jet { centre_mm, axis, diameter_mm, shear_layer_mm, displacement_mm } => {
            let (centre, axis) = (DVec3::from(*centre_mm), DVec3::from(*axis).normalize());
            let (radius, shear_layer, displacement) = (0.5 * diameter_mm, *shear_layer_mm, *displacement_mm);
            Box::new(move |place| {
                let from_axis = (place - centre).reject_from_normalized(axis).length();
                0.5 * displacement * (1.0 + ((radius - from_axis) / (2.0 * shear_layer)).tanh()) * axis
            })
        }
        Flow::TaylorGreen { centre_mm, wavelength_mm, displacement_mm } => {
            let (centre, wavenumber, a) = (DVec3::from(*centre_mm), TAU / wavelength_mm, *displacement_mm);
            Box::new(move |place| {
                let DVec3 { x, y, z } = wavenumber * (place - centre);
                a * z.cos() * DVec3::new(x.sin() * y.cos(), -x.cos() * y.sin(), 0.0)
            })
        }
        Flow::Abc { centre_mm, wavelength_mm, displacement_mm: [a, b, c] } => {
            let (centre, wavenumber) = (DVec3::from(*centre_mm), TAU / wavelength_mm);
            let [a, b, c] = [*a, *b, *c];
            Box::new(move |place| {
                let DVec3 { x, y, z } = wavenumber * (place - centre);
                DVec3::new(a * z.sin() + c * y.cos(), b * x.sin() + a * z.cos(), c * y.sin() + b * x.cos())
            })
        }
        Flow::Sampled { .. } => match sampled.next() {
            Some(field) => Box::new(move |place| field.at(place)),
            None => uniform(DVec3::ZERO),
        },
        Flow::Tracks { .. } => uniform(DVec3::ZERO),
    }
}

fn uniform(velocity: DVec3) -> Term {
    Box::new(move |_| velocity)
}

fn linear(gradient: DMat3, centre_mm: [f64; 3]) -> Term {
    Box::new(move |place| gradient * (place - DVec3::from(centre_mm)))
}

/// Direction of a wave's velocity, and its cycles along each axis for omega = 1.
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
