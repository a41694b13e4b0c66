//! Sums over sections for many lenslets at once, and the way back: the inner loops of pruning and of sweeps.

use super::plan::{LANES, LEAST};
use super::walk::Walk;
use crate::simd;

/// The contents of a view: whole-number shades, whose sums may wrap on the way, or light.
pub trait Addend: Copy {
    /// Its sum over sections.
    type Sum: Copy + Default;
    /// A sum with `self` in the place of `old`.
    fn instead(self, old: Self, sum: Self::Sum) -> Self::Sum;
    /// A sum with `self`.
    fn added(self, sum: Self::Sum) -> Self::Sum;
}

impl Addend for u8 {
    type Sum = u16;

    #[inline(always)]
    fn instead(self, old: Self, sum: u16) -> u16 {
        sum.wrapping_add(u16::from(self)).wrapping_sub(u16::from(old))
    }

    #[inline(always)]
    fn added(self, sum: u16) -> u16 {
        sum.wrapping_add(u16::from(self))
    }
}

impl Addend for f32 {
    type Sum = f32;

    #[inline(always)]
    fn instead(self, old: Self, sum: f32) -> f32 {
        sum + (self - old)
    }

    #[inline(always)]
    fn added(self, sum: f32) -> f32 {
        sum + self
    }
}

/// The first lane and the number of lanes that are worked on, such that they hold those from `least` to `most`.
fn rounded_out([least, most]: [usize; 2]) -> (usize, usize) {
    let start = least / LEAST * LEAST;
    let count = (most + 1 - start).next_power_of_two().max(LEAST);
    (start.min(LANES - count), count)
}

/// Adds up `views` for the voxels of lenslets at every place of the raster, `[place][lane]`. It covers the lanes from
/// `least` to `most`, rounded out to multiples of [`LEAST`] or more. `first` is the place of the first lane's lenslet
/// in the first view. Final sums of shades fit 16 bits; partial sums may wrap.
pub fn add_up<T: Addend>(walk: &Walk, views: &[T], first: usize, lanes: [usize; 2], sums: &mut [T::Sum]) {
    let (start, count) = rounded_out(lanes);
    let (first, sums) = (first + start, &mut sums[start..]);
    simd::fastest(
        #[inline(always)]
        || match count {
            LEAST => add_lanes::<T, LEAST>(walk, views, first, sums),
            32 => add_lanes::<T, 32>(walk, views, first, sums),
            _ => add_lanes::<T, LANES>(walk, views, first, sums),
        },
    );
}

/// Adds the light of voxels, `[place][lane]`, to each view that their rays meet: the transpose of [`add_up`]. Light of
/// lanes outside `least` to `most` must be 0.
pub fn spread(walk: &Walk, light: &[f32], first: usize, lanes: [usize; 2], views: &mut [f32]) {
    let (start, count) = rounded_out(lanes);
    let (first, light) = (first + start, &light[start..]);
    simd::fastest(
        #[inline(always)]
        || match count {
            LEAST => spread_lanes::<LEAST>(walk, light, first, views),
            32 => spread_lanes::<32>(walk, light, first, views),
            _ => spread_lanes::<LANES>(walk, light, first, views),
        },
    );
}

#[inline(always)]
fn add_lanes<T: Addend, const COUNT: usize>(walk: &Walk, views: &[T], first: usize, sums: &mut [T::Sum]) {
    let lanes = |place: i32| -> &[T; COUNT] {
        let place = first.wrapping_add_signed(place as isize);
        views[place..].first_chunk().expect("views reach beyond the lenslets of all rays")
    };
    let mut sum = [T::Sum::default(); COUNT];
    for place in &walk.start {
        let new = lanes(*place);
        for lane in 0..COUNT {
            sum[lane] = new[lane].added(sum[lane]);
        }
    }
    let mut done = 0;
    for step in &walk.steps {
        for [new, old] in &walk.changes[done..step.end as usize] {
            let (new, old) = (lanes(*new), lanes(*old));
            for lane in 0..COUNT {
                sum[lane] = new[lane].instead(old[lane], sum[lane]);
            }
        }
        done = step.end as usize;
        sums[step.place as usize * LANES..][..COUNT].copy_from_slice(&sum);
    }
}

#[inline(always)]
fn spread_lanes<const COUNT: usize>(walk: &Walk, light: &[f32], first: usize, views: &mut [f32]) {
    let mut add = |place: i32, left: &[f32; COUNT], sign: f32| {
        let place = first.wrapping_add_signed(place as isize);
        let view: &mut [f32; COUNT] = views[place..].first_chunk_mut().expect("views reach beyond all lenslets");
        for lane in 0..COUNT {
            view[lane] += sign * left[lane];
        }
    };
    // The light of the places that are left on the walk goes to every view that is entered, and back when it is left.
    let mut left = [0f32; COUNT];
    for step in &walk.steps {
        let here = &light[step.place as usize * LANES..][..COUNT];
        for lane in 0..COUNT {
            left[lane] += here[lane];
        }
    }
    for place in &walk.start {
        add(*place, &left, 1.0);
    }
    let mut done = 0;
    for step in &walk.steps {
        for [new, old] in &walk.changes[done..step.end as usize] {
            add(*new, &left, 1.0);
            add(*old, &left, -1.0);
        }
        done = step.end as usize;
        let here = &light[step.place as usize * LANES..][..COUNT];
        for lane in 0..COUNT {
            left[lane] -= here[lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::views::walk::RasterStep;

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
                LEAST => add_lanes::<u8, LEAST>(&walk, &views, 100 + start, &mut portable[start..]),
                32 => add_lanes::<u8, 32>(&walk, &views, 100 + start, &mut portable[start..]),
                _ => add_lanes::<u8, LANES>(&walk, &views, 100 + start, &mut portable[start..]),
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

    /// Light spread over views, against a plain loop over every place of the walk and its views.
    #[test]
    fn light_is_spread_as_by_a_plain_loop() {
        let mut random = 1u32;
        let mut below = |most: u32| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) % most
        };
        for case in 0..100 {
            let mut current: Vec<i32> = (0..20).map(|section| section * 100 + below(30) as i32).collect();
            let mut walk = Walk { reach: 3, start: current.clone(), steps: Vec::new(), changes: Vec::new() };
            let [one, other] = [below(LANES as u32), below(LANES as u32)].map(|lane| lane as usize);
            let [least, most] = [one.min(other), one.max(other)];
            let (mut light, mut wanted) = (vec![0f32; 5 * LANES], vec![0f32; 2200]);
            for place in 0..5 {
                for _ in 0..if place > 0 { below(6) } else { 0 } {
                    let section = below(20) as usize;
                    let new = section as i32 * 100 + below(30) as i32;
                    walk.changes.push([new, std::mem::replace(&mut current[section], new)]);
                }
                walk.steps.push(RasterStep { place, end: walk.changes.len() as u32 });
                for lane in least..=most {
                    let value = below(1000) as f32;
                    light[place as usize * LANES + lane] = value;
                    current.iter().for_each(|view| wanted[100 + *view as usize + lane] += value);
                }
            }
            let mut views = vec![0f32; 2200];
            spread(&walk, &light, 100, [least, most], &mut views);
            // Sums of whole numbers are exact.
            assert!(views == wanted, "{case}: lanes {least} to {most}");
        }
    }
}
