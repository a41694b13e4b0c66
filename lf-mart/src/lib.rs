//! Image, camera and voxels to intensities, by multiplicative algebraic reconstruction.
//!
//! Two methods. `mart` is the row action of Shi, Ding, New & Soria (2017), eq. 1: pixel after pixel, weights stored.
//! `subsets` is the default: simultaneous MART (SMART) over interleaved image rows, one subset of rows after another,
//! weights made from profiles where they are used and never stored as a matrix.

pub mod blob;
mod inline;
mod kernel;
#[cfg(target_arch = "x86_64")]
mod kernel_avx;
mod operator;
mod row_action;
mod scattered;
mod subsets;
mod tables;

use lf_core::camera::Camera;
use lf_core::footprint::{Basis, Footprint, Model};
use lf_core::grid::Grid;
use ndarray::ArrayView2;

/// How intensities are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Ordered subsets of SMART: the default.
    Subsets,
    /// The paper's row action.
    Mart,
}

/// What is done and how often.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The weights.
    pub weights: Model,
    /// What a voxel stands for.
    pub basis: Basis,
    /// The method.
    pub method: Method,
    /// Sweeps over all pixels.
    pub iterations: usize,
    /// Relaxation: the factor mu of the exponent.
    pub relaxation: f64,
    /// Refuse to store more weights than fit into so many bytes (`Method::Mart` alone stores any).
    pub max_bytes: u64,
}

/// A reconstruction.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// Rising linear indices of the lit voxels.
    pub indices: Vec<u64>,
    /// Intensity of each, counts: what the voxel sends through the aperture.
    pub intensity: Vec<f32>,
    /// `|image - projection| / |image|` over the pixels the support can reach, before each sweep.
    pub misfit: Vec<f64>,
    /// Support voxels that no pixel sees; they are left out.
    pub unseen: usize,
}

/// A dark pixel counts as this share of the image's brightest: the logarithm stays finite, and one dark pixel among
/// hundreds cannot put out a voxel at once.
const DARK: f32 = 1e-4;

/// Voxels of the result below this share of its brightest are not written.
const LEAST_SHARE: f32 = 1e-4;

/// Solves for the intensities of the voxels `indices` (rising) of `grid`. `done` is told how many sweeps are finished.
///
/// # Errors
/// Where the grid is too deep for the camera, an index lies outside it, or the weights do not fit.
pub fn reconstruct(
    image: ArrayView2<f32>,
    camera: &Camera,
    grid: &Grid,
    indices: &[u64],
    options: &Options,
    done: impl Fn(u64),
) -> Result<Reconstruction, String> {
    if indices.last().is_some_and(|last| *last >= grid.len()) || u32::try_from(indices.len()).is_err() {
        return Err(format!("{} voxels, or one outside the grid", indices.len()));
    }
    let footprint = Footprint::new(camera, grid, options.weights, options.basis)?;
    let solved = match options.method {
        Method::Subsets => subsets::solve(image, &footprint, indices, options, done),
        Method::Mart => row_action::solve(image, &footprint, indices, options, done)?,
    };
    let (indices, intensity) = match options.basis {
        Basis::Blob { sigma_vox } => blob::spread(grid, &solved.indices, &solved.strengths, sigma_vox, LEAST_SHARE),
        Basis::Point | Basis::Box => blob::lit(&solved.indices, &solved.strengths, LEAST_SHARE),
    };
    Ok(Reconstruction { indices, intensity, misfit: solved.misfit, unseen: solved.unseen })
}

/// What a method finds.
pub(crate) struct Solved {
    /// Rising indices of the voxels still held to have light.
    pub(crate) indices: Vec<u64>,
    /// Strength of each.
    pub(crate) strengths: Vec<f32>,
    pub(crate) misfit: Vec<f64>,
    pub(crate) unseen: usize,
}

#[cfg(test)]
mod tests;
