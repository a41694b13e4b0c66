//! Sums over sections for many lenslets at once: the inner loop of pruning.

use super::views::{LANES, LEAST};
use super::walk::Walk;
use lf_core::simd;

/// Adds up `views` for the voxels of lenslets at every place of the raster, `[place][lane]`. It covers the lanes from
/// `least` to `most`, rounded out to multiples of [`LEAST`] or more. `first` is the place of the first lane's lenslet
/// in the first view. Final sums fit 16 bits; partial sums may wrap.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::walk::RasterStep;

    /// The portable code gives the same sums as this machine's widest instructions.
    #[test]
    fn portable_sums_are_the_same() {
        let views: Vec<u8> = (0..4096u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let places: Vec<i32> = (0..300).map(|n| n * 97 % 3000).collect();
        let changes: Vec<[i32; 2]> = places.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        let steps = (0..8).map(|place| RasterStep { place, end: place * 37 }).collect();
        let walk = Walk { reach: 3, start: places, steps, changes };
        for (lanes, [start, count]) in [([0, 63], [0, LANES]), ([17, 40], [16, 32]), ([50, 50], [48, LEAST])] {
            let (mut wide, mut portable) = (vec![0; 8 * LANES], vec![0; 8 * LANES]);
            add_up(&walk, &views, 100, lanes, &mut wide);
            match count {
                LEAST => add_lanes::<LEAST>(&walk, &views, 100 + start, &mut portable[start..]),
                32 => add_lanes::<32>(&walk, &views, 100 + start, &mut portable[start..]),
                _ => add_lanes::<LANES>(&walk, &views, 100 + start, &mut portable[start..]),
            }
            assert!(wide == portable && wide.iter().any(|sum| *sum > 0), "{lanes:?}");
        }
    }

    /// A plain loop gives the same sums, for any lanes, places and changes.
    #[test]
    fn sums_are_those_of_a_plain_loop() {
        const PLACES: u32 = 5;
        let mut random = 1u32;
        let mut below = |most: u32| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) % most
        };
        for case in 0..300 {
            let views: Vec<u8> = (0..3000).map(|_| below(256) as u8).collect();
            let (one, other) = (below(LANES as u32) as usize, below(LANES as u32) as usize);
            let [least, most] = [one.min(other), one.max(other)];
            let ends: Vec<u32> = (0..PLACES).map(|place| 6 * place + below(6)).collect();
            let steps = (0..PLACES).zip(&ends).map(|(place, end)| RasterStep { place, end: *end }).collect();
            let start: Vec<i32> = (0..below(40)).map(|_| below(2500) as i32).collect();
            let changes: Vec<[i32; 2]> = (0..ends[4]).map(|_| [below(2500) as i32, below(2500) as i32]).collect();
            let walk = Walk { reach: 3, start, steps, changes };
            let mut sums = vec![0; PLACES as usize * LANES];
            add_up(&walk, &views, 100, [least, most], &mut sums);
            for (step, lane) in walk.steps.iter().flat_map(|step| (least..=most).map(move |lane| (step, lane))) {
                let view = |place: &i32| u16::from(views[100 + *place as usize + lane]);
                let begun = walk.start.iter().fold(0u16, |sum, place| sum.wrapping_add(view(place)));
                let changes = &walk.changes[..step.end as usize];
                let wanted =
                    changes.iter().fold(begun, |sum, [new, old]| sum.wrapping_add(view(new)).wrapping_sub(view(old)));
                assert_eq!(
                    sums[step.place as usize * LANES + lane],
                    wanted,
                    "{case}: lane {lane} of {least} to {most}"
                );
            }
        }
    }
}
