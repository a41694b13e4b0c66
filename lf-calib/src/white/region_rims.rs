//! The rims of lenslet images in regions of the frame: they show a second stop.

use crate::white::lenslet_fit::{LensletFit, window};
use crate::{
    fit::plane::middle_px, white::basis::shortest, white::cats_eye::RegionRim, white::cell_equations::CellEquations,
    white::cell_fit::thinned, white::followed::FollowedLattice,
};
use glam::DVec2;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Regions along each side of the frame.
const REGIONS: usize = 7;
/// Pixels that the mean cell of a region is fitted to, and fewest lenslets in a region.
const REGION_PIXELS: usize = 1 << 15;
const FEWEST_IN_REGION: usize = 3;

/// The rim of the mean cell of each region of the frame.
pub(crate) fn region_rims(followed: &FollowedLattice, image: ArrayView2<f32>) -> Vec<RegionRim> {
    let (height, width) = image.dim();
    let mut regions = vec![Vec::new(); REGIONS * REGIONS];
    for (index, fit) in &followed.fits {
        let region = |place: f64, size: usize| ((place / size as f64 * REGIONS as f64) as usize).min(REGIONS - 1);
        regions[region(fit.centre_px.y, height) * REGIONS + region(fit.centre_px.x, width)].push((*index, *fit));
    }
    regions.par_iter().filter_map(|fits| region_rim(followed, image, fits)).collect()
}

/// The rim of the mean cell of some lenslets. None if there are too few, or if the cell shows too little of a rim.
fn region_rim(followed: &FollowedLattice, image: ArrayView2<f32>, fits: &[(DVec2, LensletFit)]) -> Option<RegionRim> {
    let basis = followed.basis_px;
    let to_cell = basis.inverse();
    let fits = thinned(fits, basis, REGION_PIXELS);
    if fits.len() < FEWEST_IN_REGION {
        return None;
    }
    let mut equations = CellEquations::new(basis);
    let mut middle = DVec2::ZERO;
    for (index, fit) in &fits {
        let centre = followed.smooth.at(*index);
        middle += (centre - middle_px(image.dim())) / fits.len() as f64;
        for (pixel, offset) in window(centre, shortest(basis), image.dim()).into_iter().flatten() {
            equations.add(to_cell * offset, fit.level(image[pixel] as f64, offset));
        }
    }
    RegionRim::of(middle, &equations.solve(false), basis)
}
