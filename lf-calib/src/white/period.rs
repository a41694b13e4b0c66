//! A first estimate of the lattice: the two shortest shifts that map a white image onto itself. They are peaks of the
//! autocorrelation, for lenslet images of any shape. A spectrum would not do: discs that touch in a hexagonal lattice
//! have almost no power at its fundamental.

use super::{autocorrelation::Autocorrelation, basis::reduced};
use glam::{DMat2, DVec2};
use lf_core::Refusal;
use ndarray::ArrayView2;

/// Longest side of a tile of the image that is correlated, px. It holds seven lenslets of 150 px.
const TILE_PX: usize = 1024;
/// A peak of at least this share of the highest one is a lattice vector. The peaks of lattice vectors differ only by
/// noise; between touching hexagonal discs the points at a third of the long diagonal reach 0.3.
const LATTICE_PEAK: f64 = 0.8;
/// Smallest contrast of the periodic part of the image, root mean square over mean. Discs that touch have 0.33 to 0.53.
/// The dark lines between the images of a matched square aperture, 0.01 px wide at a pitch of 14 px, have 0.004.
const LEAST_CONTRAST: f64 = 0.02;

const WANTED: &str = "a white image with dark gaps between the discs of the lenslets";

pub(crate) struct Period {
    /// The lattice vectors as columns, px; see [`reduced`].
    pub basis_px: DMat2,
    pub contrast: f64,
    /// First column and row of each tile, then columns and rows of a tile.
    pub corners: Vec<[usize; 2]>,
    pub tile: [usize; 2],
}

/// Finds the period of an image of counts. The cost is that of five tiles at most, for any size of the image.
pub(crate) fn find(image: ArrayView2<f32>) -> Result<Period, Refusal> {
    let refused = |found: String| Err(Refusal::new(found, format!("wanted {WANTED}")));
    let (height, width) = image.dim();
    let tile = [width.min(TILE_PX), height.min(TILE_PX)];
    let corners = corners([width, height], tile);
    let Some((correlation, deviation)) = Autocorrelation::of(image, &corners, tile) else {
        let value = image.iter().next().copied().unwrap_or(0.0);
        return refused(format!("flat, {value} everywhere"));
    };
    let peaks = correlation.peaks();
    let highest = peaks.iter().map(|peak| peak.1).fold(0.0, f64::max);
    let contrast = highest.sqrt() * deviation;
    if contrast < LEAST_CONTRAST {
        return Err(Refusal::new(
            format!("no lattice: the periodic part has a contrast of {:.2} %", 100.0 * contrast),
            format!("wanted {WANTED} (at least {} %)", 100.0 * LEAST_CONTRAST),
        ));
    }
    let mut high: Vec<DVec2> = peaks.iter().filter(|peak| peak.1 > LATTICE_PEAK * highest).map(|peak| peak.0).collect();
    high.sort_by(|a, b| a.length().total_cmp(&b.length()).then(a.x.total_cmp(&b.x)));
    let first = high[0];
    let second = high.iter().find(|w| (first.perp_dot(**w) / (first.length() * w.length())).abs() > 0.4);
    let Some(&second) = second else {
        return refused(format!("repeats every {:.1} px in one direction only", first.length()));
    };
    let basis = reduced(DMat2::from_cols(first, second));
    Ok(Period { basis_px: correlation.refined(basis, highest), contrast, corners, tile })
}

/// The first column and row of a tile in the middle and in each quarter of the image, without repetitions.
fn corners(size: [usize; 2], tile: [usize; 2]) -> Vec<[usize; 2]> {
    let mut corners = Vec::new();
    for quarters in [[2, 2], [1, 1], [3, 1], [1, 3], [3, 3]] {
        let corner = [0, 1].map(|axis| (size[axis] - tile[axis]) * quarters[axis] / 4);
        if !corners.contains(&corner) {
            corners.push(corner);
        }
    }
    corners
}
