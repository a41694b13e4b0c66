//! Tables of a lenslet's image of a voxel: the light of each pixel, for every place of the image among the pixels.
//!
//! If rays are straight, a step in U moves a ray on the array and on the sensor in proportion: from one pixel edge to
//! the next the ray moves by `step` mm on the array. So a lenslet's image of a voxel is the cell, blurred by the
//! voxel's width, at a scale of one pixel to `step`, and cut where the stop ends. From lenslet to lenslet only its
//! place among the pixels differs: two fractions of a pixel.

use crate::weights::{axis::Span, blur::Blur, cell::Slab};

/// Maximum number of phases of a pixel along an axis; with it, places are right to 1/128 px.
const MAX_PHASES: usize = 64;
/// Maximum number of shares in the patches of a slice, 256 KiB: larger tables get fewer phases. Patches are larger
/// nearer focus, where the steps on the array are smaller in proportion.
const MAX_SHARES: usize = 1 << 16;
/// Bytes of a slice's patches, except nearest focus.
pub(super) const SLICE_BYTES: usize = MAX_SHARES * size_of::<f32>();
/// A row of shares is padded to a multiple of this.
pub(super) const LANES: usize = 4;
/// Shares below this fraction of the largest possible are 0.
const LEAST: f64 = 1e-6;

#[derive(Debug, Clone)]
pub(super) struct LensletPatches {
    /// Phases of a pixel along an axis, and their logarithm to base 2.
    per_px: f64,
    bits: u32,
    /// Half the side of the footprint, px: a patch begins at the pixel this far before its middle.
    half_px: f64,
    /// Rows and columns of a patch; columns are a multiple of [`LANES`].
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Integrals over pixels of the blurred cell, mm^2 of the array: phases down, phases across, rows, columns.
    shares: Vec<f32>,
}

impl LensletPatches {
    /// The patches of a cell in slabs, at `step_mm` a pixel, for a voxel that blurs by `blurs` along x and y.
    pub(super) fn new(slabs: &[Slab], blurs: [Blur; 2], step_mm: f64) -> Self {
        // A square around the blurred cell.
        let spans = slabs.iter().flat_map(|slab| [0, 1].map(|along| slab.span(along, blurs)));
        let reaches = spans.map(|span| span.low.abs().max(span.high.abs()) + span.blur.reach());
        let half_px = reaches.fold(0.0, f64::max) / step_mm;
        let rows = (2.0 * half_px + 1.0).ceil() as usize;
        let columns = rows.next_multiple_of(LANES);
        let mut phases = MAX_PHASES;
        while phases > 1 && phases * phases * rows * columns > MAX_SHARES {
            phases /= 2;
        }
        // Integrate along each axis, for every phase and slab.
        let profile = |phase: usize, pixels: usize, span: Span| -> Vec<f64> {
            let middle = half_px + (phase as f64 + 0.5) / phases as f64;
            let ramp = |pixel: usize| span.ramp((pixel as f64 - middle) * step_mm);
            (0..pixels).map(|pixel| ramp(pixel + 1) - ramp(pixel)).collect()
        };
        let profiles = |pixels: usize, along: usize| -> Vec<Vec<Vec<f64>>> {
            let spans = slabs.iter().map(|slab| slab.span(along, blurs));
            (0..phases).map(|phase| spans.clone().map(|span| profile(phase, pixels, span)).collect()).collect()
        };
        let (across, down) = (profiles(columns, 0), profiles(rows, 1));
        // Multiply, and add the slabs.
        let cell: f64 = slabs.iter().map(|slab| (slab.x[1] - slab.x[0]) * (slab.y[1] - slab.y[0])).sum();
        let most = cell.min(step_mm * step_mm);
        let (mut shares, mut sums) = (vec![0f32; phases * phases * rows * columns], vec![0f64; columns]);
        shares.chunks_mut(rows * columns).enumerate().for_each(|(n, patch)| {
            let (down, across) = (&down[n / phases], &across[n % phases]);
            for (row, shares) in patch.chunks_mut(columns).enumerate() {
                sums.fill(0.0);
                // A row meets few of the slabs.
                for (down, across) in down.iter().zip(across).filter(|(down, _)| down[row] != 0.0) {
                    sums.iter_mut().zip(across).for_each(|(sum, across)| *sum += down[row] * across);
                }
                for (share, sum) in shares.iter_mut().zip(&sums) {
                    *share = if *sum > LEAST * most { *sum as f32 } else { 0.0 };
                }
            }
        });
        Self { bits: phases.ilog2(), per_px: phases as f64, half_px, rows, columns, shares }
    }

    /// The first pixel of the patch about a place, and the patch's phase there. The place is 2^24 px at most.
    #[inline(always)]
    pub(super) fn split(&self, place_px: f64) -> (i32, usize) {
        // Added to a number, it leaves the nearest whole number in the low bits; half a step less gives the one below.
        const WHOLE: f64 = 6_755_399_441_055_744.0;
        let steps = ((place_px - self.half_px) * self.per_px - 0.5 + WHOLE).to_bits() as i32;
        (steps >> self.bits, (steps & ((1 << self.bits) - 1)) as usize)
    }

    /// The patch of these phases.
    #[inline(always)]
    pub(super) fn at(&self, across: usize, down: usize) -> &[f32] {
        let size = self.rows * self.columns;
        &self.shares[((down << self.bits) + across) * size..][..size]
    }
}
