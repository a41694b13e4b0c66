//! Patches: the light of each pixel under a lenslet that a voxel sends through it, for every place among the pixels.

use crate::weights::{axis::Span, blur::Blur, cell::Slab};

/// Columns come in fours, or in eights where they are more.
pub(super) const FOUR: usize = 4;

/// A place down the rows is right to the patch's side over twice this many, or to a pixel over twice the phases.
const STEPS_PER_SIDE: f64 = 160.0;
const MAX_PHASES: u32 = 128;
/// Phases of a pixel across; the table is linear between them.
pub(super) const ACROSS: usize = 8;
/// Maximum number of shares in tables of several classes, which then have fewer phases down: but at least 2 to the
/// power of `MIN_BITS`.
const MAX_SHARES: usize = 120_000;
const MIN_BITS: u32 = 4;
/// Parts of a pixel over which moments are summed.
const PARTS: usize = 4;

#[derive(Debug, Clone)]
pub(super) struct Patches {
    /// Phases of a pixel down, and their logarithm to base 2.
    pub(super) per_px: f32,
    pub(super) bits: u32,
    /// The patch begins at the pixel that lies this far before its middle, px.
    pub(super) half_px: f32,
    /// Rows and columns of a patch; columns are a multiple of [`FOUR`].
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// A class is a width of patches: the width of the first class over the usual width, and classes per change by 1.
    /// Only bent rays or a tilted sensor need more than one.
    pub(super) least_width: f32,
    pub(super) per_width: f32,
    pub(super) classes: usize,
    /// Class, phase down, row, phase across, column: the share of a pixel that the patch fills.
    pub(super) shares: Vec<f32>,
    /// Tables like `shares` of the moments along x, and along y. Empty if moments do not matter.
    pub(super) moments: [Vec<f32>; 2],
    /// Class, phase down, row: the sum of a row's shares.
    pub(super) row_sums: Vec<f32>,
}

/// The light of each pixel of a blurred edge-to-edge span along one axis, and its first moment about the place of the
/// stop that the pixel's middle shows.
fn profile(span: &Span, middle: f64, pixels: usize, shape: &Shape) -> (Vec<f32>, Vec<f32>) {
    let Shape { step_mm, shift, .. } = *shape;
    let ramp = |place: f64| span.ramp((place - middle) * step_mm) / step_mm;
    (0..pixels)
        .map(|pixel| {
            let (mut sum, mut moment, mut before) = (0.0, 0.0, ramp(pixel as f64));
            for part in 0..PARTS {
                let within = (part as f64 + 0.5) / PARTS as f64;
                let after = ramp(pixel as f64 + (part + 1) as f64 / PARTS as f64);
                sum += after - before;
                moment += (after - before) * (within - 0.5 + shift * (pixel as f64 + within - middle));
                before = after;
            }
            (sum as f32, moment as f32)
        })
        .unzip()
}

/// The shape of a patch: a cell in slabs, for a voxel that blurs by `blurs` along x and y.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape<'a> {
    pub(super) slabs: &'a [Slab],
    pub(super) blurs: [Blur; 2],
    /// mm of the array a pixel.
    pub(super) step_mm: f64,
    /// How much farther than on the sensor light lies on the image of the stop, for a px from the patch's middle.
    pub(super) shift: f64,
    /// Every share is multiplied by this.
    pub(super) scale: f64,
}

impl Shape<'_> {
    fn spans(&self) -> Vec<[Span; 2]> {
        self.slabs.iter().map(|slab| [0, 1].map(|along| slab.span(along, self.blurs))).collect()
    }

    /// The patch begins this far before its middle, px.
    fn half_px(&self) -> f64 {
        let reach = |span: &Span| span.low.abs().max(span.high.abs()) + span.blur.reach();
        self.spans().iter().flatten().map(reach).fold(0.0, f64::max) / self.step_mm
    }
}

/// The size of a table.
struct Size {
    rows: usize,
    columns: usize,
    /// See [`Patches::bits`].
    bits: u32,
}

impl Size {
    /// For patches of `side_px` a side, in a number of classes.
    fn new(side_px: f64, classes: usize) -> Self {
        let rows = (side_px + 1.0).ceil() as usize;
        let wanted = (STEPS_PER_SIDE / side_px).log2().ceil().max(0.0) as u32;
        let columns = rows.next_multiple_of(FOUR);
        let fits = |bits: &u32| classes * (rows << bits) * (ACROSS + 1) * columns <= MAX_SHARES;
        let most = (MIN_BITS..=MAX_PHASES.ilog2()).rev().find(fits).unwrap_or(MIN_BITS);
        Self { rows, columns, bits: wanted.min(if classes > 1 { most } else { MAX_PHASES.ilog2() }) }
    }
}

fn add(sums: &mut [f32], factor: f32, values: &[f32]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
}

impl Patches {
    /// The table of a class of each of these shapes, whose widths rise from `least_width` by `step`.
    pub(super) fn new(shapes: &[Shape], least_width: f64, step: f64, has_moments: bool) -> Self {
        let half_px = shapes.iter().map(Shape::half_px).fold(0.0, f64::max);
        let Size { rows, columns, bits } = Size::new(2.0 * half_px, shapes.len());
        let phases = 1usize << bits;
        let size = shapes.len() * phases * rows * (ACROSS + 1) * columns;
        let mut this = Self {
            per_px: phases as f32,
            bits,
            half_px: half_px as f32,
            rows,
            columns,
            least_width: least_width as f32,
            per_width: (1.0 / step) as f32,
            classes: shapes.len(),
            shares: vec![0.0; size],
            moments: [0, 1].map(|_| vec![0.0; if has_moments { size } else { 0 }]),
            row_sums: Vec::new(),
        };
        shapes.iter().enumerate().for_each(|(class, shape)| this.fill(class, shape));
        let lines = shapes.len() * phases * rows;
        let sum = |line: usize| this.shares[line * (ACROSS + 1) * columns..][..columns].iter().sum();
        this.row_sums = (0..lines).map(sum).collect();
        this
    }

    /// Fills the table of a class: products of profiles across and down, for each slab of the cell.
    fn fill(&mut self, class: usize, shape: &Shape) {
        let (phases, columns) = (1usize << self.bits, self.columns);
        let spans = shape.spans();
        let half_px = f64::from(self.half_px);
        // Integrate each slab along both axes, for every phase.
        let profiles = |pixels: usize, along: usize, phases: &[f64]| -> Vec<Vec<(Vec<f32>, Vec<f32>)>> {
            let of_phase = |phase: &f64| {
                let of_span = |span: &[Span; 2]| profile(&span[along], half_px + phase, pixels, shape);
                spans.iter().map(of_span).collect()
            };
            phases.iter().map(of_phase).collect()
        };
        let places_across: Vec<f64> = (0..=ACROSS).map(|n| n as f64 / ACROSS as f64).collect();
        let places_down: Vec<f64> = (0..phases).map(|n| (n as f64 + 0.5) / phases as f64).collect();
        let (profiles_across, profiles_down) =
            (profiles(columns, 0, &places_across), profiles(self.rows, 1, &places_down));
        // Multiply, and add the slabs.
        let scale = shape.scale as f32;
        for (n, down) in profiles_down.iter().enumerate() {
            for (m, across_profiles) in profiles_across.iter().enumerate() {
                for row in 0..self.rows {
                    let line = (class * phases + n) * self.rows + row;
                    let places = (line * (ACROSS + 1) + m) * columns..(line * (ACROSS + 1) + m + 1) * columns;
                    for ((down, down_moment), (across, across_moment)) in down.iter().zip(across_profiles) {
                        let (down, down_moment) = (scale * down[row], scale * down_moment[row]);
                        if down == 0.0 {
                            continue;
                        }
                        add(&mut self.shares[places.clone()], down, across);
                        if !self.moments[0].is_empty() {
                            add(&mut self.moments[0][places.clone()], down, across_moment);
                            add(&mut self.moments[1][places.clone()], down_moment, across);
                        }
                    }
                }
            }
        }
    }

    /// Predicts the bytes of a table for patches of `side_px` a side, in a number of classes.
    pub(super) fn estimated_bytes(side_px: f64, classes: usize, has_moments: bool) -> usize {
        let Size { rows, columns, bits } = Size::new(side_px, classes);
        let lines = classes * (rows << bits);
        4 * lines * (if has_moments { 3 } else { 1 } * (ACROSS + 1) * columns + 1)
    }
}
