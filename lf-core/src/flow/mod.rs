//! Flows: what a scene asks for, and the velocity fields that come of it.

mod ring;
mod sampled;
mod velocity;

pub use sampled::Sampled;
pub use velocity::{Velocity, places};

use crate::field::Field;
use crate::{Error, Refusal, io};
use glam::{DMat3, DVec3};
use ring::Ring;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::{Path, PathBuf};
use velocity::Part;

/// A flow that turns a particle round in less of a frame than this many steps follow is a slip of units.
pub const MOST_STEPS: f64 = 1e5;

/// A steady flow. Displacements are those of a unit of time, the interval between two frames; axes need not have unit
/// length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Flow {
    /// The same displacement everywhere.
    Uniform {
        /// Displacement along x, y, z, mm.
        displacement_mm: [f64; 3],
    },
    /// Cases A1 to A4 (u) and B1 to B4 (w) of Shi, Ding, New & Soria (2017), section 4.
    Wave {
        /// `A1` ... `A4`, `B1` ... `B4`.
        case: Case,
        /// Cycles of the velocity across the volume: a quarter is 0.25.
        omega: f64,
        /// Greatest displacement, px at the focal plane.
        amplitude_px: f64,
        /// Length over which omega counts along every axis, px at the focal plane, so that a small volume can show a part of a
        /// large one's wave; absent, the volume's extents.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        length_px: Option<f64>,
        /// Phase in the middle of the volume, rad; 0 is a crest.
        #[serde(default, skip_serializing_if = "is_zero")]
        phase_rad: f64,
    },
    /// Solid rotation.
    Rotation {
        /// A point of the axis, mm.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Its direction; the turn is right-handed about it.
        axis: [f64; 3],
        /// Turn in a unit of time, rad.
        angle_rad: f64,
    },
    /// Simple shear.
    Shear {
        /// A point at rest, mm.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Axis along which it moves.
        along: Axis,
        /// Axis along which the displacement grows.
        across: Axis,
        /// Displacement over the distance across.
        rate: f64,
    },
    /// A vortex ring at rest: the field of a thin circular vortex with the softened kernel of Rosenhead (1930) and Moore
    /// (1972), 1 / (r^2 + core^2)^(3/2).
    Ring {
        /// Its middle, mm.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Direction of the flow through it.
        axis: [f64; 3],
        /// Radius, mm.
        radius_mm: f64,
        /// Radius of the vortex core, mm; at least a hundredth of the ring's.
        core_mm: f64,
        /// Displacement in its middle, mm.
        displacement_mm: f64,
    },
    /// A parallel round jet: `displacement / 2 (1 + tanh((diameter / 2 - r) / (2 shear_layer)))` along the axis, r from it.
    Jet {
        /// A point of the axis, mm.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Its direction.
        axis: [f64; 3],
        /// Diameter between the places of half the displacement, mm.
        diameter_mm: f64,
        /// Momentum thickness of its shear layer, mm.
        shear_layer_mm: f64,
        /// Displacement within, mm.
        displacement_mm: f64,
    },
    /// Taylor & Green (1937): u = A sin x cos y cos z, v = -A cos x sin y cos z, w = 0, lengths in wavelengths over 2 pi.
    TaylorGreen {
        /// Where u and v are 0 and their gradients greatest, mm.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Wavelength, mm.
        wavelength_mm: f64,
        /// A, mm.
        displacement_mm: f64,
    },
    /// Arnold-Beltrami-Childress: u = A sin z + C cos y, v = B sin x + A cos z, w = C sin y + B cos x, lengths in
    /// wavelengths over 2 pi.
    Abc {
        /// The origin of the phases, mm.
        #[serde(default)]
        centre_mm: [f64; 3],
        /// Wavelength, mm.
        wavelength_mm: f64,
        /// A, B, C, mm.
        displacement_mm: [f64; 3],
    },
    /// A vector field of displacements in mm, between its vectors trilinear, beyond its edge as at the edge.
    Sampled {
        /// EXR as `lf-xcorr` and `lf-synth` write it, path from the scene's folder.
        path: PathBuf,
    },
    /// Particles whose places in every frame are given; no other flow beside it.
    Tracks {
        /// A `particles.csv` of all frames, path from the scene's folder.
        path: PathBuf,
    },
}

/// One of the paper's eight oscillating fields.
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
    fn unit(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

impl Flow {
    /// Checks what the types do not.
    fn check(&self) -> Result<(), Refusal> {
        match self {
            Self::Uniform { displacement_mm } => finite(displacement_mm),
            Self::Wave { omega, amplitude_px, length_px, phase_rad, .. } => {
                finite(&[*omega, *amplitude_px, *phase_rad])?;
                length_px.map_or(Ok(()), |px| length("length_px", px))
            }
            Self::Rotation { centre_mm, axis, angle_rad } => {
                finite(centre_mm)?;
                finite(&[*angle_rad])?;
                direction(axis)
            }
            Self::Shear { centre_mm, rate, along, across } => {
                if along == across {
                    return Err(Refusal::new("flow.along and flow.across are the same axis", "wanted two axes"));
                }
                finite(centre_mm)?;
                finite(&[*rate])
            }
            Self::Ring { centre_mm, axis, radius_mm, core_mm, displacement_mm } => {
                finite(centre_mm)?;
                finite(&[*displacement_mm])?;
                direction(axis)?;
                length("radius_mm", *radius_mm)?;
                length("core_mm", *core_mm)?;
                if *core_mm < 0.01 * radius_mm {
                    let wanted = format!("wanted at least a hundredth of flow.radius_mm {radius_mm}");
                    return Err(Refusal::new(format!("flow.core_mm is {core_mm}"), wanted));
                }
                Ok(())
            }
            Self::Jet { centre_mm, axis, diameter_mm, shear_layer_mm, displacement_mm } => {
                finite(centre_mm)?;
                finite(&[*displacement_mm])?;
                direction(axis)?;
                length("diameter_mm", *diameter_mm)?;
                length("shear_layer_mm", *shear_layer_mm)
            }
            Self::TaylorGreen { centre_mm, wavelength_mm, displacement_mm } => {
                finite(centre_mm)?;
                finite(&[*displacement_mm])?;
                length("wavelength_mm", *wavelength_mm)
            }
            Self::Abc { centre_mm, wavelength_mm, displacement_mm } => {
                finite(centre_mm)?;
                finite(displacement_mm)?;
                length("wavelength_mm", *wavelength_mm)
            }
            Self::Sampled { .. } | Self::Tracks { .. } => Ok(()),
        }
    }

    fn path_mut(&mut self) -> Option<&mut PathBuf> {
        match self {
            Self::Sampled { path } | Self::Tracks { path } => Some(path),
            _ => None,
        }
    }

    /// The field in a volume.
    fn part(&self, sampled: &mut impl Iterator<Item = Sampled>, bounds_mm: [[f64; 2]; 3], pixel_mm: f64) -> Part {
        match self {
            Self::Uniform { displacement_mm } => Part::Uniform(DVec3::from(*displacement_mm)),
            Self::Wave { case, omega, amplitude_px, length_px, phase_rad } => {
                let whole = DVec3::from(bounds_mm.map(|[low, high]| high - low));
                let extent = length_px.map_or(whole, |px| DVec3::splat(px * pixel_mm));
                let centre = DVec3::from(bounds_mm.map(|[low, high]| 0.5 * (low + high)));
                let along_x = matches!(case, Case::A1 | Case::A2 | Case::A3 | Case::A4);
                // Printed: k = 2 pi / (omega L), and sqrt(2) omega L over two axes with L sqrt(2) times longer. The text
                // has omega count cycles across the volume, so omega stands above: departures in scripts/paper/README.md.
                let cycles = match case {
                    Case::A1 | Case::B1 => DVec3::X,
                    Case::A2 | Case::B2 => DVec3::new(0.5, 0.5, 0.0),
                    Case::A3 | Case::B3 => DVec3::new(0.5, 0.0, 0.5),
                    Case::A4 | Case::B4 => DVec3::Z,
                };
                Part::Wave {
                    amplitude: amplitude_px * pixel_mm * if along_x { DVec3::X } else { DVec3::Z },
                    wavenumber: std::f64::consts::TAU * omega * cycles / extent,
                    centre,
                    phase: *phase_rad,
                }
            }
            Self::Rotation { centre_mm, axis, angle_rad } => {
                let spin = *angle_rad * DVec3::from(*axis).normalize();
                let gradient = DMat3::from_cols(spin.cross(DVec3::X), spin.cross(DVec3::Y), spin.cross(DVec3::Z));
                Part::Linear { gradient, centre: DVec3::from(*centre_mm) }
            }
            Self::Shear { centre_mm, along, across, rate } => {
                let column = |axis: Axis| if axis == *across { *rate * along.unit() } else { DVec3::ZERO };
                let gradient = DMat3::from_cols(column(Axis::X), column(Axis::Y), column(Axis::Z));
                Part::Linear { gradient, centre: DVec3::from(*centre_mm) }
            }
            Self::Ring { centre_mm, axis, radius_mm, core_mm, displacement_mm } => Part::Ring(Ring::new(
                DVec3::from(*centre_mm),
                DVec3::from(*axis),
                *radius_mm,
                *core_mm,
                *displacement_mm,
            )),
            Self::Jet { centre_mm, axis, diameter_mm, shear_layer_mm, displacement_mm } => Part::Jet {
                centre: DVec3::from(*centre_mm),
                axis: DVec3::from(*axis).normalize(),
                radius: 0.5 * diameter_mm,
                shear_layer: *shear_layer_mm,
                displacement: *displacement_mm,
            },
            Self::TaylorGreen { centre_mm, wavelength_mm, displacement_mm } => Part::TaylorGreen {
                centre: DVec3::from(*centre_mm),
                wavenumber: std::f64::consts::TAU / wavelength_mm,
                amplitude: *displacement_mm,
            },
            Self::Abc { centre_mm, wavelength_mm, displacement_mm } => Part::Abc {
                centre: DVec3::from(*centre_mm),
                wavenumber: std::f64::consts::TAU / wavelength_mm,
                amplitude: DVec3::from(*displacement_mm),
            },
            Self::Sampled { .. } => sampled.next().map_or(Part::Uniform(DVec3::ZERO), Part::Sampled),
            Self::Tracks { .. } => Part::Uniform(DVec3::ZERO),
        }
    }
}

fn finite(numbers: &[f64]) -> Result<(), Refusal> {
    match numbers.iter().find(|number| !number.is_finite() || number.abs() > 1e9) {
        Some(number) => Err(Refusal::new(format!("flow has the number {number}"), "wanted numbers within 1e9")),
        None => Ok(()),
    }
}

fn length(key: &str, length: f64) -> Result<(), Refusal> {
    if length.is_finite() && length > 0.0 {
        Ok(())
    } else {
        Err(Refusal::new(format!("flow.{key} is {length}"), "wanted a positive length"))
    }
}

fn direction(axis: &[f64; 3]) -> Result<(), Refusal> {
    let size = DVec3::from(*axis).length();
    if (1e-9..1e9).contains(&size) {
        Ok(())
    } else {
        Err(Refusal::new(format!("flow.axis is {axis:?}"), "wanted a direction of a length within 1e-9 to 1e9"))
    }
}

/// One flow, or several whose velocities add up; in a scene an object or a list of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Flows {
    /// One.
    One(Flow),
    /// Several.
    Sum(Vec<Flow>),
}

impl<'de> Deserialize<'de> for Flows {
    // By hand, for serde's own choice between the two would lose what is wrong with either.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let flows = if value.is_array() {
            serde_json::from_value(value).map(Self::Sum)
        } else {
            serde_json::from_value(value).map(Self::One)
        };
        flows.map_err(|error| D::Error::custom(format!("flow: {error}")))
    }
}

impl Flows {
    fn all(&self) -> &[Flow] {
        match self {
            Self::One(flow) => std::slice::from_ref(flow),
            Self::Sum(flows) => flows,
        }
    }

    /// Takes paths from a folder.
    pub fn join(&mut self, folder: &Path) {
        let flows = match self {
            Self::One(flow) => std::slice::from_mut(flow),
            Self::Sum(flows) => flows,
        };
        for path in flows.iter_mut().filter_map(Flow::path_mut) {
            *path = folder.join(&*path);
        }
    }

    /// Files of its sampled fields, in their order.
    pub fn sampled(&self) -> Vec<&Path> {
        let mut paths = Vec::new();
        for flow in self.all() {
            if let Flow::Sampled { path } = flow {
                paths.push(path.as_path());
            }
        }
        paths
    }

    /// The tracks, where it is of tracks.
    pub fn tracks(&self) -> Option<&Path> {
        match self.all() {
            [Flow::Tracks { path }] => Some(path),
            _ => None,
        }
    }

    /// Checks what the types do not.
    ///
    /// # Errors
    /// Names the key.
    pub fn check(&self) -> Result<(), Refusal> {
        let flows = self.all();
        if flows.len() > 1 && flows.iter().any(|flow| matches!(flow, Flow::Tracks { .. })) {
            return Err(Refusal::new("flow has kind 'tracks' beside other flows", "wanted it alone"));
        }
        flows.iter().try_for_each(Flow::check)
    }

    /// The velocity field in a volume, with its sampled fields read; `scene` is what messages call the scene, `pixel_mm` a
    /// pixel at the focal plane.
    ///
    /// # Errors
    /// Those of [`Field::open`], a sampled field with gaps, and a flow of more than [`MOST_STEPS`].
    pub fn open(&self, bounds_mm: [[f64; 2]; 3], pixel_mm: f64, scene: &str) -> crate::Result<Velocity> {
        let open = |path: &Path| Sampled::new(&Field::open(path)?).map_err(|refusal| refusal.about(io::name(path)));
        let sampled: crate::Result<Vec<Sampled>> = self.sampled().into_iter().map(open).collect();
        let velocity = self.velocity(sampled?, bounds_mm, pixel_mm);
        if velocity.steps() > MOST_STEPS {
            let found = format!("flow needs {:.1e} steps from frame to frame", velocity.steps());
            return Err(Error::new(scene, found, format!("wanted at most {MOST_STEPS:.0e}: a gentler one")));
        }
        Ok(velocity)
    }

    /// The velocity field in a volume; `sampled` are the fields of its files, `pixel_mm` is a pixel at the focal plane.
    pub fn velocity(&self, sampled: Vec<Sampled>, bounds_mm: [[f64; 2]; 3], pixel_mm: f64) -> Velocity {
        let mut sampled = sampled.into_iter();
        Velocity::new(self.all().iter().map(|flow| flow.part(&mut sampled, bounds_mm, pixel_mm)).collect(), bounds_mm)
    }
}

#[cfg(test)]
mod tests;
