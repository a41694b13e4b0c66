//! Image, camera and voxels to intensities, by multiplicative algebraic reconstruction.
//!
//! `mart` is the row action of Shi, Ding, New & Soria (2017), eq. 1: pixel after pixel, weights stored. `smart` and
//! `mlem` move all voxels by all pixels at once. `subsets`, the default, is `smart` over interleaved image rows, one
//! subset of rows after another, with momentum. All but `mart` make weights from profiles where they are used; a
//! matrix is kept for lattices not in line with the pixels and rays that bend alone, and where it fits.

pub mod blob;
mod inline;
mod kernel;
#[cfg(target_arch = "x86_64")]
mod kernel_avx;
mod kernel_lenslets;
mod memory;
mod momentum;
mod operator;
pub mod projector;
mod row_action;
mod scattered;
mod simultaneous;
mod spent;
mod tables;

pub use memory::{Route, estimate_bytes, route};

use lf_core::camera::Camera;
use lf_core::grid::Grid;
use lf_core::weights::{Basis, Footprint, Model};
use ndarray::{Array2, ArrayView2};

/// How intensities are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Ordered subsets of SMART with momentum: the default.
    Subsets,
    /// Simultaneous MART: all pixels at once.
    Smart,
    /// Maximum likelihood by expectation maximisation: as SMART, with the mean of ratios in place of that of logarithms.
    Mlem,
    /// The paper's row action.
    Mart,
}

/// When sweeps end before their number is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Until {
    /// Never.
    Never,
    /// When two sweeps bring the misfit down by less than a hundredth.
    Stall,
    /// When the misfit is this or less.
    Misfit(f64),
    /// When the misfit is what noise of this standard deviation, counts, leaves, or stalls.
    Noise(f64),
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
    /// Sweeps over all pixels, at most.
    pub iterations: usize,
    /// When fewer are enough.
    pub until: Until,
    /// Relaxation: the factor mu of the exponent.
    pub relaxation: f64,
    /// A dark pixel counts as this share of the image's brightest: the logarithm stays finite, and one dark pixel among
    /// hundreds cannot put out a voxel at once.
    pub floor: f64,
    /// One step multiplies a strength by no more than this, or divides it.
    pub clamp: f64,
    /// Refuse what would take more memory than this, bytes.
    pub max_bytes: u64,
    /// What the voxels are a part of; none for a whole volume.
    pub part: Option<Part>,
}

/// A part of a volume that is to become what it is in the whole: nothing is decided by what another part may not know. The
/// whole is such a part as well.
///
/// Spent voxels are told from the strongest near them and not from the strongest of all, momentum is never taken back, and
/// only misfits that [`Until`] names end the sweeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Columns and rows of the image, `[from, to)`, that no voxel but the part's lights. The others are blind.
    pub pixels: [[usize; 2]; 2],
    /// The voxels along x and y, `[from, to)`, that the part is to give; the others are there for them.
    pub core_vox: [[usize; 2]; 2],
}

/// The share of the whole grid's voxels that a part begins as if there were. How many there are only the whole knows, and two
/// parts that begin otherwise do not drop quite the same voxels; the lf-prune of the ready scenes keeps a twentieth to a tenth.
const KEPT_SHARE: f64 = 0.1;

/// Lenslets along a side of the blocks within which the strongest voxel is looked for, of three by three about a voxel.
const BLOCK_LENSLETS: f64 = 4.0;

/// Where a reconstruction begins: the intensities of some voxels. The others begin dim.
#[derive(Debug, Clone, Copy)]
pub struct Start<'a> {
    /// Rising linear indices on the support's grid.
    pub indices: &'a [u64],
    /// Intensity of each, counts.
    pub intensity: &'a [f32],
}

/// A sweep that is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// Its number, from 1.
    pub number: usize,
    /// `|image - projection| / |image|` over the pixels the support can reach, each as it was before its own update.
    pub misfit: f64,
    /// Sum of the changes of the strengths, without sign, over the sum of the strengths.
    pub change: f64,
    /// Voxels still held to have light.
    pub voxels: usize,
    /// Weights touched, forward and back.
    pub weights: u64,
}

/// A reconstruction.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// Rising linear indices of the lit voxels.
    pub indices: Vec<u64>,
    /// Intensity of each, counts: what the voxel sends through the aperture.
    pub intensity: Vec<f32>,
    /// The sweeps.
    pub sweeps: Vec<Sweep>,
    /// Support voxels that no pixel sees; they are left out.
    pub unseen: usize,
}

/// Why no sweep followed the last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ended {
    /// They are as many as were asked for.
    Most,
    /// The misfit stalls.
    Stalled,
    /// The misfit is what was asked for.
    Reached,
}

impl Options {
    /// Why these sweeps were enough.
    pub fn ended(&self, sweeps: &[Sweep]) -> Ended {
        match self.until {
            Until::Misfit(_) if sweeps.len() < self.iterations => Ended::Reached,
            Until::Noise(_) if sweeps.len() < self.iterations && !stalls(sweeps) => Ended::Reached,
            Until::Stall | Until::Noise(_) if stalls(sweeps) => Ended::Stalled,
            _ => Ended::Most,
        }
    }
}

/// Whether two sweeps bring the misfit down by less than a hundredth.
fn stalls(sweeps: &[Sweep]) -> bool {
    sweeps.len() > 2 && sweeps[sweeps.len() - 1].misfit > 0.99 * sweeps[sweeps.len() - 3].misfit
}

/// Voxels of the result below this share of its brightest are not written.
const LEAST_SHARE: f32 = 1e-4;

/// The same of a part and its core's brightest: what the whole writes and a part does not is then well below [`LEAST_SHARE`] of
/// the whole's brightest, which the part may not know.
const LEAST_SHARE_OF_PART: f32 = 0.5 * LEAST_SHARE;

/// Strengths stay below this, in units of the image's brightest pixel: sums over any image stay finite.
const GREATEST_STRENGTH: f32 = 1e20;

/// What a voxel begins with that a [`Start`] does not name, as a share of its brightest.
const DIM: f32 = 1e-3;

/// Solves for the intensities of the voxels `indices` (rising) of `grid`. `done` is told of each sweep. Pixels that are NaN
/// are blind: they move no voxel.
///
/// # Errors
/// Where the grid is too deep for the camera, an index lies outside it, or memory does not suffice.
pub fn reconstruct(
    image: ArrayView2<f32>,
    camera: &Camera,
    grid: &Grid,
    indices: &[u64],
    start: Option<Start>,
    options: &Options,
    done: impl FnMut(&Sweep),
) -> Result<Reconstruction, String> {
    if indices.last().is_some_and(|last| *last >= grid.len()) || u32::try_from(indices.len()).is_err() {
        return Err(format!("{} voxels, or one outside the grid", indices.len()));
    }
    let bytes = estimate_bytes(camera, grid, indices, options)?;
    if bytes > options.max_bytes {
        let [bytes, most] = [bytes, options.max_bytes].map(|bytes| bytes as f64 * 1e-9);
        return Err(format!("{} voxels would take about {bytes:.2} GB of {most} allowed", indices.len()));
    }
    let footprint = Footprint::new(camera, grid, options.weights, options.basis)?;
    // In units of the brightest pixel no sum is too large or too small for f32, whatever a camera's counts are.
    let peak = f64::from(image.iter().fold(0f32, |peak, value| peak.max(*value)));
    let unit = if peak > 0.0 { peak } else { 1.0 };
    let mut image = image.mapv(|value| (f64::from(value) / unit) as f32);
    let light: f64 = image.iter().filter(|value| !value.is_nan()).map(|value| f64::from(*value)).sum();
    let mut even = light / indices.len().max(1) as f64;
    if let Some(Part { pixels: [columns, rows], .. }) = options.part {
        even = light / (KEPT_SHARE * grid.len() as f64);
        for ((row, column), value) in image.indexed_iter_mut() {
            if !((rows[0]..rows[1]).contains(&row) && (columns[0]..columns[1]).contains(&column)) {
                *value = f32::NAN;
            }
        }
    }
    let lenslet_mm = camera.microlenses.pitch_mm / camera.main_lens.magnification;
    let block_vox = [0, 1].map(|axis| (BLOCK_LENSLETS * lenslet_mm / grid.spacing_mm[axis]).round().max(1.0) as usize);
    let even = even as f32;
    let problem = Problem { image, unit, even, block_vox, footprint: &footprint, indices, start, options };
    let solved = match options.method {
        Method::Mart => row_action::solve(&problem, done)?,
        Method::Subsets | Method::Smart | Method::Mlem => simultaneous::solve(&problem, done),
    };
    let core_vox = options.part.map_or([[0, grid.shape[0]], [0, grid.shape[1]]], |part| part.core_vox);
    let least_share = if options.part.is_some() { LEAST_SHARE_OF_PART } else { LEAST_SHARE };
    let (indices, mut intensity) = match options.basis {
        Basis::Blob { sigma_vox } => {
            blob::spread(grid, &solved.indices, &solved.strengths, sigma_vox, least_share, core_vox)
        }
        Basis::Point | Basis::Box => blob::lit(grid, &solved.indices, &solved.strengths, least_share, core_vox),
    };
    let largest = f64::from(f32::MAX);
    intensity.iter_mut().for_each(|value| *value = (f64::from(*value) * unit).min(largest) as f32);
    Ok(Reconstruction { indices, intensity, sweeps: solved.sweeps, unseen: solved.unseen })
}

/// What a method is given.
pub(crate) struct Problem<'a> {
    /// The brightest pixel is 1; a blind one is NaN.
    pub(crate) image: Array2<f32>,
    /// Counts of the brightest pixel.
    pub(crate) unit: f64,
    /// The image's light shared out evenly: what a voxel begins with.
    pub(crate) even: f32,
    /// Blocks within which a part of a volume looks for the strongest voxel.
    pub(crate) block_vox: [usize; 2],
    pub(crate) footprint: &'a Footprint,
    pub(crate) indices: &'a [u64],
    pub(crate) start: Option<Start<'a>>,
    pub(crate) options: &'a Options,
}

impl Problem<'_> {
    /// Strengths to begin with: those of the start, or an even volume of the image's light.
    pub(crate) fn first_strengths(&self) -> Vec<f32> {
        let Some(start) = self.start else {
            return vec![self.even; self.indices.len()];
        };
        let in_units = |intensity: f32| ((f64::from(intensity) / self.unit) as f32).clamp(0.0, GREATEST_STRENGTH);
        let dim = DIM * start.intensity.iter().fold(0f32, |peak, value| peak.max(in_units(*value)));
        let mut known = start.indices.iter().zip(start.intensity).peekable();
        let of = |index: &u64| {
            while known.next_if(|(place, _)| *place < index).is_some() {}
            known.next_if(|(place, _)| *place == index).map_or(dim, |(_, intensity)| in_units(*intensity).max(dim))
        };
        self.indices.iter().map(of).collect()
    }

    /// Whether the sweeps so far are enough. `pixels` are those reached, `light` the root of their sum of squares.
    pub(crate) fn enough(&self, sweeps: &[Sweep], pixels: usize, light: f64) -> bool {
        let Some(last) = sweeps.last() else { return false };
        match self.options.until {
            Until::Never => false,
            Until::Stall => stalls(sweeps),
            Until::Misfit(wanted) => last.misfit <= wanted,
            Until::Noise(sigma) => last.misfit <= sigma / self.unit * (pixels as f64).sqrt() / light || stalls(sweeps),
        }
    }
}

/// What a method finds.
pub(crate) struct Solved {
    /// Rising indices of the voxels still held to have light.
    pub(crate) indices: Vec<u64>,
    /// Strength of each, in units of the brightest pixel.
    pub(crate) strengths: Vec<f32>,
    pub(crate) sweeps: Vec<Sweep>,
    pub(crate) unseen: usize,
}

#[cfg(test)]
mod tests;
