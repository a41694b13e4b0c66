//! The words that options take.

use clap::ValueEnum;

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum WeightsName {
    /// Geometric optics without sampling
    Exact,
    /// The paper's dense ray tracing: n x n sections of the aperture, one beam and one chief ray each
    Drt,
    /// Tomographic PIV's: a sphere for the voxel, a cylinder for the pixel's line of sight
    Sphere,
}

#[derive(Clone, Copy, ValueEnum)]
pub enum BasisName {
    /// Its centre
    Point,
    /// Its width in x and y
    Box,
    /// A Gaussian particle image; the volume written is the sum of the blobs
    Blob,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum MethodName {
    /// Ordered subsets of simultaneous MART, with momentum
    Subsets,
    /// Simultaneous MART
    Smart,
    /// Maximum likelihood by expectation maximisation
    Mlem,
    /// The paper's row action: pixel after pixel, with stored weights
    Mart,
}
