//! References for tests: sums by their definition, and volumes lit at random.

use super::shifts::Shifts;
use super::sums::{Sums, channel};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use std::ops::Range;

/// The sums of a window by the definition: every midpoint, every shift, dense volumes. `pair` returns the voxels of the
/// first and the second volume that a midpoint and a shift stand for.
pub(crate) fn sums(
    dense: [&[f32]; 2],
    shape: [usize; 3],
    window: &[Range<usize>; 3],
    shifts: Shifts,
    pair: impl Fn([i32; 3], [i32; 3]) -> [[i32; 3]; 2],
) -> Sums {
    let inside = |p: [i32; 3]| (0..3).all(|a| p[a] >= 0 && p[a] < shape[a] as i32);
    let at = |volume: usize, p: [i32; 3]| {
        dense[volume][p[0] as usize + shape[0] * (p[1] as usize + shape[1] * p[2] as usize)] as f64
    };
    let mut sums = Sums { shifts, data: vec![0.0; channel::COUNT * shifts.len()] };
    for k in 0..shifts.len() {
        let place = shifts.place(k);
        let d: [i32; 3] = std::array::from_fn(|a| shifts.low[a] + place[a] as i32);
        for z in window[2].clone() {
            for y in window[1].clone() {
                for x in window[0].clone() {
                    let [from, to] = pair([x as i32, y as i32, z as i32], d);
                    if inside(from) && inside(to) {
                        let (a, b) = (at(0, from), at(1, to));
                        for (channel, value) in [a * b, a, a * a, b, b * b].into_iter().enumerate() {
                            sums.data[channel * shifts.len() + k] += value;
                        }
                    }
                }
            }
        }
    }
    sums
}

/// Asserts that sums agree within `tolerance` of the largest sum of their channel.
pub(crate) fn assert_close(found: &Sums, wanted: &Sums, tolerance: impl Fn(f64) -> f64) {
    for c in 0..channel::COUNT {
        let [found, wanted] = [found, wanted].map(|sums| sums.channel(c));
        let tolerance = tolerance(wanted.iter().fold(0.0, |largest: f64, &sum| largest.max(sum)));
        for (k, (found, wanted)) in found.iter().zip(wanted).enumerate() {
            assert!((found - wanted).abs() <= tolerance, "channel {c} shift {k}: {found} for {wanted}");
        }
    }
}

/// A dense volume with a fraction `lit` of its voxels lit.
pub(crate) fn volume(random: &mut Pcg64Mcg, shape: [usize; 3], lit: f64) -> Vec<f32> {
    let mut voxel = || if random.random::<f64>() < lit { random.random::<f32>() } else { 0.0 };
    (0..shape.iter().product()).map(|_| voxel()).collect()
}
