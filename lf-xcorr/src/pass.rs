//! One pass: the sums of every cell, shared by the windows that overlap there, and the peak of every window.
//!
//! Memory: the cells of one layer of windows at a time, never the whole lattice.

use crate::cost::Estimate;
use crate::energy;
use crate::kernel;
use crate::lattice::Lattice;
use crate::mask::Mask;
use crate::options::Pass;
use crate::overlap::{Which, voxels};
use crate::peak::{self, Peak};
use crate::score::Room;
use crate::shifts::{Pool, Shifts, Sums, channel};
use crate::sparse::{Rows, Sparse};
use crate::transform::{self, Plan};
use rayon::prelude::*;
use std::ops::Range;

/// How the sums of a window are found.
pub(crate) enum Path {
    /// Cell by cell, products of lit voxels.
    Direct,
    /// Window by window, by transforms; the boxes of shifts are of the planned size.
    Transform(Plan),
}

/// Finds the peak of every node that has a box of shifts to search; the others get `None`. The score is that of all `pairs`
/// together.
///
/// In a dark volume what is outside counts as dark, so that a shift by whole voxels stays exact. In a `full` one, with light
/// everywhere, that would be an edge that both windows share, and outside does not count.
pub(crate) fn measure(
    pairs: &[[&Rows; 2]],
    lattice: &Lattice,
    search: &[Option<Shifts>],
    path: &Path,
    full: bool,
    watch: &(dyn Fn(u64) + Sync),
) -> Vec<Option<Peak>> {
    let shape = pairs[0][0].shape;
    let found = |sums: &[Sums], room: Room| {
        let peak = peak::find(sums, &room);
        watch(1);
        peak
    };
    let whole = |shifts: &Shifts| Room::of(std::array::from_fn(|a| vec![lattice.axes[a].window as f64; shifts.n[a]]));
    match path {
        Path::Direct => windows(pairs, lattice, search, |node, sums| {
            let shifts = &sums[0].shifts;
            found(sums, if full { Room::new(&lattice.window(node), shape, shifts) } else { whole(shifts) })
        }),
        Path::Transform(plan) => {
            let one = |scratch: &mut transform::Scratch, node: usize| {
                let (shifts, window) = (search[node]?, lattice.window(node));
                let sums = pairs.iter().map(|[first, second]| plan.sums(first, second, &window, shifts, scratch));
                let sums: Vec<Sums> = sums.collect();
                Some(found(&sums, if full { plan.room(&window, shape, &shifts) } else { whole(&shifts) }))
            };
            (0..lattice.count()).into_par_iter().map_init(Default::default, one).collect()
        }
    }
}

/// One pass about zero, by products or by transforms, for benches: how many peaks it found inside the search, and the
/// seconds that either path was estimated to take.
#[doc(hidden)]
pub fn one_pass(volumes: [&Sparse; 2], pass: &Pass, transform: bool) -> (usize, [f64; 2]) {
    let rows = volumes.map(|volume| Rows::new(volume, &Mask::Everything, 0.0));
    let lattice = Lattice::new(rows[0].shape, pass);
    let shifts = Shifts::around([0; 3], pass.search);
    let search = vec![Some(shifts); lattice.count()];
    let path = if transform { Path::Transform(Plan::new(pass.window, shifts.n)) } else { Path::Direct };
    let peaks = measure(&[rows.each_ref()], &lattice, &search, &path, false, &|_| ());
    let inside = peaks.iter().filter(|peak| matches!(peak, Some(Peak::Inside(_)))).count();
    let estimate = Estimate::new(rows.each_ref(), &lattice);
    (inside, [estimate.direct_s(pass.search), estimate.transform_s(pass.search)])
}

/// Calls `each(node, sums)` for every node that has a box of shifts, and gives the answers in the order of the nodes; `sums`
/// are those of each pair.
fn windows<T: Send>(
    pairs: &[[&Rows; 2]],
    lattice: &Lattice,
    search: &[Option<Shifts>],
    each: impl Fn(usize, &[Sums]) -> T + Sync,
) -> Vec<Option<T>> {
    let [nx, ny, nz] = lattice.shape();
    let [x, y, z] = &lattice.axes;
    let mut cells: Vec<Vec<Vec<Option<Sums>>>> = vec![vec![Vec::new(); z.cells.len()]; pairs.len()];
    let mut answers = Vec::with_capacity(lattice.count());
    let (mut ready, pool) = (0, Pool::default());
    for k in 0..nz {
        let boxes = |i: Range<usize>, j: Range<usize>| {
            Shifts::hull_of(
                j.flat_map(|j| i.clone().map(move |i| [i, j, k])).filter_map(|node| search[lattice.index(node)]),
            )
        };
        let rows: Vec<Vec<Option<Sums>>> = cells
            .iter_mut()
            .zip(pairs)
            .map(|(cells, pair)| {
                // Let go of the layers of cells behind this layer of windows, and sum the new ones.
                for layer in &mut cells[..z.spans[k].start] {
                    pool.take_back(std::mem::take(layer).into_iter().flatten());
                }
                for layer in ready.max(z.spans[k].start)..z.spans[k].end {
                    cells[layer] = cell_layer(pair, lattice, search, layer, &pool);
                }

                // Add cells into columns of this layer's depth, columns into rows.
                let layers = &cells[z.spans[k].clone()];
                let columns = gather(x.cells.len(), y.cells.len(), |cx, cy| {
                    let parts = layers.iter().filter_map(|layer| layer[cx + x.cells.len() * cy].as_ref());
                    Some(pool.total(boxes(x.users[cx].clone(), y.users[cy].clone())?, parts))
                });
                let rows = gather(x.cells.len(), ny, |cx, j| {
                    let parts = y.spans[j].clone().filter_map(|cy| columns[cx + x.cells.len() * cy].as_ref());
                    Some(pool.total(boxes(x.users[cx].clone(), j..j + 1)?, parts))
                });
                pool.take_back(columns.into_iter().flatten());
                rows
            })
            .collect();
        ready = ready.max(z.spans[k].end);

        // Add rows into windows.
        answers.extend(gather(nx, ny, |i, j| {
            let window = |rows: &Vec<Option<Sums>>| {
                let parts = x.spans[i].clone().filter_map(|cx| rows[cx + x.cells.len() * j].as_ref());
                Some(pool.total(boxes(i..i + 1, j..j + 1)?, parts))
            };
            let sums = rows.iter().map(window).collect::<Option<Vec<Sums>>>()?;
            let answer = each(lattice.index([i, j, k]), &sums);
            pool.take_back(sums);
            Some(answer)
        }));
        rows.into_iter().for_each(|rows| pool.take_back(rows.into_iter().flatten()));
    }
    answers
}

/// The sums of every cell of one layer.
fn cell_layer(
    [first, second]: &[&Rows; 2],
    lattice: &Lattice,
    search: &[Option<Shifts>],
    layer: usize,
    pool: &Pool,
) -> Vec<Option<Sums>> {
    let [x, y, z] = &lattice.axes;
    let count = x.cells.len() * y.cells.len();
    let one = |scratch: &mut (kernel::Scratch, energy::Scratch), place: usize| {
        let (cx, cy) = (place % x.cells.len(), place / x.cells.len());
        let users = [x.users[cx].clone(), y.users[cy].clone(), z.users[layer].clone()];
        let nodes = users[2].clone().flat_map(|k| {
            let users = &users;
            users[1].clone().flat_map(move |j| users[0].clone().map(move |i| [i, j, k]))
        });
        let shifts = Shifts::hull_of(nodes.filter_map(|node| search[lattice.index(node)]))?;
        let cell = [x.cells[cx].clone(), y.cells[cy].clone(), z.cells[layer].clone()];
        let mut sums = pool.zero(shifts);
        kernel::products(first, second, &cell, &shifts, sums.channel_mut(channel::PRODUCT), &mut scratch.0);
        for (which, rows, channel) in [(Which::First, first, channel::FIRST), (Which::Second, second, channel::SECOND)]
        {
            let ranges = voxels(which, &cell, first.shape, &shifts);
            let (sum, squares) = sums.pair_mut(channel);
            energy::sums(rows, &ranges, sum, squares, &mut scratch.1);
        }
        Some(sums)
    };
    (0..count).into_par_iter().map_init(Default::default, one).collect()
}

/// `make(i, j)` for every place of an nx x ny table, x fastest.
fn gather<T: Send>(nx: usize, ny: usize, make: impl Fn(usize, usize) -> T + Sync) -> Vec<T> {
    (0..nx * ny).into_par_iter().map(|place| make(place % nx, place / nx)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;
    use crate::shifts::{back, on};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// The sums of one window by the definition: both voxels half a shift from the midpoint.
    fn oracle(dense: [&[f32]; 2], shape: [usize; 3], window: &[Range<usize>; 3], shifts: Shifts) -> Sums {
        oracle::sums(dense, shape, window, shifts, |midpoint, d| {
            [std::array::from_fn(|a| midpoint[a] - back(d[a])), std::array::from_fn(|a| midpoint[a] + on(d[a]))]
        })
    }

    #[test]
    fn the_oracle_agrees_with_a_case_solved_by_hand() {
        // A row of 7 voxels: 2 at voxel 2, then 3 at voxel 4. Only the shift 2 pairs them, at midpoint 3.
        let (mut a, mut b) = ([0f32; 7], [0f32; 7]);
        (a[2], b[4]) = (2.0, 3.0);
        let shifts = Shifts { low: [-3, 0, 0], n: [7, 1, 1] };
        let sums = oracle([&a, &b], [7, 1, 1], &[0..7, 0..1, 0..1], shifts);
        assert_eq!(sums.channel(channel::PRODUCT), [0.0, 0.0, 0.0, 0.0, 0.0, 6.0, 0.0]);
        // At -3 midpoints 1 to 4 pair voxels 3 to 6 with voxels 0 to 3: neither light. At -2 midpoints 1 to 5 pair 2 to 6 with
        // 0 to 4: both. At 3 midpoints 1 to 4 pair 0 to 3 with 3 to 6: both.
        assert_eq!(sums.channel(channel::FIRST), [0.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0]);
        assert_eq!(sums.channel(channel::SECOND_SQUARED), [0.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]);
        // Midpoint 3 is in a window of voxels 3 to 4, not in one of 4 to 5.
        for (window, product) in [(3..5, 6.0), (4..6, 0.0)] {
            let sums = oracle([&a, &b], [7, 1, 1], &[window, 0..1, 0..1], shifts);
            assert_eq!(sums.channel(channel::PRODUCT)[5], product);
        }
    }

    #[test]
    fn shared_sparse_sums_are_the_oracles() {
        let mut random = Pcg64Mcg::seed_from_u64(4);
        for (shape, window, overlap, radius, lit) in [
            ([12, 10, 9], [8, 8, 4], 0.75, [2, 3, 1], 0.3),
            ([23, 7, 5], [9, 5, 5], 0.4, [6, 2, 2], 0.1),
            ([30, 6, 4], [30, 6, 1], 0.0, [11, 1, 1], 0.5),
            ([40, 3, 3], [5, 3, 3], 0.5, [13, 1, 1], 0.9),
        ] {
            let [a, b] = [0, 1].map(|_| oracle::volume(&mut random, shape, lit));
            let lattice = Lattice::new(shape, &Pass { window, overlap, search: radius });
            // Every window has its own prediction, and some are not searched.
            let search: Vec<Option<Shifts>> = (0..lattice.count())
                .map(|_| {
                    (random.random::<f64>() < 0.8)
                        .then(|| Shifts::around([0; 3].map(|_| random.random_range(-3..4)), radius))
                })
                .collect();
            let (a_rows, b_rows) = (Rows::of_dense(shape, &a), Rows::of_dense(shape, &b));
            let found = windows(&[[&a_rows, &b_rows]], &lattice, &search, |_, sums| sums[0].clone());
            for (node, sums) in found.iter().enumerate() {
                assert_eq!(sums.as_ref().map(|sums| sums.shifts), search[node]);
                let Some(sums) = sums else { continue };
                let wanted = oracle([&a, &b], shape, &lattice.window(node), sums.shifts);
                for c in 0..channel::COUNT {
                    for (k, (found, wanted)) in sums.channel(c).iter().zip(wanted.channel(c)).enumerate() {
                        assert!(
                            (found - wanted).abs() < 1e-9,
                            "node {node} channel {c} shift {k}: {found} for {wanted}"
                        );
                    }
                }
            }
        }
    }
}
