//! The grid of interrogation windows of a pass, and the cells that windows share.
//!
//! Every axis is cut at the first and the last voxel of each window; the pieces are the cells. A window is a whole
//! number of cells, so overlapping windows share the sums of cells. At 75 % overlap a cell is a quarter of a window
//! along each axis and serves 64 windows.

use std::ops::Range;

/// One axis of a window grid.
pub(crate) struct WindowAxis {
    /// First voxel of each window.
    pub starts: Vec<usize>,
    /// Length of a window and distance between windows, voxels.
    pub window: usize,
    pub step: usize,
    /// Voxels of each cell, cells of each window, windows of each cell.
    pub cells: Vec<Range<usize>>,
    pub spans: Vec<Range<usize>>,
    pub users: Vec<Range<usize>>,
}

impl WindowAxis {
    /// The most windows that fit in `length` voxels, `step` apart. Both ends share the voxels that are left over.
    pub fn new(length: usize, window: usize, step: usize) -> Self {
        let count = (length - window) / step + 1;
        let first = (length - window - (count - 1) * step) / 2;
        let starts: Vec<usize> = (0..count).map(|k| first + k * step).collect();
        let mut cuts: Vec<usize> = starts.iter().flat_map(|&start| [start, start + window]).collect();
        cuts.sort_unstable();
        cuts.dedup();
        // The last window that begins before a cell's end reaches farthest.
        let is_used = |cell: &Range<usize>| {
            let begun = starts.partition_point(|at| *at <= cell.start);
            begun > 0 && cell.end <= starts[begun - 1] + window
        };
        let cells: Vec<Range<usize>> = cuts.windows(2).map(|cut| cut[0]..cut[1]).filter(is_used).collect();
        let cell_at = |voxel: usize| cells.partition_point(|cell| cell.start < voxel);
        let spans: Vec<Range<usize>> = starts.iter().map(|&start| cell_at(start)..cell_at(start + window)).collect();
        let first = |cell: usize| spans.partition_point(|span| span.end <= cell);
        let end = |cell: usize| spans.partition_point(|span| span.start <= cell);
        let users = (0..cells.len()).map(|cell| first(cell)..end(cell)).collect();
        Self { starts, window, step, cells, spans, users }
    }

    pub fn count(&self) -> usize {
        self.starts.len()
    }

    /// The cell that holds a voxel; `None` for a voxel outside all windows.
    pub fn cell_of(&self, voxel: usize) -> Option<usize> {
        let cell = self.cells.partition_point(|cell| cell.end <= voxel);
        self.cells.get(cell).is_some_and(|range| range.contains(&voxel)).then_some(cell)
    }

    /// Centre of window `k`, voxels; a whole number is a voxel centre.
    pub fn centre_vox(&self, k: usize) -> f64 {
        self.starts[k] as f64 + (self.window as f64 - 1.0) / 2.0
    }
}

/// The windows of a pass along x, y, z. Node (i, j, k) is window `i + nx (j + ny k)`.
pub(crate) struct WindowGrid {
    pub axes: [WindowAxis; 3],
}

impl WindowGrid {
    /// Windows of `window` voxels, `step` voxels apart, in a volume of `shape` voxels.
    pub fn new(shape: [usize; 3], window: [usize; 3], step: [usize; 3]) -> Self {
        Self { axes: [0, 1, 2].map(|axis| WindowAxis::new(shape[axis], window[axis], step[axis])) }
    }

    pub fn shape(&self) -> [usize; 3] {
        self.axes.each_ref().map(WindowAxis::count)
    }

    pub fn count(&self) -> usize {
        self.shape().iter().product()
    }

    pub fn window(&self) -> [usize; 3] {
        self.axes.each_ref().map(|axis| axis.window)
    }

    /// The voxels of window `index`.
    pub fn voxels(&self, index: usize) -> [Range<usize>; 3] {
        let (node, window) = (self.node(index), self.window());
        let starts: [usize; 3] = std::array::from_fn(|a| self.axes[a].starts[node[a]]);
        [0, 1, 2].map(|a| starts[a]..starts[a] + window[a])
    }

    pub fn cell_count(&self) -> usize {
        self.axes.iter().map(|axis| axis.cells.len()).product()
    }

    /// The voxels of a cell; x counts fastest.
    pub fn cell(&self, index: usize) -> [&Range<usize>; 3] {
        let [x, y, z] = self.axes.each_ref().map(|axis| &axis.cells);
        [&x[index % x.len()], &y[index / x.len() % y.len()], &z[index / x.len() / y.len()]]
    }

    /// The cells of window `index`.
    pub fn cells_of(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        let [i, j, k] = self.node(index);
        let [x, y, z] = &self.axes;
        let rows = z.spans[k].clone().flat_map(move |cz| y.spans[j].clone().map(move |cy| cy + y.cells.len() * cz));
        rows.flat_map(move |row| x.spans[i].clone().map(move |cx| cx + x.cells.len() * row))
    }

    pub fn index(&self, node: [usize; 3]) -> usize {
        node[0] + self.axes[0].count() * (node[1] + self.axes[1].count() * node[2])
    }

    pub fn node(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.shape();
        [index % nx, index / nx % ny, index / nx / ny]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_whole_numbers_of_cells_at_any_overlap() {
        for (length, window, step) in [(128, 32, 8), (100, 32, 13), (7, 7, 3), (50, 10, 10), (50, 10, 25), (9, 1, 1)] {
            let axis = WindowAxis::new(length, window, step);
            assert!(axis.starts.last().unwrap() + window <= length);
            for (k, span) in axis.spans.iter().enumerate() {
                let cells = &axis.cells[span.clone()];
                assert_eq!((cells[0].start, cells.last().unwrap().end), (axis.starts[k], axis.starts[k] + window));
                assert!(cells.windows(2).all(|pair| pair[0].end == pair[1].start));
            }
            for (cell, users) in axis.users.iter().enumerate() {
                for k in 0..axis.count() {
                    assert_eq!(users.contains(&k), axis.spans[k].contains(&cell));
                }
            }
        }
    }

    #[test]
    fn the_papers_volume_gives_the_papers_count() {
        assert_eq!(WindowGrid::new([1820, 1820, 182], [160, 160, 16], [40, 40, 4]).count(), 74_088);
    }
}
