use super::*;
use crate::options::Pass;
use crate::pass::{Path, measure};
use crate::shifts::Shifts;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A volume with a share `lit` of its voxels lit at random.
fn volume(seed: u64, shape: [usize; 3], lit: f64) -> Rows {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut voxel = || if random.random::<f64>() < lit { random.random::<f32>() + 0.1 } else { 0.0 };
    let dense: Vec<f32> = (0..shape.iter().product()).map(|_| voxel()).collect();
    Rows::of_dense(shape, &dense)
}

#[test]
fn sparse_light_is_multiplied_and_a_full_volume_transformed() {
    let cost = |lit: f64, overlap: f64, search: [usize; 3]| {
        let shape = [64; 3];
        let lattice = Lattice::new(shape, &Pass { window: [32; 3], overlap, search });
        estimate(&volume(1, shape, lit), &volume(2, shape, lit), &lattice, search)
    };
    let sparse = cost(0.01, 0.75, [4; 3]);
    assert!(sparse.direct_s * 2.0 < sparse.transform_s, "{sparse:?}");
    let full = cost(1.0, 0.0, [12; 3]);
    assert!(full.transform_s * 2.0 < full.direct_s, "{full:?}");
    // More light costs the direct path far more, and transforms little.
    let thin = cost(0.01, 0.0, [12; 3]);
    assert!(thin.direct_s * 10.0 < full.direct_s && thin.transform_s * 10.0 > full.transform_s);
}

#[test]
fn light_is_counted_by_hand() {
    // Windows of 4 voxels, 2 apart, in 8 x 4 x 2 voxels: cells of 2 x 4 x 2. Three voxels in one row, one in another.
    let shape = [8, 4, 2];
    let mut dense = [0.0; 64];
    for [x, y, z] in [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 3, 1]] {
        dense[x + 8 * (y + 4 * z)] = 1.0;
    }
    let rows = Rows::of_dense(shape, &dense);
    let lattice = Lattice::new(shape, &Pass { window: [4, 4, 2], overlap: 0.5, search: [1; 3] });
    let light = Light::count(&rows, &lattice);
    assert_eq!(light.voxels, [3, 1, 0, 0]);
    assert_eq!(light.rows, [2, 1, 0, 0]);
    assert_eq!(light.at(0, [2.0, 4.0, 2.0]).rows(2.0), 0.25);
    assert_eq!(light.total.density, 4.0 / 64.0);
    // Of 5 voxels, pairs at -1, 0 and 1: 4, 5 and 4 of 15.
    assert_eq!(share_inside(5, 1), 13.0 / 15.0);
    assert_eq!([9, 17, 18, 21, 33].map(lanes), [[12.0, 1.0], [20.0, 1.0], [20.0, 1.0], [16.0, 2.0], [16.0, 3.0]]);
}

/// Prints what the constants are made from: the work and the seconds of passes of many kinds, on one core.
#[test]
#[ignore = "a measurement of minutes: cargo test --release -p lf-xcorr --lib cost -- --ignored --nocapture"]
fn table() {
    let longest_s: f64 = std::env::var("LONGEST_S").map_or(6.0, |text| text.parse().unwrap());
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    println!("window,overlap,radius,lit,windows,direct_s,transform_s,predicted_direct_s,predicted_transform_s,work");
    for (window, overlap, side) in
        [(16, 0.75, 36), (16, 0.0, 48), (32, 0.75, 64), (32, 0.0, 64), (64, 0.75, 96), (64, 0.0, 128)]
    {
        for radius in [4, 8, 16] {
            let mut last = [0.0; 2];
            for lit in [0.001, 0.01, 0.1, 1.0] {
                let shape = [side; 3];
                let (a, b) = (volume(1, shape, lit), volume(2, shape, lit));
                let pass = Pass { window: [window; 3], overlap, search: [radius; 3] };
                let lattice = Lattice::new(shape, &pass);
                let search = vec![Some(Shifts::around([0; 3], pass.search)); lattice.count()];
                let search_n = pass.search.map(|radius| 2 * radius + 1);
                let cost = estimate(&a, &b, &lattice, pass.search);
                let work = Work::count(&a, &b, &lattice, pass.search);
                let run = |path: usize| {
                    one.install(|| {
                        // The clock ticks every few milliseconds.
                        let (start_s, mut runs) = (busy_s(), 0);
                        while runs == 0 || busy_s() - start_s < 0.1 {
                            let path = match path {
                                0 => Path::Direct,
                                _ => Path::Transform(Plan::new(pass.window, search_n)),
                            };
                            std::hint::black_box(measure(&[[&a, &b]], &lattice, &search, &path, &|_| ()));
                            runs += 1;
                        }
                        (busy_s() - start_s) / runs as f64
                    })
                };
                for path in 0..2 {
                    // Ten times the light is up to a hundred times the work.
                    let factor = if path == 0 { 30.0 } else { 1.2 };
                    last[path] = if last[path] * factor > longest_s * 5.0 { f64::INFINITY } else { run(path) };
                }
                println!(
                    "{window},{overlap},{radius},{lit},{},{},{},{},{},{:?} {:?}",
                    lattice.count(),
                    last[0],
                    last[1],
                    cost.direct_s,
                    cost.transform_s,
                    work.direct,
                    work.transform
                );
            }
        }
    }
}

/// Seconds that this thread has had a core to itself (Linux alone tells).
fn busy_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("a Linux machine");
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).expect("nanoseconds come first") * 1e-9
}
