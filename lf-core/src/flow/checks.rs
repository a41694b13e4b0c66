//! Which numbers of a flow are refused.

use super::kinds::Flow;
use crate::Refusal;
use glam::DVec3;

/// Largest number of a flow, in its unit.
const MOST: f64 = 1e9;

impl Flow {
    pub(super) fn check(&self) -> Result<(), Refusal> {
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
                Refusal::unless(along != across, || "flow.along and flow.across are the same axis", "wanted two axes")?;
                finite(centre_mm).and(finite(&[*rate]))
            }
            Self::Ring { centre_mm, axis, radius_mm, core_mm, displacement_mm } => {
                finite(centre_mm)?;
                finite(&[*displacement_mm])?;
                direction(axis)?;
                length("radius_mm", *radius_mm)?;
                length("core_mm", *core_mm)?;
                let wanted = format!("wanted at least a hundredth of flow.radius_mm {radius_mm}");
                Refusal::unless(*core_mm >= 0.01 * radius_mm, || format!("flow.core_mm is {core_mm}"), wanted)
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
