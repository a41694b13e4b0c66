//! The terms of a velocity field: one function of the place for each flow of a scene.

use super::kinds::{Axis, Case, Flow};
use crate::Refusal;
use crate::field::{Field, NO_DATA, VectorGrid};
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// Velocity at a place, mm in a unit of time.
pub(super) type Term = Box<dyn Fn(DVec3) -> DVec3 + Send + Sync>;

/// The velocity of a flow in a volume; `pixel_mm` is the side of a pixel at the focal plane.
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
            let (centre, wavenumber, a, b, c) = (DVec3::from(*centre_mm), TAU / wavelength_mm, *a, *b, *c);
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

/// Direction of a wave's velocity, and its cycles along each axis for omega = 1. The paper prints k = 2 pi / (omega L),
/// and sqrt(2) omega L for two axes, where L is sqrt(2) times longer; its text counts omega as cycles across the field.
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

/// A circular vortex filament with a softened kernel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ring {
    centre: DVec3,
    axis: DVec3,
    radius: f64,
    core: f64,
    displacement: f64,
    /// Cosines of the quadrature points on half the ring.
    cosines: Vec<f64>,
}

impl Ring {
    /// A ring whose velocity at the centre is `displacement` along `axis`.
    pub(super) fn new(centre: DVec3, axis: DVec3, radius: f64, core: f64, displacement: f64) -> Self {
        // The integrand is smooth over an angle of core / radius. With closer points, the midpoint rule converges
        // faster than any power of their number. This many give 1e-6 of the field at the core.
        let count = (9.0 * radius / core).ceil().max(16.0) as usize;
        let cosines = (0..count).map(|n| (std::f64::consts::PI * (n as f64 + 0.5) / count as f64).cos());
        Self { centre, axis: axis.normalize(), radius, core, displacement, cosines: cosines.collect() }
    }

    /// Velocity at a place: s along the axis and r from it, in radii of the ring; core e in radii. It is the mean over
    /// t from 0 to pi of (1 - r cos t) q along the axis and of s cos t q away from it, over its value (1 + e^2)^(-3/2)
    /// at the centre, where q = (r^2 + s^2 + 1 + e^2 - 2 r cos t)^(-3/2).
    pub(super) fn at(&self, place: DVec3) -> DVec3 {
        let offset = (place - self.centre) / self.radius;
        let s = offset.dot(self.axis);
        let away = offset - s * self.axis;
        let r = away.length();
        let e2 = (self.core / self.radius).powi(2);
        let distance = r * r + s * s + 1.0 + e2;
        let (mut along, mut outward) = (0.0, 0.0);
        for cos in &self.cosines {
            let d = distance - 2.0 * r * cos;
            let q = 1.0 / (d * d.sqrt());
            along += (1.0 - r * cos) * q;
            outward += s * cos * q;
        }
        let scale = self.displacement * (1.0 + e2).powf(1.5) / self.cosines.len() as f64;
        let direction = if r > 0.0 { away / r } else { DVec3::ZERO };
        scale * (along * self.axis + outward * direction)
    }
}

/// Displacements on a regular grid, trilinear between the vectors, constant beyond the outermost.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampled {
    layout: VectorGrid,
    vectors: Vec<DVec3>,
}

impl Sampled {
    /// The displacements of a field. Refuses vectors without data.
    pub fn new(field: &Field) -> Result<Self, Refusal> {
        let missing = field.flag.iter().filter(|flag| **flag == NO_DATA).count();
        let found = || format!("{missing} of {} vectors are without data", field.len());
        Refusal::unless(missing == 0, found, "wanted a field without gaps")?;
        Ok(Self { layout: field.layout.clone(), vectors: (0..field.len()).map(|i| field.displacement_mm(i)).collect() })
    }

    pub(super) fn at(&self, place: DVec3) -> DVec3 {
        let corners = self.layout.cell(place).corners();
        corners.iter().map(|(at, weight)| *weight * self.vectors[*at]).sum()
    }
}
