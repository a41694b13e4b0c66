//! Sums over sections for many lenslets at once: the inner loop of pruning.

use super::walk::Walk;
use lf_core::simd;

/// Neighbouring lenslets along i whose sums are made together.
pub(super) const LANES: usize = 64;

/// Sums of `views` for the voxels of [`LANES`] lenslets at every place of the raster, `[place][lane]`. `first` is the
/// place of the first lenslet in a view. Sums fit 16 bits, and wrap in between.
pub(super) fn sums(walk: &Walk, views: &[u8], first: usize, sums: &mut [u16]) {
    simd::fastest(
        #[inline(always)]
        || add_up(walk, views, first, sums),
    );
}

#[inline(always)]
fn add_up(walk: &Walk, views: &[u8], first: usize, sums: &mut [u16]) {
    let lanes = |place: isize| -> &[u8; LANES] {
        let place = first.wrapping_add_signed(place);
        views[place..].first_chunk().expect("views reach beyond the lenslets of all rays")
    };
    let mut sum = [0u16; LANES];
    for place in &walk.start {
        let new = lanes(*place);
        for lane in 0..LANES {
            sum[lane] = sum[lane].wrapping_add(u16::from(new[lane]));
        }
    }
    let mut done = 0;
    for step in &walk.steps {
        for [new, old] in &walk.changes[done..step.end as usize] {
            let (new, old) = (lanes(*new), lanes(*old));
            for lane in 0..LANES {
                sum[lane] = sum[lane].wrapping_add(u16::from(new[lane])).wrapping_sub(u16::from(old[lane]));
            }
        }
        done = step.end as usize;
        sums[step.place as usize * LANES..][..LANES].copy_from_slice(&sum);
    }
}
