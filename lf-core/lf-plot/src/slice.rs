//! A layer of a grid of vectors as a panel: a map of values, and arrows over it.

use super::chart::{Arrows, Axis, Mark, Panel};
use super::range::stretch;
use lf_core::field::{AXES, VectorGrid};
use lf_core::statistics::quantile;

/// Share of the values that colours and arrows show whole, so that a few wild ones do not make the rest pale and short.
const USUAL: f64 = 0.98;

/// One layer of vectors across an axis. Convention: x is drawn to the right or, in a layer across x, y; the other axis
/// is drawn upwards. So a layer across z looks as the camera sees it.
#[derive(Debug, Clone, Copy)]
pub struct Slice<'a> {
    /// The grid of the vectors.
    pub grid: &'a VectorGrid,
    /// The axis across the layer: 0, 1, 2 for x, y, z.
    pub through: usize,
    /// The number of the layer along that axis.
    pub layer: usize,
}

impl Slice<'_> {
    /// The horizontal and the vertical axis in the layer.
    pub fn across(&self) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][self.through]
    }

    /// Number of vectors along the two axes.
    pub fn shape(&self) -> [usize; 2] {
        self.across().map(|axis| self.grid.shape[axis])
    }

    /// The place of the layer on the axis across it, mm.
    pub fn place_mm(&self) -> f64 {
        let spacing = self.grid.spacing_mm[self.through];
        let steps = self.grid.origin_mm[self.through] / spacing + self.layer as f64;
        // Rounding may leave a small number instead of 0 in the middle of a symmetric field. `+ 0.0` removes the sign
        // of -0.
        (1e6 * steps).round() * 1e-6 * spacing + 0.0
    }

    /// The index of the vector in column `i` and row `j`.
    pub fn node(&self, [i, j]: [usize; 2]) -> usize {
        let [right, upright] = self.across();
        let mut place = [0; 3];
        (place[self.through], place[right], place[upright]) = (self.layer, i, j);
        self.grid.index(place)
    }

    /// The indices of all vectors of the layer, row by row.
    pub fn nodes(&self) -> impl Iterator<Item = usize> {
        let [columns, rows] = self.shape();
        (0..columns * rows).map(move |n| self.node([n % columns, n / columns]))
    }

    /// A panel with a map of one value a vector. NaN is drawn as no data.
    pub fn panel(&self, title: impl Into<String>, scale: Axis, values: Vec<f64>) -> Panel {
        let bounds = self.across().map(|axis| self.grid.bounds_mm(axis));
        let name = |which: usize| Axis::new(format!("{}, mm", AXES[self.across()[which]])).over(bounds[which]);
        let mut panel = Panel::new(title, name(0), name(1));
        panel.is_to_scale = true;
        panel.marks = vec![Mark::Map { values, cells: self.shape(), x: bounds[0], y: bounds[1], scale }];
        panel
    }

    /// Number of vectors to an arrow along the two axes, if at most `most` arrows stand along the longer one.
    pub fn arrow_stride(&self, most: usize) -> [usize; 2] {
        let spacing = self.across().map(|axis| self.grid.spacing_mm[axis]);
        let spans = [0, 1].map(|n| self.shape()[n] as f64 * spacing[n]);
        let stretch = stretch(spans);
        let step = (spans[0] * stretch[0]).max(spans[1] * stretch[1]) / most as f64;
        // Rounding must not thin out exactly `most` vectors.
        [0, 1].map(|n| ((step / (spacing[n] * stretch[n]) - 1e-6).ceil() as usize).clamp(1, self.shape()[n]))
    }

    /// Arrows for `vector`, which gives the components along the two axes, at most `most` of them along the longer one.
    /// NaN is left out. The usual length is that of the vectors drawn.
    pub fn arrows(&self, most: usize, vector: impl Fn(usize) -> [f64; 2]) -> Arrows {
        let (shape, stride, across) = (self.shape(), self.arrow_stride(most), self.across());
        let along = |n: usize| ((shape[n] - 1) % stride[n] / 2..shape[n]).step_by(stride[n]);
        let places: Vec<[usize; 2]> = along(1).flat_map(|j| along(0).map(move |i| [i, j])).collect();
        let place_mm =
            |n: usize, index: usize| self.grid.origin_mm[across[n]] + index as f64 * self.grid.spacing_mm[across[n]];
        let vectors: Vec<[f64; 2]> = places.iter().map(|place| vector(self.node(*place))).collect();
        Arrows {
            name: String::new(),
            unit: String::new(),
            usual: usual(vectors.iter().map(|[x, y]| x.hypot(*y))),
            spacing: [0, 1].map(|n| stride[n] as f64 * self.grid.spacing_mm[across[n]]),
            is_hollow: false,
            points: places.iter().map(|[i, j]| [place_mm(0, *i), place_mm(1, *j)]).collect(),
            vectors,
        }
    }
}

/// The size that 98 % of the finite values do not exceed; 0 without any.
pub fn usual(values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).filter(|size| size.is_finite()).collect();
    if sizes.is_empty() { 0.0 } else { quantile(&mut sizes, USUAL) }
}
