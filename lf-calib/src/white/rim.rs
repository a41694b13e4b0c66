//! The rim of lenslet images: where the light falls to half of the plateau.

use super::{basis::shortest, mean_cell::MeanCell};
use glam::{DMat2, DVec2};

/// The rim is where the light is `HALF` of the plateau, the mean around `PLATEAU` of the radius. Beyond it the light
/// must fall to `DARK` of the plateau: between discs that touch it does not, and then there is no rim.
const HALF: f64 = 0.5;
const PLATEAU: f64 = 0.6;
const DARK: f64 = 0.35;
/// Distance between the samples along a ray, and the length of a ray, in shortest lattice vectors.
const STEP: f64 = 0.01;
const FARTHEST: f64 = 0.75;

/// Distances, px, from the cell's origin to the rim in the directions `angles`. None if the light does not fall enough.
pub(crate) fn rim_px(cell: &MeanCell, basis_px: DMat2, angles: impl Iterator<Item = f64>) -> Vec<Option<f64>> {
    let shortest = shortest(basis_px);
    let to_cell = basis_px.inverse();
    let level = |place: DVec2| cell.at(to_cell * place).0;
    let steps = (FARTHEST / STEP) as usize;
    let rays: Vec<Vec<f64>> = angles
        .map(|angle| (0..=steps).map(|n| level(DVec2::from_angle(angle) * (n as f64 * STEP * shortest))).collect())
        .collect();
    // A disc that can be measured covers at least a quarter of the pitch.
    let inner: Vec<f64> = rays.iter().flat_map(|ray| ray[..(0.25 / STEP) as usize].to_vec()).collect();
    let rough = inner.iter().sum::<f64>() / inner.len() as f64;
    let dark = rays.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    rays.iter().map(|ray| Some(fall(ray, dark, rough)? * STEP * shortest)).collect()
}

/// Where a profile first falls through half of its plateau, in steps. None if it does not fall far enough beyond.
fn fall(profile: &[f64], dark: f64, rough: f64) -> Option<f64> {
    let through = |level: f64| {
        let n = profile.windows(2).position(|pair| pair[0] >= level && pair[1] < level)?;
        Some(n as f64 + (profile[n] - level) / (profile[n] - profile[n + 1]))
    };
    let first = through(dark + HALF * (rough - dark))?;
    let plateau = &profile[((PLATEAU - 0.2) * first) as usize..((PLATEAU + 0.2) * first) as usize + 1];
    let plateau = plateau.iter().sum::<f64>() / plateau.len() as f64;
    let rim = through(dark + HALF * (plateau - dark))?;
    let after = profile[rim as usize..].iter().copied().fold(f64::INFINITY, f64::min);
    (after - dark < DARK * (plateau - dark)).then_some(rim)
}
