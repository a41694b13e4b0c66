//! The options of a reconstruction.

use crate::reconstruction::{Ended, Sweep, stalls};
use lf_core::Tile;
use lf_core::weights::{Basis, Model};

/// How intensities are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Ordered subsets of simultaneous MART, with momentum
    Subsets,
    /// Simultaneous MART
    Smart,
    /// Maximum likelihood by expectation maximisation
    Mlem,
    /// The paper's row action: pixel after pixel, with stored weights
    Mart,
}

/// When sweeps end before their number is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Until {
    /// Never.
    Never,
    /// When two sweeps lower the misfit by less than a hundredth.
    Stall,
    /// When the misfit is this or less.
    Misfit(f64),
    /// When the misfit is what noise of this standard deviation (counts) leaves, or when it stalls.
    Noise(f64),
}

/// The options of a reconstruction.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// The weights.
    pub weights: Model,
    /// The meaning of a voxel in the weights.
    pub basis: Basis,
    /// The method.
    pub method: Method,
    /// Largest number of sweeps over all pixels.
    pub iterations: usize,
    /// When to end sooner.
    pub until: Until,
    /// Relaxation: the factor mu of the exponent.
    pub relaxation: f64,
    /// Largest factor by which one step changes a strength.
    pub clamp: f64,
    /// Limit of memory, bytes; a reconstruction that needs more is refused.
    pub max_bytes: u64,
    /// The tile that the voxels are; None for a whole volume. A tile must become what it is in the whole volume, so
    /// nothing may depend on other tiles: dim voxels are found by the strongest voxel near them and not by the
    /// strongest of all, momentum is never reset, and only misfits that [`Until`] names end the sweeps. Pixels outside
    /// the tile's are blind.
    pub tile: Option<Tile>,
}

impl Options {
    /// Why no sweep followed these.
    pub fn ended(&self, sweeps: &[Sweep]) -> Ended {
        match self.until {
            Until::Misfit(_) if sweeps.len() < self.iterations => Ended::Reached,
            Until::Noise(_) if sweeps.len() < self.iterations && !stalls(sweeps) => Ended::Reached,
            Until::Stall | Until::Noise(_) if stalls(sweeps) => Ended::Stalled,
            _ => Ended::Most,
        }
    }
}
