//! Pressure from the acceleration of the fluid.
//!
//! Equation: `grad p = -density * a` without friction, with the acceleration of a particle of fluid
//! `a = du/dt + (u . grad) u`. The pressure is the one whose differences between neighbours are nearest to the mean of
//! their gradients (least squares; its normal equations are a Poisson equation with `a` at the walls). It is known up
//! to a constant: its mean is 0.

use super::forces::{Forces, PressureOptions};
use super::measured::check_shape;
use super::spread::{in_batches, rms};
use super::ties::Ties;
use lf_core::field::Array;
use lf_core::{Field, Refusal};

/// Constant: residual at which the solver stops, for the pressure and for drawn errors.
const TOLERANCE: f64 = 1e-7;
const TOLERANCE_OF_ERRORS: f64 = 1e-3;
/// Constant: number of sets of errors drawn for the uncertainty.
const DRAWS: u64 = 16;

/// Pressure at every vector.
#[derive(Debug, Clone)]
pub struct Pressure {
    /// Pressure and its standard uncertainty, Pa. Pressure is NaN where no acceleration ties a vector to a neighbour;
    /// all uncertainties are NaN if a component states none.
    pub arrays: Vec<Array>,
    /// RMS pressure, and RMS of its uncertainty, Pa.
    pub rms_pa: [f64; 2],
    /// RMS of the part of the gradient that no pressure can have, over the RMS of the gradient.
    pub misfit: f64,
    /// Vectors with a pressure.
    pub places: usize,
    /// Number of parts of the field without a tie between them. The mean of each is 0.
    pub parts: usize,
    /// Residual of the solver over its right side, if it stopped before its goal.
    pub unsolved: Option<f64>,
}

/// The pressure of a steady flow from one field, or in the middle between two. Refuses a second field with vectors at
/// other places, fewer than two vectors along an axis, and a field without a vector that has slopes along every axis.
pub fn pressure(first: &Field, second: Option<&Field>, options: &PressureOptions) -> Result<Pressure, Refusal> {
    if let Some(second) = second {
        let (a, b) = (&first.layout, &second.layout);
        let is_same = a.shape == b.shape && a.spacing_mm == b.spacing_mm && a.origin_mm == b.origin_mm;
        Refusal::unless(is_same, || "vectors at other places", "wanted those of the first field")?;
    }
    check_shape(&first.layout)?;
    let forces = Forces::new(first, second, options);
    let force = forces.at(&[]);
    let ties = Ties::new(&first.layout, |i| forces.has_data(i), &force);
    let wanted = "wanted vectors with data beside each other; lf-flow solenoidal or smooth fill gaps";
    Refusal::unless(ties.parts > 0, || "no vector with neighbours along x, y and z", wanted)?;
    let found = ties.fit(&force, TOLERANCE);
    let sigma = uncertainty(&forces, &ties, &found.values);
    let stored = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<f32>>();
    Ok(Pressure {
        arrays: vec![
            Array::scalars("pressure_pa", &stored(&found.values)),
            Array::scalars("s_pressure_pa", &stored(&sigma)),
        ],
        rms_pa: [&found.values, &sigma].map(|values| rms(values.iter().copied())),
        misfit: found.misfit,
        places: ties.count(),
        parts: ties.parts,
        unsolved: found.unsolved,
    })
}

/// Standard uncertainties of `values` by errors that are drawn at random; NaN if the fields state none.
fn uncertainty(forces: &Forces, ties: &Ties, values: &[f64]) -> Vec<f64> {
    if !forces.states_uncertainties() {
        return vec![f64::NAN; values.len()];
    }
    let drawn = |n: u64| ties.fit(&forces.at(&forces.draw(n)), TOLERANCE_OF_ERRORS).values;
    let mut squares = vec![0.0; values.len()];
    in_batches(DRAWS, drawn, |drawn| {
        squares.iter_mut().zip(drawn.iter().zip(values)).for_each(|(sum, (a, b))| *sum += (a - b).powi(2));
    });
    squares.into_iter().map(|sum| (sum / DRAWS as f64).sqrt()).collect()
}
