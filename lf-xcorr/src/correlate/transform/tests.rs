use super::*;
use crate::correlate::oracle::{self, volume};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// The sums by the definition. The first volume's window is moved once, by the centre of the box.
fn oracle(dense: [&[f32]; 2], shape: [usize; 3], window: &[Range<usize>; 3], shifts: Shifts) -> Sums {
    let moved = [0, 1, 2].map(|a| back((shifts.low[a] + shifts.high(a)) >> 1));
    oracle::sums(dense, shape, window, shifts, |midpoint, d| {
        let from: [i32; 3] = std::array::from_fn(|a| midpoint[a] - moved[a]);
        [from, std::array::from_fn(|a| from[a] + d[a])]
    })
}

#[test]
fn the_oracle_agrees_with_a_case_solved_by_hand() {
    // A row of 7 voxels: intensity 2 at voxel 2, then 3 at voxel 4. The box is centred on 1: the first window is not
    // moved.
    let (mut a, mut b) = ([0f32; 7], [0f32; 7]);
    (a[2], b[4]) = (2.0, 3.0);
    let shifts = Shifts { low: [-1, 0, 0], n: [5, 1, 1] };
    let sums = oracle([&a, &b], [7, 1, 1], &[2..5, 0..1, 0..1], shifts);
    assert_eq!(sums.channel(channel::PRODUCT), [0.0, 0.0, 0.0, 6.0, 0.0]);
    assert_eq!(sums.channel(channel::FIRST), [2.0; 5]);
    // Voxels 2 to 4 meet 1 to 3 at shift -1, and 5 to 7 at shift 3, where 7 is outside; they meet voxel 4 in between.
    assert_eq!(sums.channel(channel::SECOND), [0.0, 3.0, 3.0, 3.0, 0.0]);
    // At shift 3, voxel 4 has no partner: a first volume that is lit only there counts as dark.
    let mut a = [0f32; 7];
    a[4] = 2.0;
    let sums = oracle([&a, &b], [7, 1, 1], &[2..5, 0..1, 0..1], shifts);
    assert_eq!(sums.channel(channel::FIRST_SQUARED), [4.0, 4.0, 4.0, 4.0, 0.0]);
    // In a box centred on 2 or 3 the first window is moved back by 1.
    let sums = oracle([&a, &b], [7, 1, 1], &[2..5, 0..1, 0..1], Shifts { low: [1, 0, 0], n: [3, 1, 1] });
    assert_eq!(sums.channel(channel::FIRST), [0.0; 3]);
}

#[test]
fn transforms_give_the_oracles_sums() {
    let mut random = Pcg64Mcg::seed_from_u64(11);
    let mut scratch = TransformScratch::default();
    for (shape, window, n_shifts, lit) in [
        ([16, 14, 12], [8, 8, 8], [9, 9, 7], 0.02),
        ([16, 14, 12], [8, 8, 8], [9, 9, 7], 1.0),
        ([23, 17, 11], [9, 7, 5], [5, 11, 3], 0.3),
        ([23, 17, 11], [23, 17, 11], [4, 6, 7], 0.05),
        ([30, 12, 1], [13, 5, 1], [9, 7, 3], 0.5),
        ([1, 9, 20], [1, 3, 11], [3, 5, 9], 0.7),
        ([19, 1, 1], [7, 1, 1], [8, 1, 1], 0.4),
    ] {
        let transforms = Transforms::new(window, n_shifts);
        for trial in 0..8 {
            let (a, b) = (volume(&mut random, shape, lit), volume(&mut random, shape, lit));
            // The first two windows stand in the corners, the others anywhere.
            let window: [Range<usize>; 3] = std::array::from_fn(|axis| {
                let last = shape[axis] - window[axis];
                let start = [0, last].get(trial).copied().unwrap_or_else(|| random.random_range(0..last + 1));
                start..start + window[axis]
            });
            let low = std::array::from_fn(|axis| {
                random.random_range(-6..5) - if trial < 4 { n_shifts[axis] as i32 / 2 } else { 0 }
            });
            let shifts = Shifts { low, n: n_shifts };
            let rows = [&a, &b].map(|dense| Rows::of_dense(shape, dense));
            let found = transforms.sums(rows.each_ref(), &window, shifts, &mut scratch);
            oracle::assert_close(&found, &oracle([&a, &b], shape, &window, shifts), |largest| 1e-9 * largest);
        }
    }
}

#[test]
fn dark_stays_dark() {
    let shape = [40, 24, 24];
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let (a, mut b) = (volume(&mut random, shape, 0.5), volume(&mut random, shape, 0.5));
    // Light up to x = 19: a window from 20 on meets it at negative shifts only.
    b.iter_mut().enumerate().filter(|(i, _)| i % shape[0] >= 20).for_each(|(_, value)| *value = 0.0);
    let shifts = Shifts::around([0; 3], [4, 4, 4]);
    let window = [20..36, 4..20, 4..20];
    let (a, b) = (Rows::of_dense(shape, &a), Rows::of_dense(shape, &b));
    let transforms = Transforms::new([16; 3], shifts.n);
    let sums = transforms.sums([&a, &b], &window, shifts, &mut TransformScratch::default());
    for (k, &product) in sums.channel(channel::PRODUCT).iter().enumerate() {
        let meets = shifts.low[0] + ((k % shifts.n[0]) as i32) < 0;
        assert_eq!(product > 0.0, meets, "shift {k}: {product}");
    }
    // If either volume is dark, every product is 0.
    let dark = Rows::of_dense(shape, &[0.0; 40 * 24 * 24]);
    for (a, b) in [(&a, &dark), (&dark, &b)] {
        let sums = transforms.sums([a, b], &window, shifts, &mut TransformScratch::default());
        assert!(sums.channel(channel::PRODUCT).iter().all(|&product| product == 0.0));
    }
}

#[test]
fn at_the_centre_of_the_box_transforms_pair_as_direct_sums_do() {
    use crate::correlate::kernel::{self, CellProducts};
    let shape = [30, 22, 14];
    let mut random = Pcg64Mcg::seed_from_u64(8);
    let (a, b) = (volume(&mut random, shape, 0.2), volume(&mut random, shape, 0.2));
    let (a, b) = (Rows::of_dense(shape, &a), Rows::of_dense(shape, &b));
    let window = [8..20, 0..12, 2..14];
    for centre in [[0, 0, 0], [3, -3, 1], [-5, 4, -2]] {
        let shifts = Shifts::around(centre, [2, 1, 3]);
        let sums = Transforms::new([12; 3], shifts.n).sums([&a, &b], &window, shifts, &mut TransformScratch::default());
        let mut direct = vec![0.0; shifts.len()];
        let cell = CellProducts { first: &a, second: &b, midpoints: &window, shifts: &shifts };
        kernel::products(cell, &mut direct, &mut kernel::ProductScratch::default());
        let k = shifts.len() / 2;
        assert!((sums.channel(channel::PRODUCT)[k] - direct[k]).abs() < 1e-9 * direct[k]);
    }
}

#[test]
fn lengths_have_small_factors_and_hold_window_and_search() {
    assert_eq!([1, 7, 11, 31, 49, 96, 97].map(|n| smooth_length(n, 1)), [1, 8, 12, 32, 50, 96, 100]);
    assert_eq!([1, 7, 15, 31, 45].map(|n| smooth_length(n, 2)), [2, 8, 16, 32, 48]);
    let transforms = Transforms::new([32, 9, 1], [9, 5, 3]);
    assert_eq!(transforms.size, [40, 15, 3]);
}
