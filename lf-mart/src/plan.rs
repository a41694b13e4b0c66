//! A reconstruction before it runs: its weights, where they are kept, its memory; and then the run itself.

use crate::blob;
use crate::method::{Problem, row_action, simultaneous};
use crate::operator::{BLOCKS, Plane, Storage};
use crate::options::{Method, Options};
use crate::reconstruction::{Reconstruction, Start, Sweep};
use lf_core::{Camera, Grid, Refusal, Weights, simd::Level, weights::Basis};
use ndarray::{Array2, ArrayView2};

/// Assumed fraction of voxels that pruning keeps, for the first strengths of a tile. Only the whole volume knows the
/// true fraction, and tiles that begin differently drop slightly different voxels. In the ready scenes lf-prune keeps a
/// twentieth to a tenth.
const KEPT_SHARE: f64 = 0.1;

/// Lenslets a side of the blocks in which a tile looks for the strongest voxel.
const BLOCK_LENSLETS: f64 = 4.0;

/// Voxels of the result below this share of its brightest are not written.
const LEAST_SHARE: f32 = 1e-4;

/// Like [`LEAST_SHARE`], but for a tile and the brightest of its core. A voxel that the whole volume writes and a tile
/// does not is then well below [`LEAST_SHARE`] of the whole volume's brightest, which the tile cannot know.
const LEAST_SHARE_OF_TILE: f32 = 0.5 * LEAST_SHARE;

/// Bytes per voxel of the support, unless weights are stored by pixel: index, profile, strength now and one sweep
/// before, share, and one byte to drop it.
const VOXEL_BYTES: u64 = 8 + 4 + 4 + 4 + 4 + 1;

/// Bytes per voxel that weights take which are kept later: its index; and if they come from tables, its share and two
/// sums.
const LATER_BYTES: u64 = 8;
const TABLE_VOXEL_BYTES: u64 = LATER_BYTES + 4 + 8;

/// Bytes per voxel of the solution: index and strength.
const SOLVED_BYTES: u64 = 12;

/// A reconstruction that is ready to run.
pub struct Plan<'a> {
    indices: &'a [u64],
    options: &'a Options,
    weights: Weights,
    storage: Storage,
    bytes: u64,
    /// Side of the blocks of [`Problem::block_vox`], mm.
    block_mm: f64,
}

impl<'a> Plan<'a> {
    /// Plans the reconstruction of the voxels `indices` (rising) of `grid`. Refuses an index outside the grid, and what
    /// [`Weights::choose`] refuses.
    pub fn new(camera: &Camera, grid: &Grid, indices: &'a [u64], options: &'a Options) -> Result<Self, Refusal> {
        let is_inside = indices.last().is_none_or(|last| *last < grid.len()) && u32::try_from(indices.len()).is_ok();
        let found = || format!("{} voxels, or one outside the grid", indices.len());
        Refusal::unless(is_inside, found, "wanted less than 2^32 voxels of the grid")?;
        let lists = Weights::list_bytes(camera, grid, options.weights);
        Self::allow(lists, options, || format!("the lists of a {grid}"))?;
        let weights = Weights::choose(camera, grid, options.weights, options.basis)?;
        let subsets = simultaneous::subsets(&weights, options.method);
        let (storage, weight_bytes) = match options.method {
            Method::Mart => (Storage::ByPixel, row_action::weight_bytes(&weights, indices)),
            _ => Storage::choose(&weights, indices, subsets, options.max_bytes),
        };
        // Kept weights are projected in blocks, onto the rows of a subset.
        let planes_of_kept = 3 + BLOCKS.div_ceil(subsets) as u64;
        let (voxel_bytes, planes) = match storage {
            Storage::ByPixel => (8, 4),
            Storage::Profiles => (VOXEL_BYTES + LATER_BYTES, planes_of_kept),
            Storage::Tables => (VOXEL_BYTES + TABLE_VOXEL_BYTES, planes_of_kept),
            Storage::Kept => (VOXEL_BYTES, planes_of_kept),
            Storage::Remade => (VOXEL_BYTES, 2 + BLOCKS as u64),
        };
        let [width, height] = weights.sensor_px();
        let plane_bytes = 4 * Plane::stride(width) as u64 * height as u64;
        let bytes = voxel_bytes * indices.len() as u64 + weight_bytes + planes * plane_bytes;
        let lenslet_mm = camera.microlenses.pitch_mm / camera.main_lens.magnification;
        Ok(Self { indices, options, weights, storage, bytes, block_mm: BLOCK_LENSLETS * lenslet_mm })
    }

    /// Estimated peak of the bytes in use during the sweeps, beside image and support, from a sample of the voxels and
    /// slices. A small estimate may be exceeded by half.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Estimated peak of the bytes that the tool needs beside the image and the support as they were read, for an image
    /// of `pixels` pixels: sweeps, the image in units of its brightest pixel, and the volume written.
    pub fn peak_bytes(&self, pixels: usize) -> u64 {
        // The sample is off by a few per cent in the number of weights, and growing lists take more than they hold.
        let is_listed = matches!(self.storage, Storage::Kept | Storage::ByPixel);
        let sweeps = if is_listed { self.bytes / 4 * 5 } else { self.bytes };
        // The solution and what is written.
        let voxels = self.indices.len() as u64;
        let written = match self.options.basis {
            Basis::Blob { sigma_px } => {
                blob::estimated_bytes(self.weights.grid(), self.indices, self.weights.blob_vox(sigma_px)) as u64
            }
            Basis::Point | Basis::Box => SOLVED_BYTES * voxels,
        };
        sweeps.max(SOLVED_BYTES * voxels + written) + 4 * pixels as u64
    }

    /// Refuses more bytes than the options allow.
    fn allow(bytes: u64, options: &Options, what: impl FnOnce() -> String) -> Result<(), Refusal> {
        let [needed, most] = [bytes, options.max_bytes].map(|bytes| bytes as f64 * 1e-9);
        let found = || format!("{} would take about {needed:.2} GB", what());
        Refusal::unless(bytes <= options.max_bytes, found, format!("wanted {most} GB at most, as --max-memory allows"))
    }

    /// How the weights are made and kept, and why.
    pub fn about(&self) -> String {
        let storage = match self.storage {
            Storage::Tables => "until they fit into memory".to_string(),
            Storage::Profiles => format!("with {}", Level::detect().name()),
            Storage::Kept => "kept in memory".to_string(),
            Storage::Remade => "made anew at every use until they fit into memory".to_string(),
            Storage::ByPixel => return "weights stored pixel by pixel, as --method mart needs them".to_string(),
        };
        format!("weights {}, {storage}: {}", self.weights.path.about(), self.weights.reason)
    }

    /// Solves for the intensities. Pixels that are NaN are blind: they move no voxel. `done` is called after each
    /// sweep. Refuses to take more memory than the options allow.
    pub fn solve(
        &self,
        image: ArrayView2<f32>,
        start: Option<Start>,
        done: impl FnMut(&Sweep),
    ) -> Result<Reconstruction, Refusal> {
        Self::allow(self.peak_bytes(image.len()), self.options, || format!("{} voxels", self.indices.len()))?;
        let (image, unit) = self.scaled(image);
        let problem = self.problem(&image, unit, start);
        let solved = match self.options.method {
            Method::Mart => row_action::solve(&problem, done)?,
            _ => simultaneous::solve(&problem, done),
        };
        let grid = self.weights.grid();
        let tile = self.options.tile.as_ref();
        let core_vox = tile.map_or([[0, grid.shape[0]], [0, grid.shape[1]]], |tile| tile.core_vox);
        let least_share = if tile.is_some() { LEAST_SHARE_OF_TILE } else { LEAST_SHARE };
        let (indices, mut intensity) = match self.options.basis {
            Basis::Blob { sigma_px } => {
                let sigma_vox = self.weights.blob_vox(sigma_px);
                blob::spread(grid, &solved.indices, &solved.strengths, sigma_vox, least_share, core_vox)
            }
            Basis::Point | Basis::Box => blob::lit(grid, &solved.indices, &solved.strengths, least_share, core_vox),
        };
        let mut clipped = 0;
        for value in &mut intensity {
            let counts = f64::from(*value) * unit;
            clipped += usize::from(counts > f64::from(f32::MAX));
            *value = counts.min(f64::from(f32::MAX)) as f32;
        }
        Ok(Reconstruction { indices, intensity, sweeps: solved.sweeps, unseen: solved.unseen.len(), clipped })
    }

    /// The image in units of its brightest pixel, in which no sum is too large or too small for f32; and the unit,
    /// counts.
    fn scaled(&self, image: ArrayView2<f32>) -> (Array2<f32>, f64) {
        let peak = f64::from(image.iter().fold(0f32, |peak, value| peak.max(*value)));
        let unit = if peak > 0.0 { peak } else { 1.0 };
        let mut image = image.mapv(|value| (f64::from(value) / unit) as f32);
        if let Some(tile) = &self.options.tile {
            // Pixels outside the tile's are blind.
            let is_inside = |axis: usize, place: usize| (tile.pixels[axis][0]..tile.pixels[axis][1]).contains(&place);
            let outside = image.indexed_iter_mut().filter(|((y, x), _)| !(is_inside(0, *x) && is_inside(1, *y)));
            outside.for_each(|(_, value)| *value = f32::NAN);
        }
        (image, unit)
    }

    fn problem<'p>(&'p self, image: &'p Array2<f32>, unit: f64, start: Option<Start<'p>>) -> Problem<'p> {
        let Self { weights, indices, options, .. } = self;
        let light: f64 = image.iter().filter(|value| !value.is_nan()).map(|value| f64::from(*value)).sum();
        let voxels = match options.tile {
            Some(_) => KEPT_SHARE * weights.grid().len() as f64,
            None => indices.len().max(1) as f64,
        };
        let even = (light / voxels) as f32;
        let block_vox = [0, 1].map(|axis| (self.block_mm / weights.grid().spacing_mm[axis]).round().max(1.0) as usize);
        Problem { image, unit, even, block_vox, weights, indices, start, options }
    }
}
