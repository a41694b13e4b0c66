//! Following the lattice through a white image, from its period to every centre.
//!
//! The period gives a basis and a patch of some lenslets gives the mean cell. From there the lattice is followed
//! outwards: lenslets within a radius are read against the cell, a smooth lattice is fitted to the centres, cell and
//! radius are renewed. On the whole frame the two fits, cell and lattice, are repeated until the lattice rests; then
//! every lenslet is read once. Cost: one pass over the pixels, and what does not grow with the image.

use crate::Refusal;
use crate::cats_eye::{Part, TwoStops, Untouched};
use crate::cell::{Cell, Fold};
use crate::fit::{Tie, Warp, unit_basis, without_outliers};
use crate::period::{Period, shortest};
use crate::radial::RadialFold;
use crate::reading::{Reading, read, window};
use crate::rim::side_px;
use crate::symmetry::centre_of;
use glam::{DMat2, DVec2};
use lf_core::camera::Layout;
use ndarray::ArrayView2;
use rayon::prelude::*;

/// Half the side of the first patch, in lattice vectors: the period is then still good to a twentieth of a pixel.
const FIRST_PATCH: f64 = 12.0;
/// Growth of the radius from one fit to the next.
const GROWTH: f64 = 1.7;
/// Lenslets needed before the followed lattice may bend (a cubic has ten coefficients), and at all.
const ENOUGH_TO_BEND: usize = 150;
/// Fewest lenslets that make a lattice.
pub(crate) const FEWEST: usize = 12;
/// Least share of a lenslet's variance that the mean cell explains.
const LEAST_EXPLAINED: f64 = 0.3;
/// Largest relative change of the gain from one lenslet to the next: more is an extrapolation gone wrong.
const MOST_SHADE: f64 = 0.2;
/// Pixels that the round part and the remainder of the mean cell are fitted to. More cost time and gain nothing: they
/// are thousands for each unknown.
const ROUND_PIXELS: usize = 1 << 16;
const REMAINDER_PIXELS: usize = 1 << 19;
/// By how much less will do while the lattice is followed.
const ROUGH: usize = 4;
/// Least deviation of the remainder, over the round part's, that is not taken for what sampling and noise leave.
const LEAST_REMAINDER: f64 = 0.03;
/// The lattice rests when no lenslet of it moves by more, px.
const AT_REST_PX: f64 = 1e-4;
/// Times that cell and lattice are repeated at most.
const RESTS: u64 = 5;
/// What a trail's `watch` counts up to: the way to the corners, three rests, the last reading. What is left out counts as
/// done.
pub(crate) const ROUNDS: u64 = 2 + 3 * RESTS;
/// Parts of the frame, along each side, whose mean cells are looked at for a second stop; pixels that each is the mean
/// of, and fewest lenslets.
const PARTS: usize = 7;
const PART_PIXELS: usize = 1 << 15;
const FEWEST_IN_PART: usize = 3;
/// Of lenslets that a second stop cuts, one in so many, the least cut, tells the cell, but not fewer.
const LEAST_CUT: usize = 10;
const FEWEST_UNCUT: usize = 100;
/// Lenslets that are read while the lattice is followed and settled; the last reading is of all.
const SAMPLE: usize = 3000;

pub(crate) fn few(found: usize) -> Refusal {
    Refusal::new(
        format!("only {found} lenslets follow one lattice"),
        format!("wanted a white image of at least {FEWEST} lenslets, evenly lit"),
    )
}

/// The lattice as far as it has been followed.
#[derive(Debug, Clone)]
pub(crate) struct Trail {
    cell: Cell,
    pub basis_px: DMat2,
    pub warp: Warp,
    /// Gain over the frame, in x.
    shade: Warp,
    radius: f64,
    /// Whether it reaches to the corners of the frame: until then a rough cell will do.
    whole: bool,
    /// Whether the lattice rests on the round part of the cell, so that the remainder can be told from a wrong centre.
    settled: bool,
    /// The second stop that cuts into lenslet images, once it has been seen.
    pub stops: Option<TwoStops>,
    /// Radius of the round part of the cell.
    pub radius_px: Option<f64>,
    pub readings: Vec<(DVec2, Reading)>,
}

impl Trail {
    /// The whole way, from the period to every lenslet of the frame.
    pub fn blaze(image: ArrayView2<f32>, period: &Period, watch: &dyn Fn(u64)) -> Result<Self, Refusal> {
        let mut trail = Self::start(image, period).ok_or_else(|| few(0))?;
        trail.follow(image)?;
        watch(1);
        trail.settle(image, watch)?;
        Ok(trail)
    }

    /// Starts from the piece of the image where the largest share of lenslets can be read.
    fn start(image: ArrayView2<f32>, period: &Period) -> Option<Self> {
        let mut best: Option<(f64, Self)> = None;
        for corner in &period.corners {
            let Some((share, trail)) = Self::from_tile(image, period, *corner) else { continue };
            if best.as_ref().is_none_or(|best| share > best.0) {
                best = Some((share, trail));
            }
            if share > 0.9 {
                break;
            }
        }
        best.map(|best| best.1)
    }

    fn from_tile(image: ArrayView2<f32>, period: &Period, corner: [usize; 2]) -> Option<(f64, Self)> {
        let basis = period.basis_px;
        let half = FIRST_PATCH * shortest(basis);
        let middle = [0, 1].map(|axis| corner[axis] as f64 + 0.5 * period.tile[axis] as f64);
        let range = |axis: usize| {
            let first = (middle[axis] - half).max(corner[axis] as f64) as usize;
            first..((middle[axis] + half) as usize).min(corner[axis] + period.tile[axis])
        };
        let (columns, rows) = (range(0), range(1));
        let pixels = || rows.clone().flat_map(|row| columns.clone().map(move |column| (column, row)));
        let sum: f64 = pixels().map(|(column, row)| image[(row, column)] as f64).sum();
        if sum <= 0.0 {
            return None;
        }
        let mean = sum / pixels().count() as f64;
        let to_cell = basis.inverse();
        let folded = |origin: DVec2, symmetric: bool| {
            let mut fold = Fold::new(basis);
            for (column, row) in pixels() {
                let place = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                fold.add(to_cell * (place - origin), image[(row, column)] as f64 / mean);
            }
            fold.solve(symmetric)
        };

        // The plain cell says where the discs are; the symmetric one is what they are read against.
        let middle = DVec2::from(middle);
        let hexagonal = layout_of(basis).0 == Layout::Hexagonal;
        let origin = middle + basis * centre_of(&folded(middle, false), basis, hexagonal);
        let cell = folded(origin, true);
        let warp = Warp::affine(origin, basis);
        let shade = Warp::affine(DVec2::X, DMat2::ZERO);
        let mut trail = Self {
            cell,
            basis_px: basis,
            warp,
            shade,
            radius: FIRST_PATCH,
            whole: false,
            settled: false,
            stops: None,
            radius_px: None,
            readings: Vec::new(),
        };
        let tried = trail.read(image, SAMPLE);
        (trail.readings.len() >= FEWEST).then(|| (trail.readings.len() as f64 / tried as f64, trail))
    }

    /// Reads the lenslets within the radius, evenly thinned to about `most`; how many were tried.
    fn read(&mut self, image: ArrayView2<f32>, most: usize) -> usize {
        let shortest = shortest(self.basis_px);
        let mut places = self.places(image.dim());
        let share = most as f64 / places.len() as f64;
        // Multiples of irrational numbers fill the interval from 0 to 1 evenly, row by row and column by column.
        places.retain(|place| (place.x * 0.618_034 + place.y * 0.414_214).rem_euclid(1.0) < share);
        places.retain(|&place| window(self.warp.at(place), shortest, image.dim()).is_some());
        self.readings = places
            .par_iter()
            .filter_map(|&place| {
                let (from, shade) = (self.warp.at(place), self.shade_at(place));
                let untouched = self.untouched(from, image.dim());
                let reading = read(image, &self.cell, self.basis_px, from, shade, untouched.as_ref())?;
                (reading.explained >= LEAST_EXPLAINED).then_some((place, reading))
            })
            .collect();
        places.len()
    }

    /// What a second stop leaves of the lenslet imaged at a place; none where that is all of it.
    fn untouched(&self, centre_px: DVec2, size: (usize, usize)) -> Option<Untouched> {
        Untouched::under(self.stops.as_ref()?, centre_px - middle_px(size), self.basis_px)
    }

    /// Lattice places within the radius that may be in the frame, row by row.
    pub fn places(&self, (height, width): (usize, usize)) -> Vec<DVec2> {
        let to_place = self.basis_px.inverse();
        let corners = [(0, 0), (width, 0), (0, height), (width, height)]
            .map(|(x, y)| to_place * (DVec2::new(x as f64, y as f64) - self.warp.at(DVec2::ZERO)));
        let low = corners.iter().copied().reduce(DVec2::min).unwrap_or_default().floor() - 3.0;
        let high = corners.iter().copied().reduce(DVec2::max).unwrap_or_default().ceil() + 3.0;
        let reach = (self.radius * shortest(self.basis_px)).powi(2);
        let within = |n: f64, (low, high): (f64, f64)| n.clamp(low, high) as i64;
        let side = 2.0 * self.radius;
        let rows = within(low.y, (-side, side))..=within(high.y, (-side, side));
        let columns = within(low.x, (-side, side))..=within(high.x, (-side, side));
        rows.flat_map(|row| columns.clone().map(move |column| DVec2::new(column as f64, row as f64)))
            .filter(|&place| (self.basis_px * place).length_squared() <= reach)
            .collect()
    }

    /// Fits the smooth lattice to what was read; which readings it kept.
    fn fit_warp(&mut self) -> Result<Vec<bool>, Refusal> {
        let count = self.readings.len();
        let ties: Vec<Tie> = self.readings.iter().map(|(place, reading)| (*place, reading.centre_px)).collect();
        let order = if count < ENOUGH_TO_BEND { 1 } else { 3 };
        let fitted = without_outliers(&ties, &self.spreads(), |ties| Warp::through(ties, order), Warp::at);
        let Some((warp, kept)) = fitted.filter(|_| count >= FEWEST) else {
            return Err(few(count));
        };
        self.warp = warp;
        let gains: Vec<Tie> = self.readings.iter().map(|(place, reading)| (*place, reading.gain * DVec2::X)).collect();
        let even = vec![1.0; gains.len()];
        if let Some((shade, _)) = without_outliers(&gains, &even, |gains| Warp::through(gains, order), Warp::at) {
            self.shade = shade;
        }
        let followed: Vec<Tie> = ties.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(tie, _)| *tie).collect();
        let affine = Warp::through(&followed, 1).ok_or_else(|| few(count))?;
        let basis = affine.basis_at(DVec2::ZERO);
        let moved = basis - self.basis_px;
        // A lattice that changes its shape on the way is none, and a vanishing one would never be left.
        if !moved.is_finite() || moved.x_axis.length() + moved.y_axis.length() > 0.2 * shortest(self.basis_px) {
            return Err(few(count));
        }
        self.basis_px = basis;
        Ok(kept)
    }

    /// How far noise moves each centre that was read, in a common unit.
    pub fn spreads(&self) -> Vec<f64> {
        self.readings.iter().map(|(_, reading)| reading.spread_px).collect()
    }

    /// Relative change of the gain, per px, from the gains of the lenslets around.
    fn shade_at(&self, place: DVec2) -> DVec2 {
        let gain = self.shade.at(place).x;
        let steps = self.shade.basis_at(place);
        let slope = self.basis_px.inverse().transpose() * DVec2::new(steps.x_axis.x, steps.y_axis.x);
        if gain > 0.0 { (slope / gain).clamp_length_max(MOST_SHADE / shortest(self.basis_px)) } else { DVec2::ZERO }
    }

    /// Fits the smooth lattice, then the cell, to what was read.
    fn fit(&mut self, image: ArrayView2<f32>) -> Result<(), Refusal> {
        let kept = self.fit_warp()?;
        let followed: Vec<_> =
            self.readings.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(reading, _)| *reading).collect();
        let followed = self.least_cut(followed, image.dim());
        self.cell = self.cell_of(image, &followed).ok_or_else(|| few(followed.len()))?;
        Ok(())
    }

    /// The lenslets that a second stop cuts least; all where there is none. Of a disc that is seen from one side a wrong
    /// radius and a wrong place look alike: those seen nearly all round tell the radius.
    fn least_cut(&self, mut readings: Vec<(DVec2, Reading)>, size: (usize, usize)) -> Vec<(DVec2, Reading)> {
        let Some(stops) = &self.stops else { return readings };
        let cut = |reading: &(DVec2, Reading)| stops.cut_px(reading.1.centre_px - middle_px(size));
        let mut cuts: Vec<f64> = readings.iter().map(cut).collect();
        cuts.sort_unstable_by(f64::total_cmp);
        let limit =
            cuts.get((cuts.len() / LEAST_CUT).max(FEWEST_UNCUT)).copied().or(cuts.last().copied()).unwrap_or(0.0);
        readings.retain(|reading| cut(reading) <= limit);
        readings
    }

    /// The cell through the pixels of lenslets, each brought to the same floor and gain, about the smooth lattice: its
    /// round part, and where that leaves a remainder worth the name, the remainder.
    fn cell_of(&mut self, image: ArrayView2<f32>, readings: &[(DVec2, Reading)]) -> Option<Cell> {
        let basis = self.basis_px;
        let knots = Cell::table_knots(basis);
        let round = self.folded(
            image,
            &thinned(readings, basis, if self.whole { ROUND_PIXELS } else { ROUND_PIXELS / ROUGH }),
            || (RadialFold::new(basis), Vec::new()),
            |(fold, line), offset, value| fold.add(offset, value, line),
            |(sum, _), (fold, _)| sum.merge(fold),
        );
        let (mut table, radius_px) = round.0.solve(knots)?;
        self.radius_px = radius_px;
        let cell = Cell::through(knots, &table);
        if !self.settled {
            return Some(cell);
        }

        let to_cell = basis.inverse();
        let remainder = self.folded(
            image,
            &thinned(readings, basis, REMAINDER_PIXELS),
            || Fold::new(basis),
            |fold, offset, value| fold.add(to_cell * offset, value - cell.at(to_cell * offset).0),
            Fold::merge,
        );
        let remainder = remainder.solve(true);
        let mut left: Vec<f64> = (0..table.len()).map(|knot| remainder.at(Cell::place(knots, knot)).0).collect();
        let share = deviation(&left) / deviation(&table);
        if share < LEAST_REMAINDER {
            return Some(cell);
        }
        left.iter_mut().zip(&mut table).for_each(|(left, round)| *round += *left);
        Some(Cell::through(knots, &table))
    }

    /// A sum over the pixels of lenslets, each given by its offset from the smooth lattice and its count less the
    /// lenslet's floor, over its gain.
    fn folded<T: Send>(
        &self,
        image: ArrayView2<f32>,
        readings: &[(DVec2, Reading)],
        empty: impl Fn() -> T + Sync,
        add: impl Fn(&mut T, DVec2, f64) + Sync,
        merge: impl Fn(&mut T, &T),
    ) -> T {
        let shortest = shortest(self.basis_px);
        // Always eight sums, added in order: the answer may not depend on the threads.
        let parts: Vec<T> = readings
            .par_chunks(readings.len().div_ceil(8).max(1))
            .map(|readings| {
                let mut part = empty();
                for (place, reading) in readings {
                    let centre = self.warp.at(*place);
                    let untouched = self.untouched(centre, image.dim());
                    for (column, row) in window(centre, shortest, image.dim()).into_iter().flatten() {
                        let offset = DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - centre;
                        if untouched.as_ref().is_some_and(|untouched| !untouched.holds(offset)) {
                            continue;
                        }
                        add(&mut part, offset, reading.level(image[(row, column)] as f64, offset));
                    }
                }
                part
            })
            .collect();
        let mut sum = empty();
        parts.iter().for_each(|part| merge(&mut sum, part));
        sum
    }

    /// Follows the lattice from the first patch to the corners of the frame.
    fn follow(&mut self, image: ArrayView2<f32>) -> Result<(), Refusal> {
        let (height, width) = image.dim();
        let diagonal = (width as f64).hypot(height as f64) / shortest(self.basis_px);
        loop {
            self.fit(image)?;
            if self.radius > diagonal {
                self.whole = true;
                return Ok(());
            }
            self.radius *= GROWTH;
            self.read(image, SAMPLE / ROUGH);
        }
    }

    /// Repeats cell and lattice on the whole frame until the lattice rests: on the round cell, then without what a second
    /// stop has touched where there is one, then on the whole cell.
    fn settle(&mut self, image: ArrayView2<f32>, watch: &dyn Fn(u64)) -> Result<(), Refusal> {
        self.rest(image, watch)?;
        self.stops = TwoStops::seen(&self.parts(image));
        if self.stops.is_some() {
            self.rest(image, watch)?;
        } else {
            watch(RESTS);
        }
        self.settled = true;
        self.rest(image, watch)?;
        self.read(image, usize::MAX);
        self.fit_warp()?;
        watch(1);
        Ok(())
    }

    fn rest(&mut self, image: ArrayView2<f32>, watch: &dyn Fn(u64)) -> Result<(), Refusal> {
        let ends: Vec<DVec2> = self.readings.iter().map(|reading| reading.0).collect();
        for done in 1..=RESTS {
            let before = self.warp.clone();
            self.read(image, SAMPLE);
            self.fit(image)?;
            let moved = ends.iter().map(|&place| self.warp.at(place).distance(before.at(place))).fold(0.0, f64::max);
            watch(1);
            if moved < AT_REST_PX {
                watch(RESTS - done);
                break;
            }
        }
        Ok(())
    }

    /// The rims of the mean cells of parts of the frame.
    fn parts(&self, image: ArrayView2<f32>) -> Vec<Part> {
        let (height, width) = image.dim();
        let basis = self.basis_px;
        let to_cell = basis.inverse();
        let mut parts = vec![Vec::new(); PARTS * PARTS];
        for (place, reading) in &self.readings {
            let centre = reading.centre_px;
            let part = |place: f64, size: usize| ((place / size as f64 * PARTS as f64) as usize).min(PARTS - 1);
            parts[part(centre.y, height) * PARTS + part(centre.x, width)].push((*place, *reading));
        }
        let rim = |readings: &Vec<(DVec2, Reading)>| {
            let readings = thinned(readings, basis, PART_PIXELS);
            if readings.len() < FEWEST_IN_PART {
                return None;
            }
            let mut fold = Fold::new(basis);
            let mut middle = DVec2::ZERO;
            for (place, reading) in &readings {
                let centre = self.warp.at(*place);
                middle += (centre - middle_px(image.dim())) / readings.len() as f64;
                for (column, row) in window(centre, shortest(basis), image.dim()).into_iter().flatten() {
                    let offset = DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - centre;
                    fold.add(to_cell * offset, reading.level(image[(row, column)] as f64, offset));
                }
            }
            Part::of(middle, &fold.solve(false), basis)
        };
        parts.par_iter().filter_map(rim).collect()
    }

    /// Side of the lenslet images if they are square, px.
    pub fn side_px(&self) -> Option<f64> {
        side_px(&self.cell, self.basis_px)
    }
}

/// The middle of an image of (height, width), px.
fn middle_px((height, width): (usize, usize)) -> DVec2 {
    0.5 * DVec2::new(width as f64, height as f64)
}

/// Evenly chosen lenslets that hold about `pixels` pixels.
fn thinned(readings: &[(DVec2, Reading)], basis_px: DMat2, pixels: usize) -> Vec<(DVec2, Reading)> {
    let each = (1.2 * shortest(basis_px).powi(2)).ceil() as usize;
    readings.iter().step_by((readings.len() * each).div_ceil(pixels).max(1)).copied().collect()
}

/// Standard deviation.
fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

/// The layout that a basis is nearest to, and how far it is from it, as a share of its length.
pub(crate) fn layout_of(basis_px: DMat2) -> (Layout, f64) {
    let strain = |hexagonal: bool| {
        let unit = unit_basis(hexagonal);
        let cells = [(DVec2::X, basis_px.x_axis), (DVec2::Y, basis_px.y_axis)];
        // The best turn and scale of the unit lattice, through its own origin.
        let turn: DVec2 = cells.iter().map(|(n, x)| (unit * *n * DVec2::new(1.0, -1.0)).rotate(*x)).sum();
        let turn = turn / 2.0;
        let rest: f64 = cells.iter().map(|(n, x)| turn.rotate(unit * *n).distance_squared(*x)).sum();
        (rest / (2.0 * turn.length_squared())).sqrt()
    };
    let (square, hexagonal) = (strain(false), strain(true));
    if square <= hexagonal { (Layout::Square, square) } else { (Layout::Hexagonal, hexagonal) }
}
