//! One layer of a field: what is drawn, how large, and where on the canvas.

use super::numbers::quantile;
use lf_core::Refusal;
use lf_core::field::{Cut, Field, MEASURED, NO_DATA, REPLACED};

/// Longer side of the chart, pixels: its most, its least, and the most a cell of it takes.
const CHART_PX: f64 = 760.0;
const LEAST_PX: f64 = 320.0;
const CELL_PX: f64 = 160.0;
/// A slice flatter than this is stretched to it.
const FLATTEST: f64 = 6.0;
/// Cells drawn along an axis, at most: more are finer than the picture.
const MOST_CELLS: usize = 256;
/// Least distance between arrows, pixels: closer and their heads run together. And the longest that an arrow of the usual
/// length gets.
const ARROW_STEP_PX: f64 = 16.0;
const ARROW_PX: f64 = 80.0;
/// Usual length, distances between arrows: one does not touch the next.
const ARROW_STEPS: f64 = 0.9;
/// The usual length of an arrow is that of this share of vectors, and so is the end of the colours: a few wild vectors do
/// not make the rest small.
const USUAL: f64 = 0.98;
/// Least usual length, share of the end of the colours: noise about nothing is not drawn as a pattern.
const LEAST_USUAL: f64 = 0.2;

/// A layer of a field, its scales and its place on the canvas.
pub(super) struct View<'a> {
    pub field: &'a Field,
    /// The axis through the plane and the two in it, to the right and upright.
    pub through: usize,
    pub across: [usize; 2],
    pub layer: usize,
    /// Size of the chart, pixels, and its top left corner on the canvas.
    pub size_px: [i32; 2],
    pub corner_px: [i32; 2],
    /// Axis that is stretched against the other, and how much.
    pub stretched: Option<(usize, f64)>,
    /// Where the colours end, and the usual length in the plane: mm, or mm/s.
    pub limit: f64,
    pub usual: f64,
}

impl<'a> View<'a> {
    pub fn new(field: &'a Field, cut: Cut) -> Result<Self, Refusal> {
        let layer = cut.layer(&field.layout)?;
        let across = [[1, 2], [0, 2], [0, 1]][cut.axis];
        let (size_px, stretched) = size(field, across);
        let mut view = Self {
            field,
            through: cut.axis,
            across,
            layer,
            size_px,
            corner_px: [0, 0],
            stretched,
            limit: 0.0,
            usual: 0.0,
        };
        // Both scales are the whole field's, so that its slices compare. Without a measured vector, of those replaced.
        let of = |flag: f32| (0..field.len()).filter(|&node| field.flag[node] == flag).collect::<Vec<usize>>();
        let nodes = Some(of(MEASURED)).filter(|nodes| !nodes.is_empty()).unwrap_or_else(|| of(REPLACED));
        let largest =
            |&node: &usize| [0, 1, 2].map(|axis| view.value(axis, node).abs()).into_iter().fold(0.0, f64::max);
        let limit = quantile(nodes.iter().map(largest).collect(), USUAL);
        let usual = quantile(nodes.iter().map(|&node| view.length(node)).collect(), USUAL);
        (view.limit, view.usual) = (limit, usual.max(LEAST_USUAL * limit));
        Ok(view)
    }

    /// What is drawn, and its unit.
    pub fn quantity(&self) -> (&'static str, &'static str) {
        if self.field.layout.dt_s.is_some() { ("Velocity", "mm/s") } else { ("Displacement", "mm") }
    }

    /// Component along `axis`, in the unit of [`View::quantity`].
    pub fn value(&self, axis: usize, node: usize) -> f64 {
        let component = [&self.field.u, &self.field.v, &self.field.w][axis];
        f64::from(component[node]) / self.field.layout.dt_s.unwrap_or(1.0)
    }

    /// Length in the plane.
    pub fn length(&self, node: usize) -> f64 {
        self.value(self.across[0], node).hypot(self.value(self.across[1], node))
    }

    /// Vectors along the two axes of the picture.
    pub fn shape(&self) -> [usize; 2] {
        self.across.map(|axis| self.field.layout.shape[axis])
    }

    /// The vector in column `i` and row `j` of the layer.
    pub fn node(&self, [i, j]: [usize; 2]) -> usize {
        let [nx, ny, _] = self.field.layout.shape;
        let mut place = [0; 3];
        (place[self.through], place[self.across[0]], place[self.across[1]]) = (self.layer, i, j);
        place[0] + nx * (place[1] + ny * place[2])
    }

    /// Vectors of the layer that are measured, replaced and without data.
    pub fn counts(&self) -> [usize; 3] {
        let [columns, rows] = self.shape();
        let flags = (0..columns * rows).map(|n| self.field.flag[self.node([n % columns, n / columns])]);
        let mut counts = [0; 3];
        flags.for_each(|flag| counts[if flag == MEASURED { 0 } else { 1 + usize::from(flag == NO_DATA) }] += 1);
        counts
    }

    /// Convention: y runs down, as image rows do; z runs up.
    pub fn is_down(&self) -> bool {
        self.across[1] == 1
    }

    /// A vector of the plane as pixels to the right and down, before any scale.
    pub fn on_canvas(&self, node: usize) -> [f64; 2] {
        let [right, upright] = self.across.map(|axis| self.value(axis, node));
        [right, if self.is_down() { upright } else { -upright }]
    }

    /// Size of a cell, pixels.
    pub fn cell_px(&self) -> [f64; 2] {
        let shape = self.shape();
        [0, 1].map(|a| self.size_px[a] as f64 / shape[a] as f64)
    }

    /// A place in cells from the first, pixels on the canvas.
    pub fn place_px(&self, place: [f64; 2]) -> [f64; 2] {
        let cell = self.cell_px();
        let down = if self.is_down() { place[1] } else { self.shape()[1] as f64 - place[1] };
        [self.corner_px[0] as f64 + place[0] * cell[0], self.corner_px[1] as f64 + down * cell[1]]
    }

    /// Vectors to a cell of the picture, along its axes.
    pub fn cell_stride(&self) -> [usize; 2] {
        self.shape().map(|n| n.div_ceil(MOST_CELLS))
    }

    /// Vectors to an arrow, along the axes of the picture.
    pub fn arrow_stride(&self) -> [usize; 2] {
        let (cell, shape) = (self.cell_px(), self.shape());
        [0, 1].map(|a| ((ARROW_STEP_PX / cell[a]).ceil() as usize).clamp(1, shape[a]))
    }

    /// Pixels of arrow for the usual length; and for the unit.
    pub fn arrow_px(&self) -> [f64; 2] {
        let (cell, stride) = (self.cell_px(), self.arrow_stride());
        let usual_px = (0..2).map(|a| ARROW_STEPS * cell[a] * stride[a] as f64).fold(ARROW_PX, f64::min);
        [usual_px, if self.usual > 0.0 { usual_px / self.usual } else { 0.0 }]
    }
}

/// The size of the chart in pixels, and the axis that is stretched to it with its factor.
fn size(field: &Field, across: [usize; 2]) -> ([i32; 2], Option<(usize, f64)>) {
    let extent = across.map(|axis| field.layout.bounds_mm(axis)).map(|[low, high]| high - low);
    let counts = across.map(|axis| field.layout.shape[axis]);
    let long = usize::from(extent[1] > extent[0]);
    let flat = extent[long] / extent[1 - long];
    let mut size = [(CELL_PX * counts[0].max(counts[1]) as f64).clamp(LEAST_PX, CHART_PX); 2];
    size[1 - long] /= flat.min(FLATTEST);
    let stretched = (flat > FLATTEST).then(|| (across[1 - long], flat / FLATTEST));
    (size.map(|px| px.round() as i32), stretched)
}
