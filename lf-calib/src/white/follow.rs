//! Follows the lattice through a white image, from its period to every centre.
//!
//! The period gives the lattice vectors, and a patch of some lenslets gives the mean cell. From there the lattice is
//! followed outwards: read the lenslets within a radius against the cell, fit a smooth lattice to the centres, renew
//! the cell, enlarge the radius. On the whole frame the fits are repeated until the lattice rests. Then every lenslet
//! is read once. The cost is one pass over the pixels, plus work that does not grow with the image.

use super::followed::{FEWEST, FollowedLattice, few};
use super::{
    basis::layout_of, basis::shortest, cats_eye::RegionRim, cats_eye::TwoStops, cell_equations::CellEquations,
    cell_fit::thinned, lenslet_fit::LensletFit, period::Period, symmetry::centre_of,
};
use crate::fit::polynomial::{Polynomial, middle_px};
use glam::{DMat2, DVec2};
use lf_core::{Refusal, camera::Aperture, camera::Layout};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Half the side of the first patch, in lattice vectors. The period is still good to a twentieth of a pixel there.
const FIRST_PATCH: f64 = 12.0;
const GROWTH: f64 = 1.7;
/// The lattice rests when no lenslet moves by more than this, px.
const AT_REST_PX: f64 = 1e-4;
/// Repetitions of cell and lattice at most.
const REPETITIONS: u64 = 5;
/// Steps that [`crate::find_lattice`] reports, needed or not: to the corners, three times the repetitions, at the end.
pub const LATTICE_STEPS: u64 = 2 + 3 * REPETITIONS;
/// Lenslets that are read in each repetition, and on the way to the corners. The last reading is of all lenslets.
const SAMPLE: usize = 3000;
const ROUGH_SAMPLE: usize = SAMPLE / 4;

pub(crate) fn follow(image: ArrayView2<f32>, period: &Period, watch: &dyn Fn(u64)) -> Result<FollowedLattice, Refusal> {
    let mut followed = start(image, period).ok_or_else(|| few(0))?;
    to_corners(&mut followed, image)?;
    watch(1);
    settle(&mut followed, image, watch)?;
    Ok(followed)
}

/// Starts in the tile of the image where the largest share of lenslets can be read.
fn start(image: ArrayView2<f32>, period: &Period) -> Option<FollowedLattice> {
    let mut best: Option<(f64, FollowedLattice)> = None;
    for corner in &period.corners {
        let Some((share, followed)) = from_tile(image, period, *corner) else { continue };
        if best.as_ref().is_none_or(|best| share > best.0) {
            best = Some((share, followed));
        }
        if share > 0.9 {
            break;
        }
    }
    best.map(|best| best.1)
}

/// The lattice in a patch in the middle of a tile, and the share of its lenslets that can be read. None if too few can.
fn from_tile(image: ArrayView2<f32>, period: &Period, corner: [usize; 2]) -> Option<(f64, FollowedLattice)> {
    let basis = period.basis_px;
    let half = FIRST_PATCH * shortest(basis);
    let middle = [0, 1].map(|axis| corner[axis] as f64 + 0.5 * period.tile[axis] as f64);
    let range = |axis: usize| {
        let first = (middle[axis] - half).max(corner[axis] as f64) as usize;
        first..((middle[axis] + half) as usize).min(corner[axis] + period.tile[axis])
    };
    let (columns, rows) = (range(0), range(1));
    let pixels = || rows.clone().flat_map(|row| columns.clone().map(move |column| (column, row)));
    let sum: f64 = pixels().map(|(column, row)| image[(row, column)] as f64).sum();
    if sum <= 0.0 {
        return None;
    }
    let mean = sum / pixels().count() as f64;
    let to_cell = basis.inverse();
    let fit_cell = |origin: DVec2, is_symmetric: bool| {
        let mut equations = CellEquations::new(basis);
        for (column, row) in pixels() {
            let place = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
            equations.add(to_cell * (place - origin), image[(row, column)] as f64 / mean);
        }
        equations.solve(is_symmetric)
    };

    // A cell without symmetry shows where the lenslet images are; lenslets are read against the symmetric cell.
    let middle = DVec2::from(middle);
    let is_hexagonal = layout_of(basis).0 == Layout::Hexagonal;
    let origin = middle + basis * centre_of(&fit_cell(middle, false), basis, is_hexagonal);
    let mut followed = FollowedLattice {
        cell: fit_cell(origin, true),
        stop: Aperture::Circle,
        basis_px: basis,
        smooth: Polynomial::affine(origin, basis),
        gain: Polynomial::affine(DVec2::X, DMat2::ZERO),
        radius: FIRST_PATCH,
        is_whole: false,
        is_settled: false,
        stops: None,
        fits: Vec::new(),
    };
    let tried = followed.read(image, SAMPLE);
    (followed.fits.len() >= FEWEST).then(|| (followed.fits.len() as f64 / tried as f64, followed))
}

/// Follows the lattice from the first patch to the corners of the frame.
fn to_corners(followed: &mut FollowedLattice, image: ArrayView2<f32>) -> Result<(), Refusal> {
    let (height, width) = image.dim();
    let diagonal = (width as f64).hypot(height as f64) / shortest(followed.basis_px);
    loop {
        followed.fit(image)?;
        if followed.radius > diagonal {
            followed.is_whole = true;
            return Ok(());
        }
        followed.radius *= GROWTH;
        followed.read(image, ROUGH_SAMPLE);
    }
}

/// Repeats the fits on the whole frame until the lattice rests: with the round cell, then (if there is a second stop)
/// without the pixels that it has touched, then with the whole cell. Last it reads every lenslet.
fn settle(followed: &mut FollowedLattice, image: ArrayView2<f32>, watch: &dyn Fn(u64)) -> Result<(), Refusal> {
    rest(followed, image, watch)?;
    followed.stops = TwoStops::seen(&region_rims(followed, image));
    if followed.stops.is_some() {
        rest(followed, image, watch)?;
    } else {
        watch(REPETITIONS);
    }
    followed.is_settled = true;
    rest(followed, image, watch)?;
    followed.read(image, usize::MAX);
    followed.fit_smooth()?;
    watch(1);
    Ok(())
}

fn rest(followed: &mut FollowedLattice, image: ArrayView2<f32>, watch: &dyn Fn(u64)) -> Result<(), Refusal> {
    let indices: Vec<DVec2> = followed.fits.iter().map(|fit| fit.0).collect();
    for done in 1..=REPETITIONS {
        let before = followed.smooth.clone();
        followed.read(image, SAMPLE);
        followed.fit(image)?;
        let motion = |&index: &DVec2| followed.smooth.at(index).distance(before.at(index));
        let moved = indices.iter().map(motion).fold(0.0, f64::max);
        watch(1);
        if moved < AT_REST_PX {
            watch(REPETITIONS - done);
            break;
        }
    }
    Ok(())
}

/// Regions along each side of the frame.
const REGIONS: usize = 7;
/// Pixels that the mean cell of a region is fitted to, and fewest lenslets in a region.
const REGION_PIXELS: usize = 1 << 15;
const FEWEST_IN_REGION: usize = 3;

fn region_rims(followed: &FollowedLattice, image: ArrayView2<f32>) -> Vec<RegionRim> {
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
    let add = |equations: &mut CellEquations, offset, value| equations.add(to_cell * offset, value);
    let equations = followed.sum_over(image, &fits, || CellEquations::new(basis), add, CellEquations::merge);
    let middle = fits.iter().map(|(index, _)| followed.smooth.at(*index)).sum::<DVec2>() / fits.len() as f64;
    RegionRim::of(middle - middle_px(image.dim()), &equations.solve(false), basis)
}
