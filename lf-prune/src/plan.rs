//! Pruning before it runs, with its views and its memory; the run itself; and the voxels kept.

use crate::options::PruneOptions;
use crate::score::{Scorer, Shades, thread_bytes, views_bytes};
use lf_core::views::{Region, Sections, ViewsPlan};
use lf_core::{Camera, Grid, Refusal, io, weights::check_depth};
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Number of slices that are pruned to estimate how many voxels all slices keep.
const SAMPLE_SLICES: usize = 9;

/// Bytes of a kept voxel in the list of its slice, and in the support: its index and score. The lists are freed while
/// the support grows.
const LISTED_BYTES: f64 = 8.0 + 0.5;
const KEPT_BYTES: f64 = 12.0 + 0.7;

/// Number of times that freed lists are given back to the system while the support grows.
const RELEASES: usize = 8;

/// Bytes of each slice before any voxel is kept: its region, and the head of its list.
const HEAD_BYTES: f64 = (size_of::<Region>() + size_of::<Vec<(u32, f32)>>()) as f64;

/// Largest number of voxels of a slice that are pruned to estimate how many are kept.
const SAMPLE_VOXELS: usize = 1 << 26;

/// Bytes that a thread holds for each voxel of a slice: the list of voxels kept while it grows.
const SLICE_BYTES: f64 = 2.0;

/// Pruning that is ready to run.
pub struct PrunePlan<'a> {
    camera: &'a Camera,
    grid: &'a Grid,
    regions: &'a [Region],
    options: &'a PruneOptions,
    sections: Sections,
    views: ViewsPlan,
}

impl<'a> PrunePlan<'a> {
    /// Plans the pruning of one region in each slice of `grid`. The regions change neither scores nor indices, to the
    /// bit. Refuses a grid that is too deep, a slice of 2^32 voxels or more, sections outside
    /// [`lf_core::weights::SECTIONS`], and more views than 32 bits can count. Panics unless each slice has one region,
    /// within the grid.
    pub fn new(
        camera: &'a Camera,
        grid: &'a Grid,
        regions: &'a [Region],
        options: &'a PruneOptions,
    ) -> Result<Self, Refusal> {
        check_depth(camera, grid)?;
        let sections = Sections::new(camera, options.sections)?;
        let [nx, ny, nz] = grid.shape;
        let found = || format!("a slice of {nx} x {ny} voxels");
        Refusal::unless((nx as u64 * ny as u64) < 1 << 32, found, "wanted less than 2^32 voxels a slice")?;
        assert_eq!(regions.len(), nz, "a region for each slice");
        assert!(regions.iter().all(|[x, y]| x.end <= nx && y.end <= ny), "regions of the grid");
        let views = ViewsPlan::new(camera, grid);
        views.check(sections.count())?;
        Ok(Self { camera, grid, regions, options, sections, views })
    }

    /// Sections of the aperture that lie inside the camera's stop.
    pub fn sections(&self) -> u32 {
        self.sections.count()
    }

    /// The views that the image is sorted into.
    pub fn about(&self) -> String {
        self.views.about(self.sections.count())
    }

    /// Voxels to score.
    pub fn voxels(&self) -> u64 {
        self.regions.iter().map(|[x, y]| x.len() as u64 * y.len() as u64).sum()
    }

    /// Estimates the number of voxels that [`PrunePlan::prune`] will keep: prunes a few slices.
    pub fn estimated_kept(&self, image: ArrayView2<f32>) -> Result<f64, Refusal> {
        // Cover the same depth with fewer slices.
        let nz = self.grid.shape[2];
        let few = nz.min(SAMPLE_SLICES);
        let stretch = nz as f64 / few as f64;
        let mut grid = self.grid.clone();
        grid.shape[2] = few;
        grid.spacing_mm[2] *= stretch;
        grid.origin_mm[2] += 0.5 * (stretch - 1.0) * self.grid.spacing_mm[2];
        // Take only some lines along x of a huge slice, at another y in each slice.
        let whole = |slice: usize| &self.regions[((slice as f64 + 0.5) * stretch) as usize];
        let part = |slice: usize| {
            let [x, y] = whole(slice).clone();
            let lines = (SAMPLE_VOXELS / x.len().max(1)).clamp(1, y.len().max(1));
            let start = y.start + (y.len() - lines.min(y.len())) * (2 * slice + 1) / (2 * few);
            [x, start..(start + lines).min(y.end)]
        };
        let regions: Vec<Region> = (0..few).map(part).collect();
        // Prune them, and scale the number kept to the whole volume.
        let area = |[x, y]: &Region| x.len() as f64 * y.len() as f64;
        let wholes = (0..few).map(|slice| area(whole(slice))).sum::<f64>();
        let times = wholes / regions.iter().map(area).sum::<f64>().max(1.0);
        let sample = PrunePlan::new(self.camera, &grid, &regions, self.options)?.prune(image, |_| ());
        Ok(times * sample.indices.len() as f64 * stretch)
    }

    /// Bytes of the lists of slices: what [`PrunePlan::new`] and [`PrunePlan::prune`] hold of a grid for any region.
    pub fn list_bytes(grid: &Grid) -> f64 {
        HEAD_BYTES * grid.shape[2] as f64
    }

    /// Peak bytes in use beside the image of `pixels` pixels, if `kept` voxels are kept.
    pub fn bytes(&self, pixels: usize, kept: f64) -> u64 {
        let pixels = pixels as f64;
        let views = views_bytes(&self.views, &self.sections);
        let threads = rayon::current_num_threads().min(self.grid.shape[2]) as f64;
        let slice = self.regions.iter().map(|[x, y]| x.len() * y.len()).max().unwrap_or(0);
        let thread = thread_bytes(self.camera, self.grid, &self.sections, &self.views, slice);
        let pruning = views + threads * (thread + SLICE_BYTES * slice as f64) + LISTED_BYTES * kept;
        (pixels + Self::list_bytes(self.grid) + pruning.max(KEPT_BYTES * kept)) as u64
    }

    /// Scores the voxels against an image of the camera's size and keeps those that may hold light. A pixel that is NaN
    /// is blind: it counts neither for a voxel nor against it. Sections of the aperture that the image shows as dark do
    /// not count. `done` gets the number of slices just finished.
    ///
    /// A voxel is scored at a place of a raster that is at most a quarter of a voxel from its centre along each side of
    /// the lattice. It costs some hundred additions of 8 bits, for any camera.
    pub fn prune(&self, image: ArrayView2<f32>, done: impl Fn(u64) + Sync) -> Support {
        let peak = image.iter().fold(0f32, |peak, value| peak.max(*value));
        if peak <= 0.0 && !self.options.keep_all {
            return Support { indices: Vec::new(), scores: Vec::new(), dark_sections: 0, closed_sections: 0 };
        }
        let (sections, closed_sections) = self.sections.lit(image, self.camera, self.grid);
        let shades = Shades::new(image, peak, sections.count(), self.options);
        let scorer = Scorer::new(&shades, &sections, self.camera, self.grid, &self.views);
        let [nx, ny, nz] = self.grid.shape;
        let slices: Vec<Vec<(u32, f32)>> =
            (0..nz).into_par_iter().map(|z| scorer.slice(z, &self.regions[z])).inspect(|_| done(1)).collect();
        drop(scorer);
        io::release_memory();
        let count = slices.iter().map(Vec::len).sum();
        let (indices, scores) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let dark_sections = self.sections.count() - sections.count();
        let mut support = Support { indices, scores, dark_sections, closed_sections };
        let mut freed = 0;
        for (z, slice) in slices.into_iter().enumerate() {
            freed += slice.len();
            if freed > count / RELEASES {
                freed = 0;
                io::release_memory();
            }
            let base = nx as u64 * ny as u64 * z as u64;
            support.indices.extend(slice.iter().map(|(place, _)| base + u64::from(*place)));
            support.scores.extend(slice.iter().map(|(_, score)| *score));
        }
        support
    }
}

/// The voxels that pruning keeps.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// Rising linear indices.
    pub indices: Vec<u64>,
    /// Score of each: the geometric mean in counts, or the share of pixels.
    pub scores: Vec<f32>,
    /// Sections inside the stop that are dark for every voxel and count for none.
    pub dark_sections: u32,
    /// Dark sections that the true stop surely closes: enough particles leave them dark.
    pub closed_sections: u32,
}

impl Support {
    /// (inside, lost): the number of these places that lie in `grid`, and of those whose voxel is not kept.
    pub fn lost(&self, grid: &Grid, places_mm: &[[f64; 3]]) -> (usize, usize) {
        let (mut inside, mut lost) = (0, 0);
        for place in places_mm {
            let voxel = [0, 1, 2].map(|axis| grid.place_vox(axis, place[axis]).round());
            if (0..3).all(|axis| voxel[axis] >= 0.0 && voxel[axis] < grid.shape[axis] as f64) {
                inside += 1;
                let index = grid.index(voxel.map(|step| step as usize));
                lost += usize::from(self.indices.binary_search(&index).is_err());
            }
        }
        (inside, lost)
    }
}
