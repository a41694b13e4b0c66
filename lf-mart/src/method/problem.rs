//! Input and output of a method: [`Problem`] and [`Solved`].

use crate::options::{Options, Until};
use crate::reconstruction::{Start, Sweep, stalls};
use lf_core::Weights;
use ndarray::Array2;

/// Lower limit of a pixel's brightness, as a share of the image's brightest. It keeps logarithms finite, and keeps one
/// dark pixel among hundreds from extinguishing a voxel at once.
pub(crate) const DARK: f32 = 1e-4;

/// Strengths stay below this, in units of the image's brightest pixel, so that sums over any image stay finite.
pub(super) const GREATEST_STRENGTH: f32 = 1e20;

/// First strength of a voxel that a [`Start`] does not name, as a share of the start's brightest.
const DIM: f32 = 1e-3;

pub(crate) struct Problem<'a> {
    /// The image in units of its brightest pixel; blind pixels are NaN.
    pub(crate) image: &'a Array2<f32>,
    /// Counts of the brightest pixel.
    pub(crate) unit: f64,
    /// The image's light shared out evenly: the first strength of a voxel.
    pub(crate) even: f32,
    /// Voxels along x and y of the blocks in which a tile looks for the strongest voxel.
    pub(crate) block_vox: [usize; 2],
    pub(crate) weights: &'a Weights,
    pub(crate) indices: &'a [u64],
    pub(crate) start: Option<Start<'a>>,
    pub(crate) options: &'a Options,
}

impl Problem<'_> {
    /// The start's, or an even volume of the image's light.
    pub(super) fn first_strengths(&self) -> Vec<f32> {
        let Some(start) = self.start else { return vec![self.even; self.indices.len()] };
        let in_units = |intensity: f32| ((f64::from(intensity) / self.unit) as f32).clamp(0.0, GREATEST_STRENGTH);
        let dim = DIM * start.intensity.iter().fold(0f32, |peak, value| peak.max(in_units(*value)));
        let mut known = start.indices.iter().zip(start.intensity).peekable();
        let first = |index: &u64| {
            while known.next_if(|(place, _)| *place < index).is_some() {}
            known.next_if(|(place, _)| *place == index).map_or(dim, |(_, intensity)| in_units(*intensity).max(dim))
        };
        self.indices.iter().map(first).collect()
    }

    /// Whether the sweeps so far are enough; `misfit` is the last one's.
    pub(super) fn is_done(&self, sweeps: &[Sweep], misfit: &Misfit) -> bool {
        let Some(last) = sweeps.last() else { return false };
        match self.options.until {
            Until::Never => false,
            Until::Stall => stalls(sweeps),
            Until::Misfit(wanted) => last.misfit <= wanted,
            Until::Noise(sigma) => {
                let of_noise = sigma / self.unit * (misfit.pixels as f64).sqrt() / misfit.light.sqrt();
                last.misfit <= of_noise || stalls(sweeps)
            }
        }
    }
}

pub(crate) struct Solved {
    /// Rising indices of the voxels still held to have light.
    pub(crate) indices: Vec<u64>,
    /// Strength of each, in units of the brightest pixel.
    pub(crate) strengths: Vec<f32>,
    pub(crate) sweeps: Vec<Sweep>,
    /// Rising indices of the voxels that no pixel sees.
    pub(crate) unseen: Vec<u64>,
}

/// Squares of the residual and of the image, over the pixels that the support reaches.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Misfit {
    residual: f64,
    light: f64,
    pixels: usize,
}

impl Misfit {
    #[inline(always)]
    pub(super) fn add_pixel(&mut self, measured: f32, projected: f32) {
        self.residual += f64::from(measured - projected).powi(2);
        self.light += f64::from(measured).powi(2);
        self.pixels += 1;
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.residual += other.residual;
        self.light += other.light;
        self.pixels += other.pixels;
    }

    /// `|image - projection| / |image|`.
    pub(super) fn value(&self) -> f64 {
        if self.light > 0.0 { (self.residual / self.light).sqrt() } else { 0.0 }
    }
}

/// Sum of the absolute changes over the sum.
pub(super) fn change(before: &[f32], after: &[f32]) -> f64 {
    let (mut moved, mut all) = (0f64, 0f64);
    for (before, after) in before.iter().zip(after) {
        moved += f64::from(after - before).abs();
        all += f64::from(*after);
    }
    if all > 0.0 { moved / all } else { 0.0 }
}
