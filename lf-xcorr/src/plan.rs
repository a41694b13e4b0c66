//! A correlation that has been checked and can be estimated and run.

use crate::error::Refused;
use crate::passes::{Options, Outcome, Pass, memory, multigrid, triple};
use crate::volumes::{Mask, Sparse};
use lf_core::Grid;

/// Pairs, a mask and options that fit together.
#[derive(Debug, Clone)]
pub struct Plan<'a> {
    pairs: &'a [[Sparse<'a>; 2]],
    mask: &'a Mask<'a>,
    options: &'a Options,
    /// The grid of the voxels that windows may hold.
    part: Grid,
}

impl<'a> Plan<'a> {
    /// Plans the correlation of several pairs that show the same flow: their correlations are summed before the search
    /// for a peak. Every volume is scaled to a sum of squares of 1, so a bright pair weighs no more than a dim one.
    /// Refuses the first volume, mask or option that does not fit. Panics without a pair, or if a volume's lengths
    /// differ or its indices do not rise.
    pub fn new(pairs: &'a [[Sparse<'a>; 2]], mask: &'a Mask<'a>, options: &'a Options) -> Result<Self, Refused> {
        let part = Sparse::check_pairs(pairs, mask)?;
        options.check(part.shape)?;
        Ok(Self { pairs, mask, options, part })
    }

    /// Bytes of the lists of rows, and of windows along the axes, that planning itself takes for volumes of `grid`.
    pub fn list_bytes(grid: &Grid, volumes: usize) -> f64 {
        let [nx, ny, nz] = grid.shape.map(|count| count as f64);
        8.0 * ny * nz * volumes as f64 + memory::AXIS_BYTES * (nx + ny + nz)
    }

    /// Estimate of the peak bytes that [`Plan::correlate`] uses, without the volumes themselves.
    pub fn bytes(&self) -> u64 {
        memory::bytes(self.pairs, self.mask, self.options)
    }

    /// The decisions of the plan, for `--verbose`.
    pub fn about(&self) -> String {
        let windows = |pass: &Pass| format!("{} voxels at overlap {}", triple(pass.window), pass.overlap);
        let windows: Vec<String> = self.options.passes.iter().map(windows).collect();
        let gigabytes = 1e-9 * self.bytes() as f64;
        format!("about {gigabytes:.2} GB of memory beside the volumes; windows of {}", windows.join(", then of "))
    }

    /// Windows in all passes, repeats counted: the total that [`Plan::correlate`] counts up to.
    pub fn windows(&self) -> u64 {
        self.options.windows(self.part.shape)
    }

    /// Runs the passes. Calls `watch(n)` after n more windows. Refuses volumes without a peak in any window of a pass.
    pub fn correlate(&self, watch: &(dyn Fn(u64) + Sync)) -> Result<Outcome, Refused> {
        multigrid::run(self.pairs, self.mask, self.options, &self.part, watch)
    }
}

/// Correlates two volumes of one grid; refuses and panics as [`Plan::new`] and [`Plan::correlate`] do.
pub fn correlate(first: &Sparse, second: &Sparse, options: &Options) -> Result<Outcome, Refused> {
    Plan::new(&[[*first, *second]], &Mask::Everything, options)?.correlate(&|_| ())
}
