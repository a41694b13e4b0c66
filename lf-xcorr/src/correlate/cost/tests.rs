use super::*;
use crate::correlate::oracle;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// A volume with a share `lit` of its voxels lit at random.
fn volume(seed: u64, shape: [usize; 3], lit: f64) -> Rows {
    let dense = oracle::volume(&mut Pcg64Mcg::seed_from_u64(seed), shape, lit);
    Rows::of_dense(shape, &dense)
}

#[test]
fn sparse_light_is_multiplied_and_a_full_volume_transformed() {
    let cost = |lit: f64, step: usize, search: [usize; 3]| {
        let shape = [64; 3];
        let windows = WindowGrid::new(shape, [32; 3], [step; 3]);
        let [a, b] = [1, 2].map(|seed| volume(seed, shape, lit));
        let estimate = Estimate::new([&a, &b], &windows);
        [estimate.direct_s(search), estimate.transform_s(search)]
    };
    let sparse = cost(0.01, 8, [4; 3]);
    assert!(sparse[0] * 2.0 < sparse[1], "{sparse:?}");
    let full = cost(1.0, 32, [12; 3]);
    assert!(full[1] * 2.0 < full[0], "{full:?}");
    // More light costs direct sums far more, and transforms little.
    let thin = cost(0.01, 32, [12; 3]);
    assert!(thin[0] * 10.0 < full[0] && thin[1] * 10.0 > full[1]);
}

#[test]
fn light_is_counted_by_hand() {
    // Windows of 4 x 4 x 2 voxels, 2 apart along x, in 8 x 4 x 2 voxels: cells of 2 x 4 x 2. Three lit voxels are in
    // one row, one is in another.
    let shape = [8, 4, 2];
    let mut dense = [0.0; 64];
    for [x, y, z] in [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 3, 1]] {
        dense[x + 8 * (y + 4 * z)] = 1.0;
    }
    let rows = Rows::of_dense(shape, &dense);
    let windows = WindowGrid::new(shape, [4, 4, 2], [2, 2, 1]);
    let light = CellLight::count(&rows, &windows);
    assert_eq!(light.voxels, [3, 1, 0, 0]);
    assert_eq!(light.rows, [2, 1, 0, 0]);
    assert_eq!(light.of_cell(0, [2.0, 4.0, 2.0]).lit(2.0), 0.25);
    assert_eq!(light.total.density, 4.0 / 64.0);
    // Five voxels make 4, 5 and 4 pairs inside at the shifts -1, 0 and 1, of 15.
    assert_eq!(share_inside(5, 1), 13.0 / 15.0);
    assert_eq!([9, 17, 18, 21, 33].map(lanes), [[12.0, 1.0], [20.0, 1.0], [20.0, 1.0], [16.0, 2.0], [16.0, 3.0]]);
}
