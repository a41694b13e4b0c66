//! Sums over sections for many lenslets at once: the inner loop of pruning.

use super::views::{LANES, LEAST};
use super::walk::Walk;
use lf_core::simd;

/// Makes sums of `views` for the voxels of lenslets at every place of the raster, `[place][lane]`: of the lanes from
/// `least` to `most`, and those between them and the next multiples of [`LEAST`] or more. `first` is the place of the
/// first lane's lenslet in the first view. Sums fit 16 bits, and wrap in between.
pub(super) fn add_up(walk: &Walk, views: &[u8], first: usize, [least, most]: [usize; 2], sums: &mut [u16]) {
    let start = least / LEAST * LEAST;
    let count = (most + 1 - start).next_power_of_two().max(LEAST);
    let start = start.min(LANES - count);
    let (first, sums) = (first + start, &mut sums[start..]);
    simd::fastest(
        #[inline(always)]
        || match count {
            LEAST => add_lanes::<LEAST>(walk, views, first, sums),
            32 => add_lanes::<32>(walk, views, first, sums),
            _ => add_lanes::<LANES>(walk, views, first, sums),
        },
    );
}

#[inline(always)]
fn add_lanes<const COUNT: usize>(walk: &Walk, views: &[u8], first: usize, sums: &mut [u16]) {
    let lanes = |place: i32| -> &[u8; COUNT] {
        let place = first.wrapping_add_signed(place as isize);
        views[place..].first_chunk().expect("views reach beyond the lenslets of all rays")
    };
    let mut sum = [0u16; COUNT];
    for place in &walk.start {
        let new = lanes(*place);
        for lane in 0..COUNT {
            sum[lane] = sum[lane].wrapping_add(u16::from(new[lane]));
        }
    }
    let mut done = 0;
    for step in &walk.steps {
        for [new, old] in &walk.changes[done..step.end as usize] {
            let (new, old) = (lanes(*new), lanes(*old));
            for lane in 0..COUNT {
                sum[lane] = sum[lane].wrapping_add(u16::from(new[lane])).wrapping_sub(u16::from(old[lane]));
            }
        }
        done = step.end as usize;
        sums[step.place as usize * LANES..][..COUNT].copy_from_slice(&sum);
    }
}
