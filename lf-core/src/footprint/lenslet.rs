//! Weights through one lenslet at a time, for lattices that are not in line: every lenslet's image of a voxel is a
//! product of a column profile and a row profile for each slab of its cell.
//!
//! The same weights as [`Footprint::visit`], which is the slow and obvious way; here profiles are differences of a
//! tabulated integral, and rows that are not wanted are never made.

use super::axis::{Axis, Span};
use super::blur::Blur;
use super::{Chords, Footprint, Model};
use crate::optics::Optics;
use glam::DVec2;

/// Every `step`-th image row from `first` on; `step` is 1 or more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowSet {
    /// The first row, less than `step`.
    pub first: u32,
    /// Rows to the next.
    pub step: u32,
}

impl RowSet {
    /// All rows.
    pub const ALL: Self = Self { first: 0, step: 1 };

    /// Whether a row is one of them.
    #[inline]
    pub fn holds(self, row: u32) -> bool {
        row % self.step == self.first
    }

    /// Those of `low .. high`, rising.
    fn within(self, low: u32, high: u32) -> impl Iterator<Item = u32> {
        let behind = (low % self.step + self.step - self.first) % self.step;
        let start = if behind == 0 { low } else { low + self.step - behind };
        (start..high).step_by(self.step as usize)
    }
}

/// Table steps a pixel: linear interpolation of the integral of a Gaussian edge errs by 2e-5 px or less.
const STEPS_PER_PX: f64 = 64.0;

/// The integral of a span's share, tabulated where that is quicker than to compute it.
#[derive(Debug, Clone)]
struct Ramp {
    span: Span,
    /// Of the table: first place and steps a mm; at both ends the integral goes on as a constant.
    from: f64,
    per_mm: f64,
    /// The last place that has another behind it.
    last: f64,
    table: Vec<f32>,
}

impl Ramp {
    fn new(span: Span, pixel_pitch: f64) -> Self {
        let reach = span.blur.reach();
        let (from, to) = (span.low - reach, span.high + reach);
        let per_mm = STEPS_PER_PX / pixel_pitch;
        let table = if matches!(span.blur, Blur::Gauss { .. }) {
            let count = ((to - from) * per_mm).ceil() as usize + 2;
            (0..count).map(|n| (span.ramp(from + n as f64 / per_mm) * per_mm) as f32).collect()
        } else {
            Vec::new()
        };
        let last = table.len().saturating_sub(2) as f64;
        Self { span, from, per_mm, last, table }
    }

    /// In steps of the table.
    #[inline]
    fn at(&self, t: f64) -> f32 {
        if self.table.is_empty() {
            return (self.span.ramp(t) * self.per_mm) as f32;
        }
        let place = ((t - self.from) * self.per_mm).max(0.0).min(self.last);
        let n = place as usize;
        let part = (place - n as f64) as f32;
        self.table[n] + part * (self.table[n + 1] - self.table[n])
    }
}

/// Shares of consecutive pixels, and for a round stop the parts of the aperture behind them.
#[derive(Debug, Default)]
struct Shares {
    first: u32,
    weights: Vec<f32>,
    parts: Vec<(f32, f32)>,
}

/// What [`Footprint::through_lenslets`] needs for the slice it is in; one a thread.
#[derive(Debug, Default)]
pub struct Lenslets {
    slice: Option<usize>,
    across: Option<Axis>,
    down: Option<Axis>,
    columns: Vec<Ramp>,
    rows: Vec<Ramp>,
    /// Half sides of all slabs.
    corner: DVec2,
    shares: Shares,
    cut: Vec<f32>,
}

/// Light through one lenslet onto one axis.
struct Fan<'a> {
    axis: &'a Axis,
    ramp: &'a Ramp,
    /// Chief ray less lenslet, mm.
    t0: f64,
    /// Place in pixels is `zero - slope U`.
    zero: f64,
    slope: f64,
    per_slope: f64,
    low: f64,
    high: f64,
    flat: bool,
}

impl<'a> Fan<'a> {
    /// Nothing where no light comes through.
    #[inline]
    fn new(axis: &'a Axis, ramp: &'a Ramp, x0: f64, centre: f64) -> Option<Self> {
        let t0 = x0 - centre;
        let (low, high) = axis.aperture_part(t0, &ramp.span);
        if low >= high {
            return None;
        }
        let (zero, slope) = axis.line(x0, centre);
        let flat = axis.alpha.abs() * (high - low) < 1e-9;
        Some(Self { axis, ramp, t0, zero, slope, per_slope: 1.0 / slope, low, high, flat })
    }

    /// First and end pixel.
    #[inline]
    fn pixels(&self) -> (u32, u32) {
        // Casts saturate and cut towards zero; a pixel too many at the end has no light.
        let first = (self.zero - self.slope * self.high) as u32;
        let end = (self.zero - self.slope * self.low) as u32 + 1;
        (first, end.min(self.axis.pixels as u32))
    }

    /// The part of the aperture at a pixel's lower edge: U falls as pixels rise.
    #[inline]
    fn edge(&self, pixel: u32) -> f64 {
        ((self.zero - f64::from(pixel)) * self.per_slope).max(self.low).min(self.high)
    }

    #[inline]
    fn integral(&self, u: f64) -> f32 {
        self.ramp.at(self.t0 + self.axis.alpha * u)
    }

    /// What differences of the integral are multiplied by.
    #[inline]
    fn unit(&self) -> f32 {
        (1.0 / (self.ramp.per_mm * self.axis.alpha * 2.0 * self.axis.half_aperture)) as f32
    }

    #[inline]
    fn flat_share(&self, lower: f64, upper: f64) -> f32 {
        let middle = self.t0 + self.axis.alpha * 0.5 * (lower + upper);
        (self.ramp.span.share(middle) * (upper - lower) / (2.0 * self.axis.half_aperture)) as f32
    }

    /// Share of one pixel, and the part of the aperture behind it.
    #[inline]
    fn share(&self, pixel: u32) -> (f32, f64, f64) {
        let (lower, upper) = (self.edge(pixel + 1), self.edge(pixel));
        let share = if self.flat {
            self.flat_share(lower, upper)
        } else {
            (self.integral(upper) - self.integral(lower)) * self.unit()
        };
        (share, lower, upper)
    }

    /// Shares of all pixels; with the parts of the aperture behind them if asked for.
    fn shares(&self, parts: bool, out: &mut Shares) {
        let (first, last) = self.pixels();
        out.first = first;
        out.weights.clear();
        out.parts.clear();
        if first >= last {
            return;
        }
        let mut upper = self.edge(first);
        let mut above = if self.flat { 0.0 } else { self.integral(upper) };
        let unit = self.unit();
        for pixel in first..last {
            let lower = self.edge(pixel + 1);
            let share = if self.flat {
                self.flat_share(lower, upper)
            } else {
                let below = self.integral(lower);
                let share = (above - below) * unit;
                above = below;
                share
            };
            out.weights.push(if share > LEAST { share } else { 0.0 });
            if parts {
                let (u0, u1) = self.axis.unblurred(self.t0, &self.ramp.span, lower, upper);
                out.parts.push((u0 as f32, u1 as f32));
            }
            upper = lower;
        }
    }
}

impl Lenslets {
    fn enter(&mut self, footprint: &Footprint, z: usize) {
        if self.slice == Some(z) {
            return;
        }
        let (across, down) = (footprint.axis(z, footprint.width), footprint.axis(z, footprint.height));
        let (blur_x, blur_y) = (footprint.blur(&across, 0), footprint.blur(&down, 1));
        let slabs = footprint.slabs(&across);
        let pitch = footprint.pixel_pitch_mm;
        let ramp =
            |[low, high]: [f64; 2], blur: Blur, slant| Ramp::new(Span { low, high, blur: blur.widened(slant) }, pitch);
        self.columns = slabs.iter().map(|slab| ramp(slab.x, blur_x, slab.slant_x)).collect();
        self.rows = slabs.iter().map(|slab| ramp(slab.y, blur_y, slab.slant_y)).collect();
        self.corner = footprint.corner(slabs);
        (self.across, self.down) = (Some(across), Some(down));
        self.slice = Some(z);
    }
}

impl Footprint {
    /// Calls `found(row, first column, share, columns)` for every wanted image row of every lenslet slab that a voxel
    /// lights: the weights are `share * columns[n]` on pixel `first column + n`. A pixel may come more than once. For
    /// [`Model::Exact`] alone; others go through [`Footprint::visit`].
    pub fn through_lenslets(
        &self,
        voxel: [usize; 3],
        lenslets: &mut Lenslets,
        wanted: RowSet,
        mut found: impl FnMut(u32, u32, f32, &[f32]),
    ) {
        debug_assert!(self.model == Model::Exact);
        let [x, y, z] = voxel;
        lenslets.enter(self, z);
        let Lenslets { across: Some(across), down: Some(down), columns, rows, corner, shares, cut, .. } = lenslets
        else {
            return;
        };
        let chief = DVec2::new(-across.beta * self.grid.centre_mm(0, x), -across.beta * self.grid.centre_mm(1, y));
        let blur = DVec2::new(self.blur(across, 0).reach(), self.blur(down, 1).reach());
        let spread = across.alpha.abs() * across.half_aperture;
        let optics: &Optics = &self.optics;
        for (_, _, centre) in optics.lattice().lenslets_within(chief, *corner + blur + DVec2::splat(spread)) {
            if self.circle {
                let beyond = ((centre - chief).abs() - *corner - blur).max(DVec2::ZERO);
                if beyond.length_squared() > spread * spread {
                    continue;
                }
            }
            for (row_ramp, column_ramp) in rows.iter().zip(columns.iter()) {
                let Some(fan) = Fan::new(down, row_ramp, chief.y, centre.y) else { continue };
                let (low, high) = fan.pixels();
                let mut known = false;
                for row in wanted.within(low, high) {
                    let (share, lower, upper) = fan.share(row);
                    if share <= LEAST {
                        continue;
                    }
                    if !known {
                        let Some(columns) = Fan::new(across, column_ramp, chief.x, centre.x) else { break };
                        columns.shares(self.circle, shares);
                        if shares.weights.is_empty() {
                            break;
                        }
                        known = true;
                    }
                    if self.circle {
                        let (v0, v1) = down.unblurred(fan.t0, &row_ramp.span, lower, upper);
                        let chords = Chords::of_disc(optics.half_aperture_mm(), v0, v1);
                        cut.clear();
                        let parts = shares.weights.iter().zip(&shares.parts);
                        cut.extend(parts.map(|(weight, (u0, u1))| weight * chords.share(*u0, *u1)));
                        found(row, shares.first, self.scale * share, cut);
                    } else {
                        found(row, shares.first, self.scale * share, &shares.weights);
                    }
                }
            }
        }
    }
}

/// A column's or a row's share below this is not kept; those of a voxel sum to 1.
const LEAST: f32 = 1e-6;
