//! Start, sweeps and result of a reconstruction.

/// Intensities to begin with. Voxels that it does not name begin dim.
#[derive(Debug, Clone, Copy)]
pub struct Start<'a> {
    /// Rising linear indices on the support's grid.
    pub indices: &'a [u64],
    /// Intensity of each, counts.
    pub intensity: &'a [f32],
}

/// A finished sweep over all pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// From 1.
    pub number: usize,
    /// `|image - projection| / |image|` over the pixels that the support can reach, each before its own update.
    pub misfit: f64,
    /// Sum of the absolute changes of the strengths over the sum of the strengths.
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
    /// Intensity of each, counts: the light that the voxel sends through the aperture.
    pub intensity: Vec<f32>,
    /// The sweeps.
    pub sweeps: Vec<Sweep>,
    /// Support voxels that no pixel sees; they are left out.
    pub unseen: usize,
    /// Voxels brighter than the greatest `f32`, which they have instead.
    pub clipped: usize,
}

/// Why no sweep followed the last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ended {
    /// All sweeps asked for are done.
    Most,
    /// The misfit stalls.
    Stalled,
    /// The misfit asked for is reached.
    Reached,
}

/// Whether two sweeps lower the misfit by less than a hundredth.
pub(crate) fn stalls(sweeps: &[Sweep]) -> bool {
    sweeps.len() > 2 && sweeps[sweeps.len() - 1].misfit > 0.99 * sweeps[sweeps.len() - 3].misfit
}
