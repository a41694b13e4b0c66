//! The light of a voxel under one lenslet, integrated over pixels once for every place that it can have among them.
//!
//! Where rays are straight, U moves a ray over the array and over the sensor in proportion: between one pixel's edge and
//! the next the array passes by `step` mm. A lenslet's image of a voxel is then its cell, blurred as the voxel is wide,
//! drawn in the scale of one pixel to `step`, and cut where the stop ends. Only its place among the pixels differs from
//! lenslet to lenslet, and two numbers tell it: the fractions of a pixel by which its middle lies off.

use super::axis::Span;
use super::blur::Blur;
use super::cell::Slab;

/// Fractions of a pixel along each axis that are told apart, at most: a place is right to 1/128 px.
const MOST_PHASES: usize = 64;
/// Shares that the patches of a slice take, at most, while there are phases to save: 256 KiB. Larger patches belong to
/// slices nearer focus, whose steps on the array are smaller in proportion.
const ROOM: usize = 1 << 16;
/// Bytes of a slice's patches, but for those nearest focus.
pub(super) const SLICE_BYTES: usize = ROOM * size_of::<f32>();
/// Parts of what a voxel lights of the array that a step is at least: nearer focus than that is focus.
const LEAST_STEP: f64 = 1.0 / 1536.0;
/// The largest step in such sizes: a voxel's image is then a point.
const LARGEST_STEP: f64 = 1e6;
/// Lanes that a row of shares is padded to.
pub(super) const LANES: usize = 4;
/// A share of what a pixel can have below this is none.
const LEAST: f64 = 1e-6;

/// A step that patches are made for, from the true one, mm a pixel.
pub(super) fn step_mm(step_mm: f64, size_mm: f64) -> f64 {
    step_mm.abs().clamp(LEAST_STEP * size_mm, LARGEST_STEP * size_mm)
}

/// All patches of a slice.
#[derive(Debug, Clone)]
pub(super) struct Patches {
    /// Phases of a pixel along an axis: 2 to this power, and as a factor.
    bits: u32,
    per_px: f64,
    /// Half the side of what is lit, px: a patch begins at the pixel so far before its middle.
    half_px: f64,
    /// Rows of a patch.
    pub(super) rows: usize,
    /// Columns of a patch, a multiple of [`LANES`].
    pub(super) columns: usize,
    /// Integrals over pixels of the blurred cell, mm^2 of the array: row by row, patches by phase down and across.
    shares: Vec<f32>,
}

impl Patches {
    /// Of a cell given by its slabs, at `step_mm` a pixel.
    pub(super) fn new(slabs: &[Slab], blurs: [Blur; 2], step_mm: f64) -> Self {
        let side = |edges: fn(&Slab) -> [f64; 2], blur: Blur, slant: fn(&Slab) -> f64| {
            let far = |slab: &Slab| edges(slab)[0].abs().max(edges(slab)[1].abs()) + blur.widened(slant(slab)).reach();
            slabs.iter().map(far).fold(0.0, f64::max)
        };
        let half =
            side(|slab| slab.x, blurs[0], |slab| slab.slant_x).max(side(|slab| slab.y, blurs[1], |slab| slab.slant_y));
        let half_px = half / step_mm;
        let rows = (2.0 * half_px + 1.0).ceil() as usize;
        let columns = rows.next_multiple_of(LANES);
        let mut phases = MOST_PHASES;
        while phases > 1 && phases * phases * rows * columns > ROOM {
            phases /= 2;
        }
        // Shares of a phase's pixels along one axis, for each slab.
        let profile = |phase: usize, pixels: usize, edges: [f64; 2], blur: Blur| -> Vec<f64> {
            let span = Span { low: edges[0], high: edges[1], blur };
            let middle = half_px + (phase as f64 + 0.5) / phases as f64;
            let ramp = |pixel: usize| span.ramp((pixel as f64 - middle) * step_mm);
            (0..pixels).map(|pixel| ramp(pixel + 1) - ramp(pixel)).collect()
        };
        let profiles = |pixels: usize, of: &(dyn Fn(&Slab) -> ([f64; 2], Blur) + Sync)| -> Vec<Vec<Vec<f64>>> {
            let all = |phase| {
                slabs
                    .iter()
                    .map(|slab| {
                        let (edges, blur) = of(slab);
                        profile(phase, pixels, edges, blur)
                    })
                    .collect()
            };
            (0..phases).map(all).collect()
        };
        let across = profiles(columns, &|slab| (slab.x, blurs[0].widened(slab.slant_x)));
        let down = profiles(rows, &|slab| (slab.y, blurs[1].widened(slab.slant_y)));
        let cell: f64 = slabs.iter().map(|slab| (slab.x[1] - slab.x[0]) * (slab.y[1] - slab.y[0])).sum();
        let most = cell.min(step_mm * step_mm);
        let mut shares = vec![0f32; phases * phases * rows * columns];
        shares.chunks_mut(rows * columns).enumerate().for_each(|(n, patch)| {
            let (down, across) = (&down[n / phases], &across[n % phases]);
            for (row, line) in patch.chunks_mut(columns).enumerate() {
                for (column, share) in line.iter_mut().enumerate() {
                    let sum: f64 = down.iter().zip(across).map(|(down, across)| down[row] * across[column]).sum();
                    *share = if sum > LEAST * most { sum as f32 } else { 0.0 };
                }
            }
        });
        Self { bits: phases.ilog2(), per_px: phases as f64, half_px, rows, columns, shares }
    }

    /// The first pixel of the patch about a place, px of at most 2^24, and its phase there.
    #[inline(always)]
    pub(super) fn split(&self, place_px: f64) -> (i32, usize) {
        // The least bits of a number so large are whole ones: rounded to the nearest, so half a step less for the one below.
        const WHOLE: f64 = 6_755_399_441_055_744.0;
        let steps = ((place_px - self.half_px) * self.per_px - 0.5 + WHOLE).to_bits() as i32;
        (steps >> self.bits, (steps & ((1 << self.bits) - 1)) as usize)
    }

    /// The patch of these phases across and down.
    #[inline(always)]
    pub(super) fn at(&self, across: usize, down: usize) -> &[f32] {
        let size = self.rows * self.columns;
        &self.shares[((down << self.bits) + across) * size..][..size]
    }
}
