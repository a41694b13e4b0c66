//! The sums of every window, from the sums of cells that overlapping windows share (a sparse direct correlation after
//! Discetti & Astarita, Exp. Fluids, 2012). Memory: the cells of one layer of windows at a time.

use super::energy::{self, EnergyScratch};
use super::kernel::{self, CellProducts, ProductScratch};
use super::shifts::{Shifts, back, hull, on, paired_voxels};
use super::sums::{Sums, channel};
use super::table::{Table, total, total_in};
use super::window_grid::WindowGrid;
use crate::volumes::Rows;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::ops::Range;

/// Bytes of the sums of `pairs` pairs within `radius`: the cells of one layer of windows, their columns and rows.
pub(crate) fn bytes(windows: &WindowGrid, radius: [usize; 3], pairs: usize) -> f64 {
    let shifts: f64 = radius.iter().map(|&radius| (2 * radius + 1) as f64).product();
    let [x, y, z] = &windows.axes;
    let layers = z.spans.iter().map(|span| span.len()).max().unwrap_or(0) + 2;
    (x.cells.len() * y.cells.len() * layers * pairs) as f64 * shifts * (channel::COUNT * size_of::<f64>()) as f64
}

/// Bytes of the sums of the largest single window within `radius`: its cells, a column and a row of them.
pub(crate) fn window_bytes(windows: &WindowGrid, radius: [usize; 3]) -> f64 {
    let shifts: f64 = radius.iter().map(|&radius| (2 * radius + 1) as f64).product();
    let [x, y, z] = windows.axes.each_ref().map(|axis| axis.spans.iter().map(Range::len).max().unwrap_or(0));
    (x * y * (z + 2)) as f64 * shifts * (channel::COUNT * size_of::<f64>()) as f64
}

/// Constant: maximum bytes of sums over those for equal boxes of shifts. Each window has its own prediction, and a cell
/// is summed for the shifts of all its windows. In a smooth flow few boxes differ, by a voxel.
const APART: f64 = 1.25;

/// Maximum bytes that [`of_windows`] uses for boxes of up to `radius`. If the boxes of all windows would take more than
/// [`MAX_BYTES`], the windows are done in blocks.
pub(crate) fn budget(windows: &WindowGrid, radius: [usize; 3], pairs: usize) -> f64 {
    (APART * bytes(windows, radius, pairs)).min(MAX_BYTES)
}

/// Constant: maximum memory for sums; a pass that needs more is done in blocks. The paper's windows take a fiftieth of
/// it, and a machine that holds the paper's volumes has it.
pub(crate) const MAX_BYTES: f64 = 4e9;

/// Windows along x, y, z.
type Block = [Range<usize>; 3];

/// `each(node, sums)` for every node that has a box of shifts, with the sums of each pair.
///
/// Windows that share a cell need its sums for the shifts of both. If their boxes lie far apart, cells take more than
/// the [`budget`], and the windows are done in blocks. Cells at the border of blocks are summed in each of them. Blocks
/// change no bit of the sums.
pub(crate) fn of_windows<T: Send>(
    pairs: &[[&Rows; 2]],
    windows: &WindowGrid,
    search: &[Option<Shifts>],
    each: impl Fn(usize, &[Sums]) -> T + Sync,
) -> Vec<Option<T>> {
    let blocks = blocks(windows, search, pairs.len());
    if blocks.len() == 1 {
        return blocks[0].sums(pairs, &each);
    }
    let mut answers: Vec<Option<T>> = Vec::new();
    answers.resize_with(search.len(), || None);
    for block in blocks {
        block.nodes().zip(block.sums(pairs, &each)).for_each(|(node, found)| answers[node] = found);
    }
    answers
}

/// The blocks that [`of_windows`] does one after the other.
fn blocks<'a>(windows: &'a WindowGrid, search: &'a [Option<Shifts>], pairs: usize) -> Vec<Sharing<'a>> {
    let max_bytes = max_bytes(windows, search, pairs);
    let mut open = vec![Sharing::whole(windows, search)];
    let mut blocks = Vec::new();
    while let Some(sharing) = open.pop() {
        // The sums of a single window are within the budget.
        let is_one = sharing.block.iter().all(|side| side.len() <= 1);
        if is_one || sharing.held_bytes(pairs) <= max_bytes {
            blocks.push(sharing);
        } else {
            open.extend(halves(sharing.block).map(|half| Sharing::new(windows, search, half)));
        }
    }
    blocks
}

/// Maximum bytes of a block: the [`budget`] for the widest box.
fn max_bytes(windows: &WindowGrid, search: &[Option<Shifts>], pairs: usize) -> f64 {
    let widest = |axis: usize| search.iter().flatten().map(|shifts| shifts.n[axis] / 2).max().unwrap_or(0);
    budget(windows, [0, 1, 2].map(widest), pairs)
}

/// A block of windows, cut across the longer of its sides along x and y, or along z if both are one window long.
fn halves(block: Block) -> [Block; 2] {
    let [i, j, _] = block.each_ref().map(|side| side.len());
    let axis = if i.max(j) <= 1 {
        2
    } else if i > j {
        0
    } else {
        1
    };
    let middle = block[axis].start + block[axis].len() / 2;
    let [mut low, mut high] = [block.clone(), block];
    (low[axis].end, high[axis].start) = (middle, middle);
    [low, high]
}

/// The windows of a block, and the box of shifts of each.
struct Sharing<'a> {
    windows: &'a WindowGrid,
    search: &'a [Option<Shifts>],
    block: Block,
    /// Cells of the block along x, y, z.
    cells: Block,
}

impl<'a> Sharing<'a> {
    fn whole(windows: &'a WindowGrid, search: &'a [Option<Shifts>]) -> Self {
        Self::new(windows, search, windows.shape().map(|count| 0..count))
    }

    fn new(windows: &'a WindowGrid, search: &'a [Option<Shifts>], block: Block) -> Self {
        let cells = |axis: usize| {
            let spans: &[Range<usize>] = &windows.axes[axis].spans[block[axis].clone()];
            spans.first().map_or(0, |span| span.start)..spans.last().map_or(0, |span| span.end)
        };
        Self { windows, search, cells: [0, 1, 2].map(cells), block }
    }

    /// Nodes of the block, x fastest.
    fn nodes(&self) -> impl Iterator<Item = usize> {
        let [i, j, k] = self.block.clone();
        let rows = k.flat_map(move |k| j.clone().map(move |j| (j, k)));
        rows.flat_map(move |(j, k)| i.clone().map(move |i| self.windows.index([i, j, k])))
    }

    /// The smallest box that holds the shifts of all nodes of the block in a box of nodes; `None` if none of them is
    /// searched.
    fn hull(&self, nodes: Block) -> Option<Shifts> {
        let inside = |axis: usize| {
            let (nodes, block) = (&nodes[axis], &self.block[axis]);
            nodes.start.max(block.start)..nodes.end.min(block.end)
        };
        let [i, j, k] = [0, 1, 2].map(inside);
        let rows = k.flat_map(|k| j.clone().map(move |j| (j, k)));
        let nodes = rows.flat_map(|(j, k)| i.clone().map(move |i| [i, j, k]));
        Shifts::hull(nodes.filter_map(|node| self.search[self.windows.index(node)]))
    }

    /// Shifts that the cells of each layer are summed for.
    fn shifts_by_layer(&self) -> Vec<f64> {
        let [x, y, z] = &self.windows.axes;
        let [across, down, deep] = self.cells.clone();
        let shifts_of = |layer: usize| -> f64 {
            let users = |cx: usize, cy: usize| [x.users[cx].clone(), y.users[cy].clone(), z.users[layer].clone()];
            let places: Vec<[usize; 2]> = down.clone().flat_map(|cy| across.clone().map(move |cx| [cx, cy])).collect();
            places.par_iter().filter_map(|[cx, cy]| Some(self.hull(users(*cx, *cy))?.len() as f64)).sum()
        };
        deep.map(shifts_of).collect()
    }

    /// Bytes of the sums of the block, as [`bytes`] counts them, for the boxes that its cells need.
    fn held_bytes(&self, pairs: usize) -> f64 {
        let (layers, deep) = (self.shifts_by_layer(), &self.cells[2]);
        let most = layers.iter().copied().fold(0.0, f64::max);
        // Columns and rows take as much as a layer each.
        let held = |span: &Range<usize>| {
            layers[span.start - deep.start..span.end - deep.start].iter().sum::<f64>() + 2.0 * most
        };
        let spans = &self.windows.axes[2].spans[self.block[2].clone()];
        let shifts = spans.iter().map(held).fold(0.0, f64::max);
        shifts * (pairs * channel::COUNT * size_of::<f64>()) as f64
    }

    /// `each(node, sums)` for the nodes of the block, in the order of [`Sharing::nodes`].
    fn sums<T: Send>(&self, pairs: &[[&Rows; 2]], each: &(impl Fn(usize, &[Sums]) -> T + Sync)) -> Vec<Option<T>> {
        let deep = &self.cells[2];
        let mut spare = Vec::new();
        let mut cells: Vec<VecDeque<Table>> = pairs.iter().map(|_| VecDeque::new()).collect();
        let mut answers = Vec::with_capacity(self.block.iter().map(Range::len).product());
        // Layers of cells that are summed.
        let mut held = deep.start..deep.start;
        for k in self.block[2].clone() {
            let span = self.windows.axes[2].spans[k].clone();
            let mut rows_of = |(cells, pair): (&mut VecDeque<Table>, &[&Rows; 2])| {
                // Release the layers of cells behind this layer of windows, and sum the new ones.
                let behind = cells.len().min(span.start - held.start);
                spare.extend(cells.drain(..behind).map(Table::into_room));
                for layer in held.end.max(span.start)..span.end {
                    cells.push_back(self.cell_layer(*pair, layer, spare.pop().unwrap_or_default()));
                }
                self.rows(k, cells, &mut spare)
            };
            let rows: Vec<Table> = cells.iter_mut().zip(pairs).map(&mut rows_of).collect();
            held = span.start..held.end.max(span.end);
            answers.extend(self.windows_of(k, &rows, each));
            spare.extend(rows.into_iter().map(Table::into_room));
        }
        answers
    }

    /// Adds the rows of window layer `k`, those of each pair, into windows.
    fn windows_of<T: Send>(
        &self,
        k: usize,
        rows: &[Table],
        each: &(impl Fn(usize, &[Sums]) -> T + Sync),
    ) -> Vec<Option<T>> {
        let [across, _, _] = &self.cells;
        let [wide, high, _] = &self.block;
        let answer = |spare: &mut Vec<Vec<f64>>, place: usize| {
            let (i, j) = (wide.start + place % wide.len(), high.start + place / wide.len());
            let shifts = self.search[self.windows.index([i, j, k])]?;
            let row = across.len() * (j - high.start);
            let window = |rows: &Table| {
                let cells = self.windows.axes[0].spans[i].clone();
                let terms = cells.filter_map(|cx| rows.get(cx - across.start + row));
                total_in(spare.pop().unwrap_or_default(), shifts, terms)
            };
            let sums: Vec<Sums> = rows.iter().map(window).collect();
            let answer = each(self.windows.index([i, j, k]), &sums);
            spare.extend(sums.into_iter().map(|sums| sums.data));
            Some(answer)
        };
        (0..wide.len() * high.len()).into_par_iter().map_init(Vec::new, answer).collect()
    }

    /// The sums of every cell of one layer.
    fn cell_layer(&self, [first, second]: [&Rows; 2], layer: usize, room: Vec<f64>) -> Table {
        let [x, y, z] = &self.windows.axes;
        let [across, down, _] = &self.cells;
        // The midpoints of a cell, and the voxels of both volumes that they pair.
        let paired = |cx: usize, cy: usize, shifts: &Shifts| {
            let midpoints = [x.cells[cx].clone(), y.cells[cy].clone(), z.cells[layer].clone()];
            let of_first = paired_voxels(&midpoints, first.shape, shifts, |d| -back(d));
            let of_second = paired_voxels(&midpoints, first.shape, shifts, on);
            (midpoints, [(first, of_first), (second, of_second)])
        };
        let places = gather(across, down, |cx, cy| {
            let Some(shifts) = self.hull([x.users[cx].clone(), y.users[cy].clone(), z.users[layer].clone()]) else {
                return (None, false);
            };
            let (_, volumes) = paired(cx, cy, &shifts);
            let is_lit = |(rows, ranges): &(&Rows, [Vec<Range<i32>>; 3])| {
                rows.is_lit(ranges.each_ref().map(|ranges| hull(ranges)))
            };
            (Some(shifts), volumes.iter().any(is_lit))
        });
        let fill = |scratch: &mut (ProductScratch, EnergyScratch), place: usize, shifts: Shifts, out: &mut [f64]| {
            let (cx, cy) = (across.start + place % across.len(), down.start + place / across.len());
            let (midpoints, volumes) = paired(cx, cy, &shifts);
            let mut channels = out.chunks_exact_mut(shifts.len());
            let mut next = || channels.next().expect("a number for each shift in each channel");
            let products = next();
            products.fill(0.0);
            let cell = CellProducts { first, second, midpoints: &midpoints, shifts: &shifts };
            kernel::products(cell, products, &mut scratch.0);
            for (rows, ranges) in volumes {
                energy::sums(rows, &ranges, [next(), next()], &mut scratch.1);
            }
        };
        Table::new(places, room, fill)
    }

    /// Adds the cells of window layer `k` into columns of its depth, and the columns into rows of cells along x.
    fn rows(&self, k: usize, layers: &VecDeque<Table>, spare: &mut Vec<Vec<f64>>) -> Table {
        let [x, y, _] = &self.windows.axes;
        let [across, down, _] = &self.cells;
        let high = &self.block[1];
        let places = gather(across, down, |cx, cy| {
            let place = cx - across.start + across.len() * (cy - down.start);
            let is_lit = layers.iter().any(|layer| layer.get(place).is_some());
            (self.hull([x.users[cx].clone(), y.users[cy].clone(), k..k + 1]), is_lit)
        });
        let columns = Table::new(places, spare.pop().unwrap_or_default(), |(), place, shifts, out| {
            total(out, shifts, layers.iter().filter_map(|layer| layer.get(place)));
        });
        let lit_columns = &columns;
        let columns_of = |cx: usize, j: usize| {
            let place = move |cy: usize| cx + across.len() * (cy - down.start);
            y.spans[j].clone().filter_map(move |cy| lit_columns.get(place(cy)))
        };
        let places = gather(across, high, |cx, j| {
            let is_lit = columns_of(cx - across.start, j).next().is_some();
            (self.hull([x.users[cx].clone(), j..j + 1, k..k + 1]), is_lit)
        });
        let rows = Table::new(places, spare.pop().unwrap_or_default(), |(), place, shifts, out| {
            total(out, shifts, columns_of(place % across.len(), high.start + place / across.len()));
        });
        spare.push(columns.into_room());
        rows
    }
}

/// `make(i, j)` for every place of two ranges, x fastest.
fn gather<T: Send>(x: &Range<usize>, y: &Range<usize>, make: impl Fn(usize, usize) -> T + Sync) -> Vec<T> {
    let make = |place: usize| make(x.start + place % x.len(), y.start + place / x.len());
    (0..x.len() * y.len()).into_par_iter().map(make).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correlate::oracle;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// The sums of one window by the definition: both voxels lie half a shift from the midpoint.
    fn oracle(dense: [&[f32]; 2], shape: [usize; 3], window: &[Range<usize>; 3], shifts: Shifts) -> Sums {
        oracle::sums(dense, shape, window, shifts, |midpoint, d| {
            [std::array::from_fn(|a| midpoint[a] - back(d[a])), std::array::from_fn(|a| midpoint[a] + on(d[a]))]
        })
    }

    #[test]
    fn the_oracle_agrees_with_a_case_solved_by_hand() {
        // A row of 7 voxels: intensity 2 at voxel 2, then 3 at voxel 4. Only the shift 2 pairs them, at midpoint 3.
        let (mut a, mut b) = ([0f32; 7], [0f32; 7]);
        (a[2], b[4]) = (2.0, 3.0);
        let shifts = Shifts { low: [-3, 0, 0], n: [7, 1, 1] };
        let sums = oracle([&a, &b], [7, 1, 1], &[0..7, 0..1, 0..1], shifts);
        assert_eq!(sums.channel(channel::PRODUCT), [0.0, 0.0, 0.0, 0.0, 0.0, 6.0, 0.0]);
        // At shift -3, midpoints 1 to 4 pair voxels 3 to 6 with voxels 0 to 3: neither light. At -2, midpoints 1 to 5
        // pair 2 to 6 with 0 to 4: both. At 3, midpoints 1 to 4 pair 0 to 3 with 3 to 6: both.
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
        for (shape, window, step, radius, lit) in [
            ([12, 10, 9], [8, 8, 4], [2, 2, 1], [2, 3, 1], 0.3),
            ([23, 7, 5], [9, 5, 5], [5, 3, 3], [6, 2, 2], 0.1),
            ([30, 6, 4], [30, 6, 1], [30, 6, 1], [11, 1, 1], 0.5),
            ([40, 3, 3], [5, 3, 3], [3, 2, 2], [13, 1, 1], 0.9),
            // Dark cells, and dark windows.
            ([40, 12, 9], [8, 4, 4], [4, 2, 2], [2, 1, 1], 0.005),
        ] {
            let [a, b] = [0, 1].map(|_| oracle::volume(&mut random, shape, lit));
            let windows = WindowGrid::new(shape, window, step);
            // Every window has its own prediction, and some are not searched.
            let mut shifts = || {
                let is_searched = random.random::<f64>() < 0.8;
                is_searched.then(|| Shifts::around([0; 3].map(|_| random.random_range(-3..4)), radius))
            };
            let search: Vec<Option<Shifts>> = (0..windows.count()).map(|_| shifts()).collect();
            let (a_rows, b_rows) = (Rows::of_dense(shape, &a), Rows::of_dense(shape, &b));
            let found = of_windows(&[[&a_rows, &b_rows]], &windows, &search, |_, sums| sums[0].clone());
            for (node, sums) in found.iter().enumerate() {
                assert_eq!(sums.as_ref().map(|sums| sums.shifts), search[node]);
                let Some(sums) = sums else { continue };
                oracle::assert_close(sums, &oracle([&a, &b], shape, &windows.voxels(node), sums.shifts), |_| 1e-9);
            }
        }
    }

    /// Scar: boxes far apart made cells of shifts for both; a search of 36 voxels took 3.5 GB, with an estimate of 21
    /// MB.
    #[test]
    fn windows_far_apart_share_nothing_and_keep_their_sums() {
        let mut random = Pcg64Mcg::seed_from_u64(9);
        let (shape, radius) = ([24, 20, 6], [1; 3]);
        let [a, b] = [0, 1].map(|_| oracle::volume(&mut random, shape, 0.4));
        let (a_rows, b_rows) = (Rows::of_dense(shape, &a), Rows::of_dense(shape, &b));
        let windows = WindowGrid::new(shape, [8, 8, 4], [2, 2, 2]);
        let mut shifts = |_| Some(Shifts::around([0; 3].map(|_| random.random_range(-12..13)), radius));
        let search: Vec<Option<Shifts>> = (0..windows.count()).map(&mut shifts).collect();
        let sums = |_: usize, sums: &[Sums]| sums[0].clone();
        let channels = |sums: &Sums| (0..channel::COUNT).map(|n| sums.channel(n).to_vec()).collect::<Vec<_>>();
        let pairs = [[&a_rows, &b_rows]];
        let whole = || Sharing::whole(&windows, &search);
        let [found, shared] = [of_windows(&pairs, &windows, &search, sums), whole().sums(&pairs, &sums)];
        for (found, shared) in found.iter().zip(&shared) {
            let [found, shared] = [found, shared].map(|sums| sums.as_ref().unwrap());
            assert_eq!((found.shifts, channels(found)), (shared.shifts, channels(shared)));
        }
        let together = whole().held_bytes(1);
        assert!(together > 20.0 * budget(&windows, radius, 1), "{together}");
        // Equal boxes fit as they are.
        let equal = vec![Some(Shifts::around([3, -2, 1], radius)); windows.count()];
        assert_eq!(blocks(&windows, &equal, 1).len(), 1);
    }

    /// Scar: a column of windows was done at once, whatever it held.
    #[test]
    fn a_column_of_windows_far_apart_is_cut_too() {
        let mut random = Pcg64Mcg::seed_from_u64(10);
        let (shape, radius) = ([40, 8, 40], [1; 3]);
        let [a, b] = [0, 1].map(|_| oracle::volume(&mut random, shape, 0.4));
        let (a_rows, b_rows) = (Rows::of_dense(shape, &a), Rows::of_dense(shape, &b));
        let windows = WindowGrid::new(shape, [40, 8, 8], [2, 2, 2]);
        let centre = |k: usize| [if k.is_multiple_of(2) { -12 } else { 12 }, 0, 0];
        let search: Vec<Option<Shifts>> =
            (0..windows.count()).map(|k| Some(Shifts::around(centre(k), radius))).collect();
        assert_eq!(windows.shape(), [1, 1, 17]);
        assert_eq!(blocks(&windows, &search, 1).len(), 17);
        let most = budget(&windows, radius, 1);
        let all: Block = [0..1, 0..1, 0..17];
        assert!(halves(all).into_iter().all(|half| half[2].len() < 17));
        assert!((0..17).all(|k| Sharing::new(&windows, &search, [0..1, 0..1, k..k + 1]).held_bytes(1) <= most));
        let found = of_windows(&[[&a_rows, &b_rows]], &windows, &search, |_, sums| sums[0].clone());
        for (node, sums) in found.iter().enumerate() {
            let sums = sums.as_ref().unwrap();
            oracle::assert_close(sums, &oracle([&a, &b], shape, &windows.voxels(node), sums.shifts), |_| 1e-9);
        }
    }
}
