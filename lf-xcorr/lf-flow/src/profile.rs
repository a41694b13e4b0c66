//! A field along a line, and its flux through a plane.

use super::errors::Correlated;
use super::measured::stated_mm;
use glam::DVec3;
use lf_core::field::{Cut, NO_DATA};
use lf_core::{Field, Refusal};
use serde::Serialize;

/// Values at one place of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Distance from the line's start, mm.
    pub distance_mm: f64,
    /// The place, mm.
    pub place_mm: DVec3,
    /// Displacement, mm; NaN outside the field and beside vectors without data.
    pub displacement_mm: DVec3,
    /// Its standard uncertainty, mm; NaN also beside vectors that state none.
    pub uncertainty_mm: DVec3,
}

/// The field at `points` places from `from` to `to`, both included: trilinear between the vectors. Neighbours share
/// their errors, so the uncertainty is interpolated like the vectors.
pub fn profile(field: &Field, from: DVec3, to: DVec3, points: usize) -> Vec<Profile> {
    let at = |n: usize| {
        let share = if points > 1 { n as f64 / (points - 1) as f64 } else { 0.0 };
        let place_mm = from + share * (to - from);
        let found = field.interpolate(place_mm);
        Profile {
            distance_mm: share * (to - from).length(),
            place_mm,
            displacement_mm: found.map_or(DVec3::NAN, |found| found.displacement_mm),
            uncertainty_mm: found.map_or(DVec3::NAN, |found| found.uncertainty_mm),
        }
    };
    (0..points).map(at).collect()
}

/// Flux through a plane of vectors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Flux {
    /// Place of the plane on its axis, mm.
    pub place_mm: f64,
    /// Area of the vectors with data, mm^2.
    pub area_mm2: f64,
    /// Share of the vectors with data.
    pub share: f64,
    /// Mean displacement through the plane, mm.
    pub mean_mm: f64,
    /// Volume through the plane, mm^3 between the two volumes.
    pub flux_mm3: f64,
    /// Its standard uncertainty, mm^3; None if no vector states one. A vector that states none counts with the usual
    /// one.
    pub s_flux_mm3: Option<f64>,
    /// Volume a second, mm^3/s; None if the time between the volumes is unknown.
    pub flux_mm3_s: Option<f64>,
    /// Its standard uncertainty, mm^3/s.
    pub s_flux_mm3_s: Option<f64>,
}

/// The flux through the layer of vectors nearest to a plane. Refuses a plane outside the field.
pub fn flux(field: &Field, cut: Cut) -> Result<Flux, Refusal> {
    let layout = &field.layout;
    let layer = cut.layer(layout)?;
    let stride: usize = layout.shape[..cut.axis].iter().product();
    let in_layer = |i: &usize| i / stride % layout.shape[cut.axis] == layer;
    let all: Vec<usize> = (0..field.len()).filter(in_layer).collect();
    let known: Vec<usize> = all.iter().copied().filter(|i| field.flag[*i] != NO_DATA).collect();
    let across: Vec<usize> = (0..3).filter(|axis| *axis != cut.axis).collect();
    let cell_mm2: f64 = across.iter().map(|axis| layout.spacing_mm[*axis]).product();
    let sum: f64 = known.iter().map(|i| field.displacement_mm(*i)[cut.axis]).sum();
    // Windows share their errors: the correlations of a vector with all others add up to the windows' width.
    let errors = Correlated::new(layout);
    let together: f64 = across.iter().map(|axis| errors.width[*axis] as f64).product();
    let sum_of_squares = |sigma: Vec<f64>| known.iter().map(|i| sigma[*i].powi(2)).sum::<f64>();
    let squares = stated_mm(field, cut.axis).map(sum_of_squares);
    let (flux_mm3, s_flux_mm3) = (cell_mm2 * sum, squares.map(|squares| cell_mm2 * (together * squares).sqrt()));
    Ok(Flux {
        place_mm: layout.origin_mm[cut.axis] + layer as f64 * layout.spacing_mm[cut.axis],
        area_mm2: cell_mm2 * known.len() as f64,
        share: known.len() as f64 / all.len() as f64,
        mean_mm: sum / known.len() as f64,
        flux_mm3,
        s_flux_mm3,
        flux_mm3_s: layout.dt_s.map(|dt_s| flux_mm3 / dt_s),
        s_flux_mm3_s: layout.dt_s.and_then(|dt_s| Some(s_flux_mm3? / dt_s)),
    })
}
